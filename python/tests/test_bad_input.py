"""Errors say what was expected, where, and what to do."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest

import sightline
from sightline import Psog, Scene

POSES = "poses: "


@pytest.mark.parametrize(
    ("poses", "sentence"),
    [
        (np.zeros((2, 4, 5)), r"have the shape \[2, 4, 5\]; give \[N, L, 6\]"),
        (np.zeros(6), r"have the shape \[6\]"),
        (np.zeros((1, 0, 6)), r"0 LiDARs a placement; 1 to 16 are possible"),
        (np.zeros((1, 17, 6)), r"17 LiDARs a placement; 1 to 16 are possible"),
        (np.full((1, 1, 6), np.nan), r"placement `0`, LiDAR 0: x = NaN"),
        (np.full((3, 1, 6), np.inf), r"placement `0`, LiDAR 0: x = inf"),
        (np.zeros((1, 1, 6), dtype=complex), r"has the type complex128"),
        (np.zeros((1, 1, 6), dtype=bool), r"has the type bool"),
        (np.array([["a"] * 6]), r"has the type <U1"),
        ([[1, 2], [3]], r"is no array of numbers"),
        (object(), r"has the type object"),
        (None, r"has the type object"),
    ],
)
def test_arrays(scene, poses, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        scene.score(poses)


def test_units_that_are_hardly_meant_are_warned_of(scene) -> None:
    poses = np.zeros((9, 1, 6))
    poses[:, 0, 2] = 2.5
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.score(poses)
    poses[:, 0, 5] = 90
    with pytest.warns(UserWarning, match=r"placement `\d`, LiDAR 0: yaw = 90 .* in radians") as said:
        scene.score(poses)
    assert len(said) == 3 and said[0].filename == __file__
    poses[:, 0] = [0, 0, 2500, 0, 0, 0]
    with pytest.warns(UserWarning, match="2500 mm are 2.5"):
        scene.covered(poses[:1])


def test_an_empty_batch_has_no_scores(scene) -> None:
    some, none = scene.score(np.zeros((2, 4, 6)) + [0, 0, 2, 0, 0, 0]), scene.score(np.zeros((0, 4, 6)))
    assert len(none.rows) == 0 and none.names == [] and list(none) == list(some)
    assert {name: (values.dtype, values.shape[1:]) for name, values in none.items()} == {
        name: (values.dtype, values.shape[1:]) for name, values in some.items()
    }
    assert sightline.Scores.concatenate([none, some]) == some


def test_rays(small) -> None:
    with pytest.raises(ValueError, match=r"rays: has the shape \[4, 5\]; give \[\.\.\., 6\]"):
        small.cast_rays(np.zeros((4, 5)))
    with pytest.raises(ValueError, match=r"rays\[2\]: is not finite"):
        small.cast_rays(np.array([[0, 0, 0, 1, 0, 0]] * 2 + [[0, 0, 0, np.nan, 0, 0]]))
    with pytest.raises(ValueError, match="frame: is 2; give 0 to 1"):
        small.cast_rays(np.zeros((1, 6)), frame=2)


def test_files_that_cannot_be_read() -> None:
    for read in (Scene.load, Psog.load, sightline.read_placements, sightline.Vehicle.load, sightline.Sensor.load):
        with pytest.raises(OSError, match="nowhere.json"):
            read("nowhere.json")
    with pytest.raises(ValueError, match=re.escape("scenes/placements.json: ")):
        Scene.load("scenes/placements.json")


def test_options(small, scene) -> None:
    with pytest.raises(ValueError, match="backend: `tpu` is none; give auto, cpu or gpu"):
        Scene.load("scenes/highway.json", backend="tpu")
    with pytest.raises(ValueError, match="frames: is 0; give a whole number, 1 to"):
        Scene.load("scenes/highway.json", frames=0)
    with pytest.raises(ValueError, match="hail"):
        Scene.load("scenes/highway.json", conditions=["hail"])
    with pytest.raises(ValueError, match="`gain` is no score; there are near_gain"):
        sightline.optimize(scene, objective="gain")
    with pytest.raises(ValueError, match="objective: is 3; give the name of a score or a weighted sum"):
        sightline.optimize(scene, objective=3)
    for option in [{"method": "swaps"}, {"frames": 2}, {"budget": 9.0}, {"tolerance": None}, {"bound": 2}]:
        (name,) = option
        with pytest.raises(ValueError, match=f"{name}: is not taken where objective is a function"):
            sightline.optimize(scene, objective=lambda scores: scores["near_gain"], **option)
    with pytest.raises(ValueError, match=r"objective: gives the shape \(\) for \d+ placements; give a number for each"):
        sightline.optimize(scene, objective=lambda scores: 1.0)
    with pytest.raises(ValueError, match="method: `magic` is none; give both, cma, swaps"):
        sightline.optimize(scene, method="magic")
    with pytest.raises(ValueError, match="frames: is '8'; give a whole number"):
        sightline.optimize(scene, frames="8")
    with pytest.raises(ValueError, match="budget: the LiDARs of the scene have no prices"):
        sightline.optimize(small, budget=10.0)
    with pytest.raises(ValueError, match="scenes: give a Scene or a list of them"):
        sightline.optimize("scenes/highway.json")
    with pytest.raises(ValueError, match="sensors: has the length 1; give a name for each LiDAR, 2 in all"):
        scene.score(np.zeros((1, 2, 6)), sensors=["a"])
    with pytest.raises(ValueError, match=r"frames\[1\]: is 9; give a whole number, 0 to 1"):
        small.scan([[0, 0, 2, 0, 0, 0]], frames=[0, 9])


def test_scenes_without_geometry(small, tmp_path) -> None:
    small.psog.save(tmp_path / "small.npz")
    _, text, *_ = small.__reduce__()[1]
    flat = {key: text[key] for key in ("sightline", "roi", "lidar", "mount")}
    flat |= {"psog": {"file": "small.npz"}, "coverage": "through"}
    scene = Scene.from_dict(flat, folder=tmp_path, backend="cpu")
    assert scene.score([[0, 0, 1.5, 0, 0, 0]])["information_gain"][0] > 0
    for use in (lambda: scene.cast([[0, 0, 1.5, 0, 0, 0]]), lambda: scene.cast_rays(np.ones((1, 6)))):
        with pytest.raises(ValueError, match="has no geometry to cast into"):
            use()
    with pytest.raises(ValueError, match="has no geometry"):
        scene.scan([[0, 0, 1.5, 0, 0, 0]])


def test_psogs() -> None:
    good = dict(
        index=np.array([3, 5], np.uint64), counts=np.array([[1, 0], [0, 2]]), frames=2,
        classes=["a", "b"], roi_min=[0, 0, 0], voxel=[1, 1, 1], shape=[2, 2, 2],
    )  # fmt: skip
    assert Psog(**good).counts.tolist() == [[1, 0], [0, 2]]
    for change, sentence in (
        ({"index": np.array([5, 3])}, "3"),
        ({"index": np.array([3, 8])}, "8"),
        ({"counts": np.array([[1, 0]])}, "counts: have 1 rows for 2 voxels"),
        ({"counts": np.array([[1, 0], [0, 3]])}, "3"),
        ({"counts": np.array([1, 2])}, r"counts: has the shape \[2\]; give \[N, 2\]"),
        ({"voxel": [1, 0, 1]}, "0"),
    ):
        with pytest.raises(ValueError, match=sentence):
            Psog(**(good | change))
    frame = dict(classes=["a"], roi=[[0, 0, 0], [2, 2, 2]], voxel=[1, 1, 1])
    points, labels, pose = np.ones((3, 3)), np.zeros(3, int), np.eye(4)
    with pytest.raises(ValueError, match=r"labels\[0\]\[2\]: is 1; give a position in `classes`, below 1"):
        Psog.from_scans([points], [[0, 0, 1]], [pose], **frame)
    with pytest.raises(ValueError, match=r"labels\[0\]: has 2 labels for 3 points"):
        Psog.from_scans([points], [[0, 0]], [pose], **frame)
    with pytest.raises(ValueError, match=r"poses\[0\]: is no rigid transform"):
        Psog.from_scans([points], [labels], [2 * pose], **frame)
    with pytest.raises(ValueError, match=r"points\[0\]\[1\]: is not finite"):
        Psog.from_scans([np.array([[1, 1, 1], [np.nan, 1, 1], [1, 1, 1]])], [labels], [pose], **frame)


def test_a_number_that_json_lacks_is_told_with_its_place() -> None:
    scene = {"sightline": 1, "roi": {"min": [0, 0, float("nan")]}}
    with pytest.raises(ValueError, match=r"scene\.roi\.min\[2\]: is NaN; give a finite number"):
        Scene.from_dict(scene)


def test_large_labels_do_not_wrap() -> None:
    """u16 would take 65 536 + 0 for class 0."""
    frame = dict(classes=["a"], roi=[[0, 0, 0], [2, 2, 2]], voxel=[1, 1, 1])
    with pytest.raises(ValueError, match="is 65536"):
        Psog.from_scans([np.ones((1, 3))], [[65536]], [np.eye(4)], **frame)
