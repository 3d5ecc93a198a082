"""Questions about a rig and studies against the rows of the program, and wrong arguments."""

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


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.load(YARD, backend="cpu", frames=1)


@pytest.fixture(scope="module")
def file(rig: sightline.Placement, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("rig") / "rig.json"
    file.write_text(json.dumps({"placements": [rig.to_dict()]}))
    return file


def printed(*arguments: str) -> Any:
    """The JSON that the program prints."""
    done = subprocess.run(
        [sys.executable, "-m", "sightline", *arguments, "--backend", "cpu", "--format", "json"],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_near_field_is_the_row_of_the_study(scene: Scene, rig: sightline.Placement, file: Path) -> None:
    found = scene.near_field(rig)
    assert found == printed("study", "nearfield", YARD, str(file), "--frames", "1")["near_fields"][0]
    scores = scene.score(rig, near_field=True)
    assert found["near_field"] == scores["near_field"][0] and found["ring"] == scores["near_ring"][0]


def test_detections_are_those_of_the_study(scene: Scene, rig: sightline.Placement, file: Path) -> None:
    asked = {"targets": ["car", "tyre"], "distances": [10, 20, 40], "bearings": [0, 90]}
    found = scene.detections(rig, **asked)
    places = ["--target", "car", "--target", "tyre", "--distances", "10,20,40", "--bearings", "0,90"]
    want = printed("study", "targets", YARD, str(file), *places)
    assert (found["rows"], found["detections"]) == (want["rows"], want["detections"])
    level = scene.detections(rig, **asked, level=True)
    by_lidar = np.array([row["by_lidar"] for row in level["rows"]]).reshape(2, 2, 3, -1)
    assert np.array_equal(by_lidar, scene.beams_on(rig, **asked)) and by_lidar.max() > 0
    with pytest.raises(ValueError, match="^of_frames: is 2; frames that are looked at: 1"):
        scene.detections(rig, **asked, of_frames=2)


def test_losses_are_scores_without_each_lidar(scene: Scene, rig: sightline.Placement) -> None:
    found = scene.losses(rig)
    assert found["scores"]["near_gain"] == scene.score(rig)["near_gain"][0]
    for lidar, loss in enumerate(found["losses"]):
        left = np.delete(rig.poses, lidar, axis=0)
        card = scene.range_card(left)
        known = found["scores"]["range_card"]["blind"]
        assert card is not None and loss["lidar"] == lidar
        assert loss["scores"]["near_gain"] == scene.score(left)["near_gain"][0]
        assert loss["broken"] == loss["already_missed"] == []  # nothing is required
        assert loss["blind"] == [sector for sector in card["blind"] if sector not in known]
    assert len(found["losses"]) == len(rig)
    assert scene.losses(rig.poses[:1])["losses"] == []


def test_studies_are_those_of_the_program(rig: sightline.Placement, file: Path, tmp_path: Path) -> None:
    scene = Scene.load(YARD, backend="cpu", frames=2)
    found = sightline.study("loss", scene, rig)
    want = printed("study", "loss", YARD, str(file), "--frames", "2", "--out", str(tmp_path / "loss"))
    assert found["rows"] == want["rows"] and found["columns"] == want["columns"]
    boxes = {"gate": [5, -5, 0, 15, 5, 3]}
    found = sightline.study("regions", scene, rig, regions=boxes)
    want = printed("study", "regions", YARD, str(file), "--frames", "2", "--box", "gate:5,-5,0,15,5,3",
                   "--out", str(tmp_path / "regions"))  # fmt: skip
    assert found["rows"] == want["rows"] and any("gate" in column for column in found["columns"])


def test_what_a_study_does_not_take_is_refused(scene: Scene, rig: sightline.Placement) -> None:
    other = Scene.load("scenes/highway.json", backend="cpu", frames=2)
    foggy = Scene.load(YARD, backend="cpu", frames=1, conditions=["fog:mor=50"])
    for match, call in [
        (r"^kind: `nearfield` is a method of Scene: scene\.near_field", lambda: sightline.study("nearfield", scene)),
        ("^kind: .*`lost`.*loss", lambda: sightline.study("lost", scene)),
        ("^poses: `lidars` takes none", lambda: sightline.study("lidars", scene, rig)),
        ("^conditions: `loss` takes none here", lambda: sightline.study("loss", scene, rig, conditions=["fog:mor=50"])),
        ("^scenes: `weather` compares conditions", lambda: sightline.study("weather", foggy, rig)),
        ("^scenes: .*different frames", lambda: sightline.study("transfer", [scene, other])),
        ("^random: ", lambda: sightline.study("random", scene, rig, random=1)),
        ("^voxel: is 0", lambda: sightline.study("published", scene, voxel=0.0)),
        ("budget", lambda: sightline.study("voxels", scene, rig, budget=5.0)),
        ("each upper corner", lambda: sightline.study("regions", scene, rig, regions={"a": [0, 0, 0, 1, -1, 1]})),
    ]:
        with pytest.raises(ValueError, match=match):
            call()
