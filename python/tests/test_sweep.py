"""Sweep and tolerance against scores of placements moved by hand, and those of the program."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sightline
from sightline import Scene

YARD = "scenes/industrial-yard.json"
RIG = "Pyramid-roll"


@pytest.fixture(scope="module")
def rig() -> sightline.Placement:
    return next(p for p in sightline.read_placements("scenes/placements.json") if p.name == RIG)


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The car of the paper, with a requirement that its rig just meets."""
    vehicle = json.loads(Path("scenes/vehicles/place3d.json").read_text())
    vehicle["require"] = [{"name": "near", "ground": 10, "share": 0.8}]
    file = tmp_path_factory.mktemp("vehicle") / "car.json"
    file.write_text(json.dumps(vehicle))
    return file


def printed(kind: str, vehicle: Path, tmp_path: Path, *more: str) -> Any:
    placements = json.loads(Path("scenes/placements.json").read_text())["placements"]
    file = tmp_path / "rig.json"
    file.write_text(json.dumps({"placements": [p for p in placements if p["name"] == RIG]}))
    done = subprocess.run(
        [sys.executable, "-m", "sightline", "study", kind, YARD, str(file), "--vehicle", str(vehicle), "--frames", "1",
         "--backend", "cpu", "--format", "json", *more],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


def test_a_sweep_is_the_score_of_each_pose(rig: sightline.Placement, vehicle: Path, tmp_path: Path) -> None:
    scene = Scene.load(YARD, vehicle=vehicle, backend="cpu", frames=1)
    values = [-5.0, 0.0, 7.5]
    found = scene.sweep(rig, "1.pitch", values)
    assert [row["value"] for row in found["rows"][1:]] == values and found["rows"][0]["as_given"]
    assert (found["lidar"], found["field"], found["unit"]) == (1, "pitch", "deg")
    poses = np.repeat(rig.poses[None], 3, axis=0)
    poses[:, 1, 4] = np.radians(values)
    scores = scene.score(poses)
    assert [row["scores"]["near_gain"] for row in found["rows"][1:]] == list(scores["near_gain"])
    assert found == printed("sweep", vehicle, tmp_path, "--of", "1.pitch", "--from=-5", "--to", "7.5", "--values", "6")[
        "sweeps"][0] | {"rows": found["rows"]}  # fmt: skip
    for of, values, said in [
        ("9.pitch", [0], "of: placement `Pyramid-roll` has no LiDAR 9"),
        ("pitch", [0], "of: `pitch` names no field"),
        ("0.z", [], "values: has 0 values"),
        ("0.z", [0.0, np.nan], r"values\[1\]: is NaN"),
        ("0.z", [1e300], "values: "),
    ]:
        with pytest.raises(ValueError, match=said):
            scene.sweep(rig, of, values)


def test_a_tolerance_is_that_of_the_program(rig: sightline.Placement, vehicle: Path, tmp_path: Path) -> None:
    scene = Scene.load(YARD, vehicle=vehicle, backend="cpu", frames=1)
    found = scene.tolerance(rig, most_mm=50, most_deg=3, most_tilt_deg=9, tilt_about=(0.5, -0.25), steps=2)
    options = "--most-mm 50 --most-deg 3 --most-tilt 9 --tilt-about 0.5,-0.25 --steps 2".split()
    assert found == printed("tolerance", vehicle, tmp_path, *options)["rows"][0]
    assert found["tilt"]["about"] == [0.5, -0.25] and len(found["tilt"]["directions"]) == 8
    assert len(found["fields"]) == 6 * len(rig.poses) or found["missed"]
    plain = Scene.load(YARD, backend="cpu", frames=1)
    with pytest.raises(ValueError, match="requires nothing"):
        plain.tolerance(rig)
    with pytest.raises(ValueError, match="steps: is 0; give a whole number, 1 to 1000"):
        scene.tolerance(rig, steps=0)
    with pytest.raises(ValueError, match="most_mm: is -1"):
        scene.tolerance(rig, most_mm=-1)
