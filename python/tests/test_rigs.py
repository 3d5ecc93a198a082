"""Rigs from the list that a CARLA agent returns, and from files."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sightline
from sightline import Rig

#: An agent's list: one LiDAR that is tilted about all three axes, one that looks to one side, and no LiDARs.
SENSORS: list[dict[str, Any]] = [
    {"type": "sensor.camera.rgb", "id": "Center", "width": 300, "x": 0.7},
    {
        "type": "sensor.lidar.ray_cast",
        "id": "top",
        "x": 0.6,
        "y": 0.4,
        "z": "2.8",
        "roll": -90.0,
        "pitch": -30.0,
        "yaw": 45.0,
        "channels": "16",
        "lower_fov": "-15",
        "upper_fov": "15",
    },
    {"type": "sensor.lidar.ray_cast_semantic", "id": "side", "x": 0, "y": -1, "z": 2, "horizontal_fov": "120"},
    {"type": "sensor.speedometer"},
]


def lidar(**change: Any) -> dict[str, Any]:
    return {"type": "sensor.lidar.ray_cast", "id": "top", "x": 0, "y": 0, "z": 2} | change


def lacking(key: str) -> dict[str, Any]:
    return {name: value for name, value in lidar().items() if name != key}


def test_a_pose_of_carla_is_the_one_computed_by_hand() -> None:
    rig = Rig.from_carla(SENSORS, name="agent")
    # y to the right becomes y to the left: y, pitch and yaw change sign, roll keeps it.
    by_hand = [[0.6, -0.4, 2.8, -np.pi / 2, np.pi / 6, -np.pi / 4], [0, 1, 2, 0, 0, 0]]
    np.testing.assert_allclose(rig.poses, by_hand, rtol=0, atol=1e-15)
    # Its x axis in CARLA: 30° down and 45° to the right.
    roll, pitch, yaw = rig.poses[0, 3:]
    forward = [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)]
    np.testing.assert_allclose(forward, [np.sqrt(3 / 8), -np.sqrt(3 / 8), -0.5], atol=1e-15)
    assert (rig.name, rig.frames, rig.sensors, len(rig)) == ("agent", ["top", "side"], ["VLP-16", None], 2)


def test_what_is_no_lidar_and_what_is_not_kept_is_named() -> None:
    rig = Rig.from_carla(tuple(SENSORS))
    assert rig.left_out == ["Center", "sensor.speedometer"]
    [note] = rig.notes
    assert "sensors[2]: `horizontal_fov` 120 is not kept" in note


def test_models_and_origin_are_those_that_are_given() -> None:
    rig = Rig.from_carla(SENSORS, models={"side": "spin-32"}, base_link=[-1.5, 0, 0.5])
    assert rig.sensors == ["VLP-16", "spin-32"] and rig.placement().sensors == ["VLP-16", "spin-32"]
    np.testing.assert_allclose(rig.poses[1, :3], [-1.5, 1, 2.5])


def test_a_rig_is_a_placement_and_a_file_of_it(tmp_path: Path) -> None:
    rig = Rig.from_carla(SENSORS)
    placement = rig.placement("agent")
    assert placement.name == "agent" and np.array_equal(placement.poses, rig.poses)
    rig.save(tmp_path / "rig.json")
    [read] = sightline.read_placements(tmp_path / "rig.json")
    assert read.name == rig.name and read.sensors == ["VLP-16", ""]
    again = Rig.load(tmp_path / "rig.json", format="json")
    assert again.sensors == rig.sensors
    for poses in (read.poses, again.poses):
        np.testing.assert_allclose(poses, rig.poses, rtol=0, atol=1e-8)


def test_a_rig_is_pickled_with_all_that_it_says() -> None:
    rig = Rig.from_carla(SENSORS)
    again = pickle.loads(pickle.dumps(rig))
    parts = ("name", "frames", "sensors", "left_out", "notes")
    assert [getattr(again, part) for part in parts] == [getattr(rig, part) for part in parts]
    assert np.array_equal(again.poses, rig.poses)


def test_files_of_other_programs_are_rigs(tmp_path: Path) -> None:
    joint = '<joint name="j" type="fixed"><parent link="base_link"/><child link="{0}"/><origin xyz="1 0 2"/></joint>'
    links = "".join(f'<link name="{name}"/>' for name in ("base_link", "front_lidar", "rear"))
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{links}{joint.format("front_lidar")}</robot>')
    rig = Rig.load(tmp_path / "r.urdf", models={"front_lidar": "m"})
    assert rig.frames == ["front_lidar"] and rig.poses[0, :3].tolist() == [1, 0, 2]
    with pytest.raises(ValueError, match="rear_lidar"):
        Rig.load(tmp_path / "r.urdf", frames=["rear_lidar"])
    with pytest.raises(ValueError, match="format: `ply` is none; give one of autoware, urdf"):
        Rig.load(tmp_path / "r.urdf", format="ply")  # type: ignore[arg-type]
    with pytest.raises(OSError, match="nowhere.urdf"):
        Rig.load("nowhere.urdf")


@pytest.mark.parametrize(
    ("sensors", "sentence"),
    [
        ("sensors", "sensors: is 'sensors'; give a list of dicts"),
        ({"sensors": SENSORS}, r"sensors: is \{.*; give a list of dicts"),
        (iter(SENSORS), "sensors: is .*; give a list of dicts"),
        ([], "no frame is a LiDAR"),
        (SENSORS[:1], "no frame is a LiDAR"),
        ([lidar(), 3], r"sensors\[1\]: is 3; give a dict"),
        ([{1: 2}], r"sensors\[0\]: has the key 1; give texts as keys"),
        ([lidar(x=float("nan"))], r"sensors\[0\]\.x: is NaN; give a finite number"),
        ([lidar(x=object())], r"sensors\[0\]\.x: is <object object .*; give a number, a text"),
        ([lidar(x="\ud800")], r"sensors\[0\]\.x: "),
        ([lidar(x="a")], r"sensors\[0\]\.x: `a` stands where a finite number belongs"),
        ([lidar(z="inf")], r"sensors\[0\]\.z: `inf` stands where a finite number belongs"),
        ([lidar(yaw=True)], r"sensors\[0\]\.yaw: `true` stands where a finite number belongs"),
        ([lidar(horizontal_fov="all")], r"sensors\[0\]\.horizontal_fov: `all` stands where"),
        ([lidar(id=3)], r"sensors\[0\]\.id: `3` stands where a text belongs"),
        ([SENSORS[0], lidar(), lidar()], r"sensors\[2\]: the frame `top` is placed a second time"),
        ([lidar(id="a b")], "`a b` is not a name of a frame"),
        ([lidar(x=1e300)], "LiDAR 0: x = 1e300"),
        ([lidar(id=f"l{k}") for k in range(17)], "17 frames are LiDARs, at most 16"),
        *([[SENSORS[0], lacking(key)], rf"sensors\[1\]: `{key}` is missing"] for key in ("type", "id", "x", "y", "z")),
    ],
)
def test_what_is_wrong_in_a_list_is_said(sensors: Any, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Rig.from_carla(sensors)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"name": "a b"}, "`a b` is not a placement name"),
        ({"models": ["VLP-16"]}, "models: is .*; give a dict of texts"),
        ({"models": {"top": 3}}, "models: is 3; give a dict of texts"),
        ({"models": {"top": ""}}, 'models: top: "" is no name; give'),
        ({"models": {"roof": "VLP-16"}}, "no frame is called `roof`; there are .*`top`"),
        ({"base_link": [1, 2]}, r"base_link: has the shape \[2\]; give 3 numbers"),
        ({"base_link": [0, 0, float("inf")]}, "base_link: is .*; give x, y, z in metres, at most 100"),
    ],
)
def test_what_is_wrong_in_options_is_said(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Rig.from_carla([lidar()], **options)


def test_a_placement_keeps_the_bodies_that_carry_its_lidars(small: sightline.Scene) -> None:
    poses = [[0, 0, 2, 0, 0, 0], [1, 0, 2, 0, 0, 0]]
    placement = sightline.Placement(poses, rides_on=["", "trailer"])
    assert pickle.loads(pickle.dumps(placement)) == placement
    assert placement.rides_on == ["", "trailer"]
    assert placement.to_dict()["lidars"][1]["rides_on"] == "trailer"
    with pytest.raises(ValueError, match='LiDAR 1: there is no body to ride on `trailer`'):
        small.score(placement)
    with pytest.raises(ValueError, match="^rides_on: has the length 1; give a body"):
        sightline.Placement(poses, rides_on=["trailer"])


def test_sensors_and_suites_are_pickled(small: sightline.Scene) -> None:
    turning = {"channels": 3, "fov": [-20, 0], "azimuth": [-60, 60], "azimuth_steps": 32, "range": 50}
    for form in (turning, {"directions": [[1, 0.3, 0], [0, 2, 1]], "range": 50}):
        sensor = sightline.Sensor.from_dict(form)
        again = pickle.loads(pickle.dumps(sensor))
        assert np.array_equal(again.directions, sensor.directions) and again.range == sensor.range
    suite = sightline.Suite([small, small])
    again = pickle.loads(pickle.dumps(suite))
    poses = np.array([[0, 0, 1.5, 0, 0, 0]])
    assert again.names == suite.names and again.score(poses) == suite.score(poses)
