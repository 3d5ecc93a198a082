"""Real scans and generated ones: read as they are, learnt apart, judged on places that were not learnt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
pytest.importorskip("sklearn", reason="scikit-learn is not installed")
from sightline_evidence import real
from sightline_evidence.labels import COMMON

ROAD, BUILDING, PERSON, MOVING_CAR = 40, 50, 30, 252


def write(folder: Path, sequence: str, frame: int, count: int = 400) -> None:
    """Road 1.73 m below the sensor and a wall, with the labels of SemanticKITTI."""
    rng = np.random.default_rng([int(sequence), frame])
    road = np.c_[rng.uniform(-20, 20, (count, 2)), np.full(count, -1.73)]
    wall = np.c_[np.full(count, 10.0), rng.uniform(-20, 20, count), rng.uniform(-1.5, 3, count)]
    odd = np.array([[3.0, 1, -1], [4, 1, -1], [60, 0, 0]])
    xyz = np.r_[road, wall, odd]
    labels = np.r_[np.full(count, ROAD), np.full(count, BUILDING), [PERSON, MOVING_CAR, BUILDING]].astype("<u4")
    for kind in ("velodyne", "labels"):
        (folder / "sequences" / sequence / kind).mkdir(parents=True, exist_ok=True)
    points = folder / "sequences" / sequence / "velodyne" / f"{frame:06}.bin"
    np.c_[xyz, np.zeros(len(xyz))].astype("<f4").tofile(points)
    # The upper half of a label is the instance.
    (labels | 7 << 16).tofile(folder / "sequences" / sequence / "labels" / f"{frame:06}.label")


def test_a_real_scan_stands_on_the_ground_with_common_groups(tmp_path: Path) -> None:
    write(tmp_path, "00", 0)
    write(tmp_path, "04", 0)
    (_, points, labels), _ = real.sequences(tmp_path)
    scan = real.read_scan(points, labels)
    assert len(scan.xyz) == 802, "the point beyond the region is left out"
    np.testing.assert_allclose(scan.xyz[:400, 2], 0, atol=1e-6)
    named = [COMMON[group] for group in scan.labels]
    assert named[:400] == ["road"] * 400 and named[400:800] == ["built"] * 400
    assert named[800:] == ["pedestrian", "vehicle"]


def test_few_scans_of_each_sequence_spread_over_it(tmp_path: Path) -> None:
    for frame in range(9):
        write(tmp_path, "00", frame, 3)
    write(tmp_path, "11", 4, 3)
    found = real.sequences(tmp_path)
    assert [points.stem for name, points, _ in found if name == "00"] == ["000000", "000002", "000004", "000006", "000008"]
    assert [name for name, _, _ in found].count("11") == 1


def test_bad_folders_are_refused(tmp_path: Path) -> None:
    write(tmp_path, "00", 0, 3)
    with pytest.raises(ValueError, match="fewer than two sequences"):
        real.sequences(tmp_path)
    write(tmp_path, "01", 0, 3)
    _, points, _ = real.sequences(tmp_path)[0]
    labels = tmp_path / "short.label"
    np.zeros(3, "<u4").tofile(labels)
    with pytest.raises(ValueError, match=r"short.label: holds 3 labels, 000000.bin 9 points"):
        real.read_scan(points, labels)


def test_scans_and_versions_of_another_run_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "run"
    for sequence in ("00", "01"):
        write(tmp_path, sequence, 0, 3)
    files = real.sequences(tmp_path)
    kept = real.settled(files, out)
    assert len(kept["scans"]) == 4 and real.settled(files, out) == kept
    monkeypatch.setattr(real, "JUDGED", 7)
    with pytest.raises(ValueError, match="plan.json: judged_points are not those of this call; give another --out"):
        real.settled(files, out)
    monkeypatch.undo()
    # Equal names, other points.
    write(tmp_path, "01", 0, 4)
    with pytest.raises(ValueError, match="plan.json: scans are not those of this call"):
        real.settled(files, out)
    (out / "scans").mkdir()
    (out / "plan.json").unlink()
    with pytest.raises(ValueError, match="holds scans of which nothing was recorded"):
        real.settled(files, out)


def test_what_is_learnt_is_judged_elsewhere_and_shuffled_labels_teach_nothing(tmp_path: Path) -> None:
    for sequence in ("00", "01", "02"):
        for frame in range(2):
            write(tmp_path, sequence, frame)
    files = real.sequences(tmp_path)
    for name in ("00", "01", "02"):
        real.prepare_real([one for one in files if one[0] == name], tmp_path / "scans")
    scans = [real.load(tmp_path / "scans", f"real-{name}") for name in ("00", "01", "02")]
    assert [len(one) for one in scans] == [2, 2, 2]
    cells = real.judged(scans, scans[0] + scans[1], scans[2], 1)
    for learnt, tested in (("generated", "generated"), ("generated", "real"), ("real", "real"), ("real", "generated")):
        iou = cells[learnt][tested]["iou"]
        assert iou["road"] > 0.98 and iou["built"] > 0.98, (learnt, tested)
    assert cells["real"]["real"]["scans"] == 6
    assert cells["shuffled"]["real"]["miou"] < cells["shuffled"]["real"]["chance"] + 0.15
    assert "| generated | real | 6 |" in real.table({"cells": cells})
