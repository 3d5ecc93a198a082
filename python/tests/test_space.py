"""The space of placements by the rules of mounts, against arithmetic and against the rules in the files."""

from __future__ import annotations

import json
import pickle
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from sightline import Placement, Scene

CAR = "scenes/vehicles/car.json"


def test_variables_run_from_bound_to_bound(scene) -> None:
    mount = json.loads(Path("scenes/industrial-yard.json").read_text())["mount"]
    angles = [mount.get(name, [0, 0]) for name in ("roll", "pitch", "yaw")]
    lower = np.array([*mount["min"], *(low for low, _ in angles)])
    upper = np.array([*mount["max"], *(high for _, high in angles)])
    space = scene.space()
    assert (space.lower == lower).all() and (space.upper == upper).all() and space.lower.shape == (4, 6)
    assert space.sensors is None and space.dim == 4 * np.count_nonzero(upper > lower)
    assert (space.poses(np.zeros(space.dim)) == lower).all() and (space.poses(np.ones(space.dim)) == upper).all()
    z = np.random.default_rng(1).random((50, space.dim))
    poses = space.poses(z)
    free = upper > lower
    np.testing.assert_allclose(poses[..., free].reshape(50, -1), lower[free].repeat(4).reshape(-1, 4).T.ravel()
                               + z * np.tile((upper - lower)[free], 4), atol=1e-12)  # fmt: skip
    np.testing.assert_allclose(space.vector(poses), z, atol=1e-9)
    assert [placement.poses.tolist() for placement in space.placements(z)] == poses.tolist()


def test_broken_rules_are_measured(small) -> None:
    _, described, *_ = small.__reduce__()[1]
    mount = described["mount"] | {
        "lidars": 2, "min_distance": 0.3, "keep_out": [{"min": [-0.1, -0.5, 1.5], "max": [0.1, 0.5, 2.0]}],
    }  # fmt: skip
    space = Scene.from_dict(described | {"mount": mount}).space()
    assert space.rules == ["mount", "min_distance", "keep_out", "equal_height", "symmetric", "sensors"]

    def broken(*places):
        return dict(zip(space.rules, space.violations([[*place, 0, 0, 0] for place in places])[0]))

    kept = dict.fromkeys(space.rules, 0.0)
    assert broken((-0.4, 0, 1.75), (0.4, 0, 1.75)) == kept
    for places, rule, by in (
        (((-0.4, 0, 1.75), (0.7, 0, 1.75)), "mount", 0.2),
        (((-0.4, 0, 1.75), (-0.4, 0.2, 1.75)), "min_distance", 0.1),
        (((-0.4, 0, 1.75), (0.06, 0, 1.75)), "keep_out", 0.04),
    ):
        assert broken(*places) == kept | {rule: pytest.approx(by)}


def test_random_placements_keep_the_rules_of_a_vehicle() -> None:
    scene = Scene.load("scenes/highway.json", vehicle=CAR, frames=1, backend="cpu")
    least = json.loads(Path(CAR).read_text())["min_distance"]
    space = scene.space()
    poses = space.random(300, np.random.default_rng(4))
    assert (space.violations(poses) == 0).all() and poses.shape == (300, len(space.sensors), 6)
    places = poses[:, :, :3]
    pairs = combinations(range(len(space.sensors)), 2)
    assert min(np.linalg.norm(places[:, a] - places[:, b], axis=1).min() for a, b in pairs) >= least
    drawn = space.random(300, np.random.default_rng(4), feasible=False)
    assert drawn.shape == poses.shape and (space.vector(drawn) >= 0).all()
    assert (space.random(5, np.random.default_rng(4)) == poses[:5]).all()
    again = np.random.default_rng(4)
    assert (space.random(5, again) != space.random(5, again)).any()


def test_equipment_is_chosen_by_names() -> None:
    scene = Scene.load("scenes/highway.json", vehicle=CAR, frames=1, backend="cpu")
    full = scene.space()
    pairs = list(zip(full.mounts, full.sensors))[:2]
    space = scene.space(pairs)
    assert list(zip(space.mounts, space.sensors)) == pairs and space.lower.shape == (2, 6)
    there = pickle.loads(pickle.dumps(space))
    assert there.mounts == space.mounts and (there.upper == space.upper).all()
    with pytest.raises(ValueError, match=r"equipment\[0\]: `cellar` is no mount; there are "):
        scene.space([("cellar", pairs[0][1])])
    with pytest.raises(ValueError, match=rf"equipment\[0\]: `{pairs[0][0]}` holds no `radar`"):
        scene.space([(pairs[0][0], "radar")])
    for wrong in ([], [("roof",)], "roof", [1]):
        with pytest.raises(ValueError, match="equipment"):
            scene.space(wrong)


def test_ties_have_fewer_variables(small) -> None:
    _, described, *_ = small.__reduce__()[1]
    mount = described["mount"] | {"lidars": 4, "symmetric": True, "equal_height": True}
    space = Scene.from_dict(described | {"mount": mount}).space()
    assert space.dim == 2 * 2 + 1
    poses = space.poses(np.random.default_rng(2).random((20, space.dim)))
    assert (poses[:, ::2, 1] == -poses[:, 1::2, 1]).all() and (np.ptp(poses[..., 2], axis=1) == 0).all()
    untied = poses[:1].copy()
    untied[0, 0, 2] += 0.01
    assert space.violations(untied)[0, 3] == pytest.approx(0.01)
    with pytest.raises(ValueError, match=r"poses\[0\]: heights or mirrored pairs are not as the mount ties them"):
        space.vector(untied)


def test_wrong_variables_and_poses(scene) -> None:
    space = scene.space()
    for z, sentence in (
        (np.zeros(3), r"z: has the shape \[3\]; give \[N, 12\]|z: has the shape"),
        (np.full(space.dim, 1.5), r"z\[0, 0\]: is 1.5; give 0 to 1"),
        (np.full(space.dim, np.nan), r"z\[0, 0\]: is NaN"),
    ):
        with pytest.raises(ValueError, match=sentence):
            space.poses(z)
    with pytest.raises(ValueError, match="poses: have 2 LiDARs; give 4"):
        space.violations(np.zeros((1, 2, 6)))
    assert space.violations(Placement(space.random(1)[0])).shape == (1, 6)
    for rng in (-1, "1", object()):
        with pytest.raises(ValueError, match="rng"):
            space.random(1, rng)
