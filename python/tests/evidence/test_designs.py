"""Variants of placements: kept in a plan as they are, scanned as they say, compared pair by pair."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
from sightline.evidence import __main__, effects, layouts, trial, worlds
from sightline.evidence.designs import DESIGNS, KINDS
from sightline.evidence.gathered import Gathered
from sightline.evidence.layouts import Layout
from sightline.evidence.plan import Plan
from sightline.evidence.worlds import LIDAR


def test_layouts_come_out_of_a_plan_as_they_went_in() -> None:
    for layout in [*layouts.sensors(LIDAR), *layouts.channels(LIDAR), *layouts.conditions(), *layouts.gamed()]:
        again = Layout.from_dict(layout.to_dict())
        np.testing.assert_array_equal(again.poses, layout.poses)
        kept = ("name", "pool", "lidar", "trained_in", "tested_in")
        assert [getattr(again, key) for key in kept] == [getattr(layout, key) for key in kept]


def test_designs_are_what_the_issue_asks_for() -> None:
    assert tuple(DESIGNS) == __main__.NAMES
    standard = DESIGNS["standard"]
    assert len(standard.train) >= 20 and len(standard.test) >= 12 and standard.own
    assert {kind for kind, _ in standard.test} == {kind for kind, _ in standard.train} == set(KINDS)
    for design in DESIGNS.values():
        assert not set(design.train) & set(design.test), design.name


def test_more_channels_have_more_points_and_fog_fewer(small_file: Path) -> None:
    world = worlds.world("small", small_file, "test", 1)
    by_name = {layout.name: layout for layout in layouts.channels(LIDAR) + layouts.conditions()}
    count = {
        name: len(trial.frames_of(world, by_name[name], 1, by_name[name].tested_in)[0].xyz)
        for name in ("Center@16-channels", "Center@32-channels", "Center@clear", "Center@snow, trained in it")
    }
    assert count["Center@32-channels"] > 1.5 * count["Center@16-channels"]
    assert count["Center@clear"] == count["Center@16-channels"] != count["Center@snow, trained in it"]


def test_variants_are_paired_by_placement() -> None:
    names = ["a@first", "b@first", "c@first", "a@more", "b@more", "c@more"]
    metric = np.array([[1.0, 2], [2, 3], [3, 4], [2, 3.1], [4, 5], [3, 4]])
    plan: Any = SimpleNamespace()
    given = Gathered(
        plan,
        [Layout(name, "variant", np.zeros((4, 6))) for name in names],
        ["street-1", "yard-1"],
        [1],
        {"birds_eye_miou": metric[None]},
        {name: metric for name in effects.BESIDE},
        {},
        [],
    )
    found = effects.of(given)["variants"]
    assert found["first"]["metrics"]["birds_eye_miou"]["less_first"]["value"] == 0
    more = found["more"]["metrics"]["birds_eye_miou"]
    assert more["less_first"]["value"] == pytest.approx((1 + 2 + 0 + 1.1 + 2 + 0) / 6)
    assert more["order_as_first"] == pytest.approx(0.5)
    assert found["more"]["placements"] == 3


def test_units_come_in_an_order_that_leaves_some_of_all() -> None:
    sorts = [("best-gain-1", "box"), ("Line", "box"), ("sky", "gamed"), ("random-low-wide-0", "box"), ("random-low-wide-1", "box")]
    placed = [Layout(name, pool, np.zeros((4, 6))) for name, pool in reversed(sorts)]
    found = Plan([], placed, [1, 2], DESIGNS["quick"].learner, {}).units()
    assert [layout.name for layout, seed in found if seed == 1] == ["Line", "best-gain-1", "random-low-wide-0", "sky", "random-low-wide-1"]
    assert [seed for _, seed in found] == [1] * 5 + [2] * 5
    assert {layout.name for layout, _ in found[5:8]} == {"Line", "best-gain-1", "sky"}
