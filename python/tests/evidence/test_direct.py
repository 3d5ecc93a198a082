"""The search for the metrics themselves: what it is given it never loses, and mounts are kept."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
from sightline.evidence import direct, layouts, worlds
from sightline.evidence.learners import trees

from .conftest import SMALL
from .tiny import variant

MOUNT = {"min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8]}


def room(apart: float = 0.2) -> direct.Room:
    rng = np.random.default_rng(3)
    high = np.c_[rng.uniform(MOUNT["min"], MOUNT["max"], (30, 3)), np.zeros((30, 3))]
    low = np.c_[rng.uniform([2.3, -1, 0.6], [2.4, 1, 1.0], (10, 3)), np.zeros((10, 3))]
    inside = np.arange(40) < 30
    return direct.Room(np.r_[high, low], [inside, inside, ~inside, ~inside], apart)


def test_exchanges_keep_distance_and_kind() -> None:
    given = room(apart=0.4)
    rng = np.random.default_rng(1)
    for _ in range(50):
        placement = given.random(rng)
        assert placement.shape == (4, 6)
        assert np.all(placement[:2, 2] >= 2.2) and np.all(placement[2:, 2] <= 1.0)
        changed = given.exchanged(placement, 1, rng.permutation(40))
        assert np.array_equal(changed[[0, 2, 3]], placement[[0, 2, 3]]) and not np.array_equal(changed, placement)
        away = np.linalg.norm(changed[:, None, :3] - changed[None, :, :3], axis=2)[1]
        assert np.delete(away, 1).min() >= 0.4
    # Nothing that fits: the placement stays.
    alone = direct.Room(given.poses, given.allowed, 99.0)
    assert np.array_equal(alone.exchanged(placement, 0, np.arange(40)), placement)


def test_a_search_never_loses_what_it_begins_with(tmp_path: Path) -> None:
    chosen = []
    for number in range(4):
        path = tmp_path / f"tiny-{number}.json"
        path.write_text(json.dumps(variant(SMALL, number)), encoding="utf-8")
        chosen.append(worlds.world(path.stem, path, "train", 1))
    (good,) = [one.poses for one in layouts.mixed() if one.name == "low-diagonal"]
    sky = good.copy()
    sky[:, 4] = -np.pi / 2
    settings = trees.Settings(rounds=8, points=4_000)
    found = direct.optimum(chosen, room(), {"sky": sky, "good": good}, 6, settings, tmp_path / "truth")
    assert found["start"] == "good" and found["starts"]["sky"] < found["starts"]["good"] <= found["value"]
    assert (found["taken"] > 0) == (found["value"] > found["starts"]["good"])
    placement = np.array(found["poses"])
    known = [*room().poses.tolist(), *good.tolist()]
    assert all(pose in known for pose in placement.tolist())
    again = direct.optimum(chosen, room(), {"sky": sky, "good": good}, 6, settings, tmp_path / "truth")
    assert again == found
