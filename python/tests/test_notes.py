"""Sentences on files reach Python as warnings, and models are never taken by guess."""

from __future__ import annotations

import inspect
import json
import warnings
from pathlib import Path
from typing import Any

import pytest

import sightline
from sightline import DoubtWarning, Rig, Scene, Sensor, Vehicle

#: A table of two channels; a key that no reader knows is a fact.
TABLE: dict[str, Any] = {"elevation_deg": [-10, 5], "azimuth_offset_deg": [0, 0], "azimuth_steps": 8, "range": 80}
LIDAR: dict[str, Any] = {"channels": 16, "fov": [-20, 10], "azimuth_steps": 100, "range": 90}
CAR: dict[str, Any] = {"sightline": 1, "mounts": [{"name": "roof", "min": [-1, -1, 1.6], "max": [1, 1, 2.2], "count": [1, 2]}]}
POSE = [[0.0, 0.0, 2.0, 0.0, 0.0, 0.0]]


def file(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content))
    return path


def test_unknown_keys_of_a_sensor_are_warned_of(tmp_path: Path) -> None:
    sensor = file(tmp_path / "a.json", TABLE | {"tilt_deg": 3})
    with pytest.warns(UserWarning, match="`tilt_deg`: not known here, and not read") as said:
        Sensor.load(sensor)
    assert [(one.category, one.filename) for one in said] == [(UserWarning, __file__)]
    with pytest.warns(UserWarning, match="tilt_deg"):
        Sensor.from_dict({"file": "a.json"}, folder=tmp_path)


def test_likely_mistakes_of_a_sensor_are_doubts(tmp_path: Path) -> None:
    radians = file(tmp_path / "a.json", TABLE | {"elevation_deg": [-0.2, 0.1]})
    with pytest.warns(DoubtWarning, match="radians"):
        Sensor.load(radians)
    with pytest.warns(DoubtWarning, match="a range of 0.1 m"):
        Sensor.from_dict(LIDAR | {"range": 0.1})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Sensor.from_dict(LIDAR)
        assert Sensor.load(file(tmp_path / "b.json", TABLE)).range == 80


def test_a_range_that_nothing_states_is_no_guess(tmp_path: Path) -> None:
    bare = file(tmp_path / "a.json", {key: value for key, value in TABLE.items() if key != "range"})
    with pytest.raises(ValueError, match="`range` is missing"):
        Sensor.load(bare)
    assert Sensor.load(bare, range=30).range == 30


def test_notes_of_a_vehicle_are_warned_of(tmp_path: Path) -> None:
    file(tmp_path / "a.json", TABLE | {"tilt_deg": 3})
    model = {"name": "a", "price": 1, "lidar": {"file": "a.json"}}
    vehicle = file(tmp_path / "car.json", CAR | {"sensors": [model]})
    with pytest.warns(UserWarning, match="tilt_deg"):
        Vehicle.load(vehicle)
    narrow = model | {"lidar": LIDAR | {"fov": [-0.4, 0.2]}}
    with pytest.warns(DoubtWarning, match="radians"):
        Vehicle.load(file(tmp_path / "car.json", CAR | {"sensors": [narrow]}))


def test_notes_of_a_rig_are_warned_of() -> None:
    lidar = {"type": "sensor.lidar.ray_cast", "id": "top", "x": 0, "y": 0, "z": 2}
    with pytest.warns(UserWarning, match="`lense`"):
        Rig.from_carla([lidar | {"lense": 1}])
    with pytest.warns(DoubtWarning, match="far from any vehicle"):
        Rig.from_carla([lidar | {"z": 2000}])


@pytest.mark.filterwarnings("ignore")
def test_lidars_without_a_model_are_refused_where_a_vehicle_has_several(tmp_path: Path) -> None:
    """The first model for all made a rig better by half after a round trip through a file without models."""
    scene = Scene.load("scenes/urban-crossing.json", vehicle="scenes/vehicles/car.json", frames=1, backend="cpu")
    first, second, *_ = scene.sensors
    sentence = (
        rf"placement `.*`, LiDAR 0 names no sensor, and the vehicle has \d+ models: .*; add \"sensor\": \"{first}\" "
        rf"to the LiDAR, or give sensors="
    )
    (tmp_path / "p.json").write_text(json.dumps({"placements": [{"name": "a", "lidars": [{"x": 0, "y": 0, "z": 2}]}]}))
    [read] = sightline.read_placements(tmp_path / "p.json")
    for poses in (POSE, read, [read], sightline.Placement(POSE)):
        for use in (scene.score, scene.cast, sightline.Suite([scene]).score):
            with pytest.raises(ValueError, match=sentence):
                use(poses)
    assert len(scene.score(POSE, sensors=[second]).rows) == 1


def test_help_says_what_is_raised() -> None:
    # Calls that raise nothing of their own.
    silent = {"Placement.to_dict", "Psog.entropy", "Psog.info", "Scan.labels", "Scores.to_dict", "Search.result", "published"}
    for name in sightline.__all__:
        thing = getattr(sightline, name)
        if not callable(thing) or (inspect.isclass(thing) and issubclass(thing, Warning)):
            continue
        named = [(name, thing)]
        if inspect.isclass(thing):
            named += [(f"{name}.{key}", value) for key, value in vars(thing).items() if not key.startswith("_")]
        for full, of in named:
            of = getattr(of, "__func__", of)
            if full.startswith("Status."):
                continue
            told, signature = inspect.getdoc(of) or "", getattr(of, "__text_signature__", None)
            assert told, full
            # Classes without a signature are made by calls.
            is_called = callable(of) and (signature is not None or not inspect.isclass(of))
            assert not is_called or "Raises" in told or full in silent, (full, signature)
            assert "Ellipsis" not in str(signature) and "..." not in str(signature), (full, signature)
    told = inspect.getdoc(sightline.Scene.cast_rays) or ""
    assert all(f"`{column}`" in told for column in ("t_hit", "primitive_ids", "class_ids", "normals", "uvs")), told
