"""`Scores` as a mapping of columns, and as tables of other packages."""

from __future__ import annotations

import pickle
from collections.abc import Mapping

import numpy as np
import pytest

import sightline
from sightline import Scene, Scores


@pytest.fixture(scope="module")
def scores(scene, placements) -> Scores:
    return scene.score([*placements, sightline.Placement([[0, 0, -50, 0, 0, 0]], name="buried")])


def test_a_mapping_agrees_with_itself(scores) -> None:
    assert isinstance(scores, Mapping)
    names = list(scores)
    assert len(scores) == len(names) == len(scores.keys()) == len(scores.values()) == len(scores.items())
    assert all(name in scores and scores[name] is scores.get(name) for name in names) and "gain" not in scores
    copied = dict(scores)
    assert list(copied) == names and (lambda **columns: columns)(**copied).keys() == copied.keys()
    assert all(len(values) == 12 for values in scores.values())
    for wrong, error in (("gain", KeyError), (0, TypeError), (slice(2), TypeError)):
        with pytest.raises(error, match="near_gain|scores.rows"):
            scores[wrong]
    assert pickle.loads(pickle.dumps(scores)) == scores


def test_rows_are_placements(scores) -> None:
    rows = scores.rows
    assert len(rows) == 12 and [row["name"] for row in rows] == scores.names
    assert rows[-1]["name"] == "buried" and rows[3]["near_gain"] == scores["near_gain"][3]
    mask = scores["near_gain"] > np.nanmedian(scores["near_gain"])
    for part, kept in ((rows[mask], np.flatnonzero(mask)), (rows[2:5], [2, 3, 4]), (rows[[4, 0]], [4, 0])):
        assert part.names == [scores.names[k] for k in kept]
        assert all(part[name].tobytes() == scores[name][kept].tobytes() for name in scores)
        assert part.guards == [scores.guards[k] for k in kept] and part.least == scores.least
    assert Scores.concatenate([rows[:4], rows[4:]]) == scores
    with pytest.raises(IndexError):
        rows[12]


def test_sorting_keeps_rows_together_and_puts_nan_last(scores) -> None:
    ordered = scores.sort("near_gain")
    assert ordered.names[-1] == "buried" and scores.sort("near_gain", descending=False).names[-1] == "buried"
    by_hand = sorted(zip(scores["near_gain"][:-1], scores.names), reverse=True)
    assert ordered.names[:-1] == [name for _, name in by_hand]
    assert (np.diff(ordered["near_gain"][:-1]) <= 0).all()
    with pytest.raises(ValueError, match="`covered_by_class` has 2 axes"):
        scores.sort("covered_by_class")
    with pytest.raises(KeyError, match="`gain` is no score"):
        scores.sort("gain")


def test_every_column_is_described(scores, scene, placements) -> None:
    near = scene.score(placements[0], near_field=True)
    assert {"near_field", "near_ring"} <= set(near)
    for name in (*scores, *near):
        assert scores.describe(name).startswith("[") if name in scores else near.describe(name).startswith("[")
    assert scores.describe().count("\n") == len(scores) - 1 and "[nats; better: higher]" in scores.describe("m_sog")
    with pytest.raises(KeyError):
        scores.describe("gain")


def test_tables_of_other_packages(scores) -> None:
    gain = scores["near_gain"].tolist()
    polars, arrow = pytest.importorskip("polars"), pytest.importorskip("pyarrow")
    frame, table = scores.to_polars(), scores.to_arrow()
    assert isinstance(frame, polars.DataFrame) and isinstance(table, arrow.Table)
    assert frame["near_gain"].to_list()[:-1] == table["near_gain"].to_pylist()[:-1] == gain[:-1]
    assert frame["guards"].to_list() == table["guards"].to_pylist() == scores.guards
    assert frame.columns == [*(name for name in table.column_names)]
    empty = scores.rows[:0]
    assert empty.to_polars().schema == frame.schema and empty.to_arrow().schema == table.schema


def test_a_notebook_shows_a_table(scores) -> None:
    shown = Scores(["<b>", *scores.names[1:]], dict(scores), scores.guards, scores.classes)._repr_html_()
    assert shown.count("<tr>") == 13 and "&lt;b&gt;" in shown and "<b>" not in shown
    many = Scores.concatenate([scores] * 3)._repr_html_()
    assert many.count("<tr>") == 21 and "36 placements, the first 20 shown" in many


def test_feasible_placements_and_requirements() -> None:
    scene = Scene.load("scenes/highway.json", vehicle="scenes/vehicles/car.json", frames=1, backend="cpu")
    space = scene.space()
    poses = space.random(3, 1)
    broken = poses[:1].copy()
    broken[0, 1, :3] = broken[0, 0, :3]
    scores = scene.score(np.concatenate([poses, broken]), sensors=space.sensors)
    assert scores["feasible"].dtype == bool and (scores.feasible == scores["feasible"]).all()
    asked = scores.requirements
    assert asked.keys() == scores.least.keys() and asked
    met = np.ones(4, bool)
    for name, row in asked.items():
        assert (row["found"] == scores[f"seen.{name}"]).all() and 0 < row["required"] <= 1
        assert (row["met"] == (row["found"] >= row["required"])).all()
        met &= row["met"]
        assert row["holds_in"].shape == row["intact"].shape == (4,)
        assert len(row["missing"]) == len(row["worst_without"]) == len(row["worst_frame"]) == 4
        assert all(of is None or (of["places"] > 1 and 0.0 <= of["found"] <= 1.0) for of in row["between"])
        assert (row["between"][0] is None) == (row["places"][0] is None)
    some = scores.rows[[2, 0]].requirements
    assert all(some[name]["missing"] == [row["missing"][2], row["missing"][0]] for name, row in asked.items())
    assert Scores.concatenate([scores] * 2).requirements.keys() == asked.keys()
    undoubted = [all(guard.startswith("blind_sector") for guard in guards) for guards in scores.guards]
    kept = (space.violations(np.concatenate([poses, broken])) == 0).all(axis=1)
    assert kept.tolist() == [True] * 3 + [False]
    assert (scores.feasible == (met & undoubted & kept)).all()


def test_one_lidar_too_few_or_beside_the_mount_is_not_feasible(small) -> None:
    inside, outside = [[0, 0, 1.75, 0, 0, 0]], [[0, 0.6, 1.75, 0, 0, 0]]
    assert small.score([inside, outside]).feasible.tolist() == [True, False]
    # Far enough apart, and one more than the mount holds.
    two = small.score([[[-0.4, 0, 1.75, 0, 0, 0], [0.4, 0, 1.75, 0, 0, 0]]])
    assert all(guard.startswith("blind_sector") for guard in two.guards[0]) and two.feasible.tolist() == [False]
