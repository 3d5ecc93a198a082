"""The search for the metrics themselves: what it is given it never loses, mounts are kept, and a cut one goes on."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
from sightline.evidence import direct, files, layouts, worlds
from sightline.evidence._types import F64
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


@pytest.fixture(scope="module")
def train(tmp_path_factory: pytest.TempPathFactory) -> list[worlds.World]:
    made, folder = [], tmp_path_factory.mktemp("direct")
    for number in range(4):
        path = folder / f"tiny-{number}.json"
        path.write_text(json.dumps(variant(SMALL, number)), encoding="utf-8")
        made.append(worlds.world(path.stem, path, "train", 1))
    return made


def starts() -> dict[str, F64]:
    (good,) = [one.poses for one in layouts.mixed() if one.name == "low-diagonal"]
    sky = good.copy()
    sky[:, 4] = -np.pi / 2
    return {"sky": sky, "good": good}


def searched(train: list[worlds.World], folder: Path, exchanges: int = 6) -> dict[str, Any]:
    settings = trees.Settings(rounds=8, points=4_000)
    return direct.optimum(train, room(), starts(), exchanges, settings, folder / "truth", folder / "search.known.json")


def test_a_search_never_loses_what_it_begins_with(
    train: list[worlds.World], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(direct, "DRAWN", 4)
    found = searched(train, tmp_path)
    assert found["start"] == "good" and found["starts"]["sky"] < found["starts"]["good"] <= found["value"]
    assert (found["taken"] > 0) == (found["value"] > found["starts"]["good"])
    known = [*room().poses.tolist(), *starts()["good"].tolist()]
    assert all(pose in known for pose in np.array(found["poses"]).tolist())


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Metrics without trees, told by the poses; how often one looked."""
    judged: list[int] = []

    def metrics(taught: Any, judging: Any, placement: F64, folder: Path) -> F64:
        judged.append(len(judged))
        found: F64 = np.arange(1.0, 1 + len(direct.METRICS)) * placement[:, :3].sum()
        return found

    monkeypatch.setattr(direct, "_metrics", metrics)
    monkeypatch.setattr(direct, "_taught", lambda *given: None)
    return judged


def test_a_search_cut_anywhere_goes_on_to_the_same(
    train: list[worlds.World],
    tmp_path: Path,
    quick: list[int],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    expected = searched(train, tmp_path / "whole", 24)
    assert expected["taken"] > 1
    said, whole = capsys.readouterr().err, len(quick)
    assert said.count(" left") == whole
    assert "search, 12 of 12 random ones, " in said and re.search(r"search, 23 of 24 exchanges, \d+ s left", said)
    metrics = direct._metrics

    def cut(*given: Any) -> F64:
        # Among the random ones, among the starts, and twice among the exchanges.
        if len(quick) - whole in stops:
            stops.remove(len(quick) - whole)
            raise KeyboardInterrupt
        return metrics(*given)

    stops = [4, 13, 16, 30]
    monkeypatch.setattr(direct, "_metrics", cut)
    for _ in list(stops):
        with pytest.raises(KeyboardInterrupt):
            searched(train, tmp_path / "cut", 24)
    # Nothing that is kept is looked at again, neither by the same search nor by a longer one.
    assert searched(train, tmp_path / "cut", 24) == expected and len(quick) == 2 * whole
    assert searched(train, tmp_path / "cut", 24) == expected and len(quick) == 2 * whole
    longer = searched(train, tmp_path / "cut", 30)
    assert 2 * whole < len(quick) <= 2 * whole + 6 and longer["value"] >= expected["value"]


def test_what_another_search_looked_at_is_not_taken(train: list[worlds.World], tmp_path: Path, quick: list[int]) -> None:
    expected = searched(train, tmp_path)
    kept = files.read_json(tmp_path / "search.known.json")
    wrong = {key: [0.0] * len(direct.METRICS) for key in kept["known"]}
    files.write_json(tmp_path / "search.known.json", {"of": "other worlds", "known": wrong})
    assert searched(train, tmp_path) == expected
    # It is believed where it is of the same search.
    files.write_json(tmp_path / "search.known.json", {"of": kept["of"], "known": wrong})
    assert searched(train, tmp_path) != expected
