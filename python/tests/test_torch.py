"""`sightline.torch`: items, batches, worker processes."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import sightline
from .conftest import POSE

torch = pytest.importorskip("torch")
from sightline.torch import ScanDataset, collate  # noqa: E402

POSES = np.stack([POSE, POSE + [0.1, 0, 0.2, 0, 0, 0], POSE + [0.3, 0.1, 0.1, 0, 0, 1]])


def test_item_k_is_that_scan_and_its_labels(small: sightline.Scene) -> None:
    weather = ["crosstalk:share=0.3"]
    scans = ScanDataset(small, POSES, frames=[1, 0], columns=["xyz", "ring"], ignore=-7, conditions=weather, seed=5)
    assert len(scans) == 6
    for k, (placement, frame) in enumerate([(0, 1), (0, 0), (1, 1), (1, 0), (2, 1), (2, 0)]):
        scan = next(small.scan(POSES[placement], frames=[frame], conditions=weather, seed=5 + placement))
        item = scans[k]
        assert (item["placement"], item["frame"]) == (placement, frame)
        assert item["points"].dtype == torch.float32 and item["labels"].dtype == torch.int64
        assert np.array_equal(item["points"], np.column_stack([scan.xyz, scan.ring]))
        assert np.array_equal(item["labels"], scan.labels(-7)) and -7 in item["labels"]
        assert np.array_equal(scans[k - 6]["points"], item["points"])
    with pytest.raises(IndexError):
        scans[6]


def test_placements_are_taken_as_the_scene_takes_them(small: sightline.Scene) -> None:
    listed = ScanDataset(small, [sightline.Placement(poses) for poses in POSES])
    assert all(np.array_equal(listed[k]["points"], ScanDataset(small, POSES)[k]["points"]) for k in range(6))
    for wrong, told in [((POSE,), "placements"), ((POSES, ["xyz", "colour"]), "colour"), ((POSES, []), "columns")]:
        with pytest.raises(ValueError, match=told):
            ScanDataset(small, wrong[0], **({"columns": wrong[1]} if len(wrong) > 1 else {}))


def test_batches_concatenate_or_pad() -> None:
    def item(points: int, k: int) -> dict[str, Any]:
        values = torch.arange(1.0, 1 + points * 2).reshape(points, 2) + 100 * k
        return {"points": values, "labels": torch.full((points,), k), "placement": torch.tensor(k), "frame": torch.tensor(0)}

    items = [item(2, 0), item(0, 1), item(3, 2)]
    joined, padded = collate(items), collate(items, pad=True, ignore=-9)
    assert joined["points"].tolist() == [[1, 2], [3, 4], [201, 202], [203, 204], [205, 206]]
    assert joined["labels"].tolist() == [0, 0, 2, 2, 2] and joined["batch"].tolist() == [0, 0, 2, 2, 2]
    assert padded["points"].shape == (3, 3, 2) and padded["points"][0, 2].tolist() == [0, 0]
    assert padded["labels"].tolist() == [[0, 0, -9], [-9, -9, -9], [2, 2, 2]]
    assert padded["mask"].tolist() == [[True, True, False], [False] * 3, [True] * 3]
    assert joined["placement"].tolist() == padded["placement"].tolist() == [0, 1, 2]


WORKERS = """
import sys
import torch
from torch.utils.data import DataLoader
import sightline
from sightline.torch import ScanDataset, collate

if __name__ == "__main__":
    scene = sightline.Scene.load("scenes/industrial-yard.json", backend="cpu")
    scans = ScanDataset(scene, scene.random_poses(2), frames=[0, 7, 14])
    alone = [scans[k] for k in range(6)]
    loader = DataLoader(scans, batch_size=2, num_workers=2, collate_fn=collate, multiprocessing_context=sys.argv[1])
    batches = list(loader)
    assert len(batches) == 3
    for k, batch in enumerate(batches):
        own = collate(alone[2 * k : 2 * k + 2])
        assert batch.keys() == own.keys() and all(torch.equal(batch[key], own[key]) for key in own), k
    assert len(batches[0]["points"]) > 1000
"""


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_workers_give_the_scans_of_one_process(method: str, tmp_path: Any) -> None:
    script = tmp_path / "workers.py"
    script.write_text(WORKERS)
    done = subprocess.run([sys.executable, script, method], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
