"""Beams on targets and range cards are those of the program."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sightline
from sightline import Scene

CAR = "scenes/vehicles/car.json"


def program(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sightline", *arguments], capture_output=True, text=True, timeout=300
    )


def with_body(folder: Path) -> str:
    """The car of the examples with a body, which hides targets here and in the program alike."""
    car = json.loads(Path(CAR).read_text())
    car["body"] = [{"class": "vehicle", "box": {"foot": [0, 0, 0], "size": [4.2, 1.8, 1.6]}}]
    file = folder / "car.json"
    file.write_text(json.dumps(car))
    return str(file)


def rigs(folder: Path) -> tuple[Path, sightline.Placement]:
    lidars = [
        {"x": 0.0, "y": 0.3, "z": 1.9, "sensor": "spinning-32"},
        {"x": 0.2, "y": -0.3, "z": 1.9, "yaw": 0.4, "sensor": "spinning-32"},
    ]
    file = folder / "rig.json"
    file.write_text(json.dumps({"placements": [{"name": "two", "lidars": lidars}]}))
    return file, sightline.read_placements(file)[0]


def test_beams_on_targets_are_those_of_the_program(tmp_path: Path) -> None:
    (file, rig), car = rigs(tmp_path), with_body(tmp_path)
    scene = Scene.load("scenes/urban-crossing.json", vehicle=car, backend="cpu", frames=1)
    distances, bearings, targets = [8.0, 20.0, 40.0], [0.0, 135.0], ["car", "tyre"]
    beams = scene.beams_on(rig, targets, distances, bearings)
    assert beams.shape == (2, 2, 3, 2) and beams.dtype == np.uint32
    done = program(
        "study", "targets", str(file), "--vehicle", car, "--target", "car", "--target", "tyre",
        "--distances", "8,20,40", "--bearings", "0,135", "--format", "json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["rows"]
    assert beams.reshape(-1, 2).tolist() == [row["by_lidar"] for row in rows]
    assert beams[0].min() > 0 and beams[0].sum() > beams[1].sum()
    with pytest.warns(sightline.DoubtWarning, match=r"distances: the LiDARs reach .* no target at 500 m"):
        assert not scene.beams_on(rig, targets, [500.0], bearings).any()
    with pytest.raises(ValueError, match="did you mean `child`"):
        scene.beams_on(rig, ["chidl"], distances, bearings)
    with pytest.raises(ValueError, match=r"^distances\[0\]: is NaN; give metres above 0"):
        scene.beams_on(rig, targets, [np.nan], bearings)


def test_a_range_card_is_that_of_the_program(tmp_path: Path) -> None:
    file, rig = rigs(tmp_path)
    scene = Scene.load("scenes/urban-crossing.json", vehicle=CAR, backend="cpu", frames=1)
    done = program(
        "score", "scenes/urban-crossing.json", str(file), "--vehicle", CAR,
        "--frames", "1", "--backend", "cpu", "--format", "json",
    )  # fmt: skip
    # One LiDAR does not meet what the vehicle requires.
    assert done.returncode == 1 and "NOT MET" in done.stderr, done.stderr
    theirs = json.loads(done.stdout)["scores"][0]
    card = scene.range_card(rig)
    assert card == theirs["range_card"]
    assert [target["target"] for target in card["targets"]] == ["car", "adult", "tyre"]
    assert scene.score(rig).guards[0] == theirs["guards"]
