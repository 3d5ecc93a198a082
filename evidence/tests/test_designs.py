"""Variants of placements: kept in a plan as they are, scanned as they say, compared pair by pair."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
from sightline_evidence import __main__, layouts, plan, worlds
from sightline_evidence.designs import DESIGNS, KINDS
from sightline_evidence.layouts import Layout
from sightline_evidence.plan import Plan
from sightline_evidence.worlds import LIDAR

#: A fork of three roads.
FORK = Path(__file__).resolve().parents[2] / "tests" / "data" / "fork.xodr"


def test_layouts_come_out_of_a_plan_as_they_went_in() -> None:
    all_sorts = [*layouts.sensors(), *layouts.gamed(), *layouts.numbers()]
    for layout in all_sorts + layouts.out_of_step(all_sorts):
        again = Layout.from_dict(layout.to_dict())
        np.testing.assert_array_equal(again.poses, layout.poses)
        np.testing.assert_array_equal(again.placement().phases, layout.placement().phases)
        kept = ("name", "pool", "lidar")
        assert [getattr(again, key) for key in kept] == [getattr(layout, key) for key in kept]


def test_designs_are_what_the_issue_asks_for() -> None:
    assert tuple(DESIGNS) == __main__.NAMES
    standard = DESIGNS["standard"]
    assert len(standard.train) >= 20 and len(standard.test) >= 12 and standard.own
    assert {kind for kind, _ in standard.test} == {kind for kind, _ in standard.train} == set(KINDS)
    for design in DESIGNS.values():
        assert not set(design.train) & set(design.test), design.name


def test_lidars_fire_out_of_step_unless_a_layout_says_otherwise(small_file: Path) -> None:
    free = {one.name: one for one in layouts.out_of_step(layouts.published() + layouts.in_step_and_staggered())}
    step = 2 * np.pi / LIDAR["azimuth_steps"]
    assert np.unique(free["Center"].placement().phases).size == 4
    assert np.all((free["Center"].placement().phases >= 0) & (free["Center"].placement().phases < step))
    assert np.all(free["Center-in-step"].placement().phases == 0)
    np.testing.assert_allclose(free["Center-staggered"].placement().phases / step, [0, 0.25, 0.5, 0.75])
    # Four in step at one spot meet the same points; out of step they do not.
    world = worlds.world("small", small_file, "test", 1)
    stacked = Layout("stacked", "gamed", np.tile([0.0, 0, 2.5, 0, 0, 0], (4, 1)))
    # The gamed one stays in step: out of step it is no waste.
    (gamed,) = layouts.out_of_step([one for one in layouts.gamed() if one.name == "stacked"])
    for layout, least in ((stacked, 1.0), (gamed, 1.0), (layouts.out_of_step([stacked])[0], 3.9)):
        cast = world.scene().cast(layout.placement())
        assert len(np.unique(cast["direction"], axis=0)) >= least * 0.99 * 16 * 250
        assert least > 1 or len(np.unique(cast["direction"], axis=0)) <= 16 * 250


def test_one_to_six_lidars_have_all_of_the_one_before() -> None:
    placed = [one.placement() for one in layouts.out_of_step(layouts.numbers())]
    for less, more in zip(placed, placed[1:]):
        np.testing.assert_array_equal(more.poses[:-1], less.poses)
        np.testing.assert_array_equal(more.phases[:-1], less.phases)


def test_towns_stand_on_opendrive_maps(tmp_path: Path) -> None:
    if not FORK.is_file():
        pytest.skip(f"{FORK} is not there")
    maps = tmp_path / "maps" / "deeper"
    maps.mkdir(parents=True)
    (maps / "fork.xodr.gz").write_bytes(gzip.compress(FORK.read_bytes()))
    town = worlds.imported(tmp_path / "maps", "fork", 3, "train", 2, tmp_path / "worlds")
    assert (town.name, town.role, town.frames) == ("fork", "train", [10, 30])
    assert len(town.source().described["actors"]) > 0
    assert sorted(path.name for path in (tmp_path / "worlds").iterdir()) == ["fork.json", "fork.ply"]
    again = worlds.imported(tmp_path / "maps", "fork", 3, "train", 2, tmp_path / "other")
    assert again.sha256 == town.sha256
    for damaged in (gzip.compress(FORK.read_bytes()[:700]), gzip.compress(FORK.read_bytes())[:-20], b"no gzip"):
        (maps / "Damaged.xodr.gz").write_bytes(damaged)
        with pytest.raises((ValueError, OSError), match=r"Damaged.xodr.gz: is no map that a town can be made on"):
            worlds.imported(tmp_path / "maps", "Damaged", 1, "test", 2, tmp_path / "worlds")
    assert sorted(path.name for path in (tmp_path / "worlds").iterdir()) == ["fork.json", "fork.ply"]
    with pytest.raises(ValueError, match="holds no Town99.xodr"):
        worlds.imported(tmp_path / "maps", "Town99", 1, "test", 2, tmp_path / "worlds")


def test_a_plan_has_towns_where_their_maps_are(
    tmp_path: Path, small_file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(Path(__file__).resolve().parents[2])
    asked: list[tuple[str, int, str]] = []

    def world(name: str, seed: int, role: str) -> worlds.World:
        asked.append((name, seed, role))
        return worlds.world(name, small_file, role, 1)

    monkeypatch.setattr(worlds, "generated", lambda kind, seed, role, frames, folder: world(f"{kind}-{seed}", seed, role))
    monkeypatch.setattr(worlds, "imported", lambda xodr, name, seed, role, frames, folder, called: world(called, seed, role))
    design = replace(DESIGNS["towns"], test=(("street", 601),), train_towns=(("Town01", 1),), test_towns=(("Town03", 2),))
    made = plan.make(design, tmp_path / "with", tmp_path, tmp_path, 1)
    assert {("Town01", 1, "train"), ("Town03", 2, "test")} <= set(asked)
    assert [world.name for world in made.of("test")][-1] == "Town03"
    assert all("phases" in layout for layout in made.record["placements"])
    asked.clear()
    without = plan.make(design, tmp_path / "without", tmp_path, None, 1)
    assert not {name for name, _, _ in asked} & {"Town01", "Town03"} and len(without.worlds) == len(made.worlds) - 2
    assert "without --xodr: Town03 to test are left out" in capsys.readouterr().err
    several = replace(design, test_towns=(("Town03", 2), ("Town03", 5), ("Town04", 2)))
    names = [world.name for world in plan.make(several, tmp_path / "several", tmp_path, tmp_path, 1).of("test")]
    assert names[-3:] == ["Town03-2", "Town03-5", "Town04"]


def test_towns_have_those_in_the_mount_of_the_standard_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).resolve().parents[2])
    kept = {one["name"]: one for one in plan.read_json(plan.STANDARD)["plan"]["placements"]}
    found = plan._towns()
    assert {f"best-{name}-{n}" for name in plan.OBJECTIVES for n in (1, 2)} < {one.name for one in found}
    assert len(found) > 40 and all(one.to_dict() == kept[one.name] for one in found)
    tested = {name: set(DESIGNS[name].test_towns + DESIGNS[name].train_towns) for name in DESIGNS}
    assert not set(DESIGNS["towns"].test_towns) & set().union(*(tested[name] for name in DESIGNS if name != "towns"))


def test_units_come_in_an_order_that_leaves_some_of_all() -> None:
    sorts = [("best-gain-1", "box"), ("Line", "box"), ("sky", "gamed"), ("random-low-wide-0", "box"), ("random-low-wide-1", "box")]
    placed = [Layout(name, pool, np.zeros((4, 6))) for name, pool in reversed(sorts)]
    found = Plan([], placed, [1, 2], DESIGNS["quick"].learner, {}).units()
    assert [layout.name for layout, seed in found if seed == 1] == ["Line", "best-gain-1", "random-low-wide-0", "sky", "random-low-wide-1"]
    assert [seed for _, seed in found] == [1] * 5 + [2] * 5
    assert {layout.name for layout, _ in found[5:8]} == {"Line", "best-gain-1", "sky"}
