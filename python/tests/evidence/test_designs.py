"""Variants of placements: kept in a plan as they are, scanned as they say, compared pair by pair."""

from __future__ import annotations

import gzip
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
from sightline.evidence import __main__, charts, effects, layouts, plan, scores, trial, variants, worlds
from sightline.evidence.designs import DESIGNS, KINDS
from sightline.evidence.gathered import Gathered
from sightline.evidence.layouts import Layout
from sightline.evidence.plan import Plan
from sightline.evidence.worlds import LIDAR

#: A fork of three roads.
FORK = Path(__file__).resolve().parents[3] / "tests" / "data" / "fork.xodr"


def test_layouts_come_out_of_a_plan_as_they_went_in() -> None:
    bases = layouts.published()
    all_sorts = [*layouts.sensors(), *layouts.channels(bases), *layouts.conditions(bases), *layouts.gamed(), *layouts.numbers()]
    for layout in all_sorts + layouts.out_of_step(all_sorts):
        again = Layout.from_dict(layout.to_dict())
        np.testing.assert_array_equal(again.poses, layout.poses)
        np.testing.assert_array_equal(again.placement().phases, layout.placement().phases)
        kept = ("name", "pool", "lidar", "trained_in", "tested_in")
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
    # Variants of a placement are compared with each other: their phases are the same share of their steps.
    more = layouts.out_of_step(layouts.channels(layouts.published()))
    np.testing.assert_array_equal(more[0].phases, free[more[0].name.partition("@")[0]].phases)
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
    monkeypatch.chdir(Path(__file__).resolve().parents[3])
    asked: list[tuple[str, int, str]] = []

    def world(name: str, seed: int, role: str) -> worlds.World:
        asked.append((name, seed, role))
        return worlds.world(name, small_file, role, 1)

    monkeypatch.setattr(worlds, "generated", lambda kind, seed, role, frames, folder: world(f"{kind}-{seed}", seed, role))
    monkeypatch.setattr(worlds, "imported", lambda xodr, name, seed, role, frames, folder, called: world(called, seed, role))
    design = replace(DESIGNS["channels"], name="towns", train_towns=(("Town01", 1),), test_towns=(("Town03", 2),))
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


def test_more_channels_have_more_points_and_fog_fewer(small_file: Path) -> None:
    world = worlds.world("small", small_file, "test", 1)
    bases = layouts.published()
    by_name = {layout.name: layout for layout in layouts.channels(bases) + layouts.conditions(bases)}
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
        {name: metric for name in variants.CHOOSING},
        {},
        [],
    )
    found = effects.of(given)["variants"]
    assert found["first"]["metrics"]["birds_eye_miou"]["less_first"]["value"] == 0
    more = found["more"]["metrics"]["birds_eye_miou"]
    assert more["less_first"]["value"] == pytest.approx((1 + 2 + 0 + 1.1 + 2 + 0) / 6)
    assert more["order_as_first"]["value"] == pytest.approx(0.5)
    assert found["more"]["placements"] == 3
    # Three have no order to choose by.
    assert not found["more"]["chosen"]


def drawn(effects: dict[str, Any]) -> Any:
    """A page of matplotlib with a picture of these effects."""
    figure = pytest.importorskip("matplotlib.figure", reason="matplotlib is not installed")
    page = figure.Figure()
    assert charts.of(page, effects)
    return page


def change(value: float) -> dict[str, float]:
    return {"value": value, "low": value - 0.1, "high": value + 0.1}


def test_weather_is_drawn_beside_clear_air() -> None:
    def weather(value: float) -> dict[str, Any]:
        return {"metrics": {"birds_eye_miou": {"mean": 0.4 + value, "less_first": change(value)}}}

    variants = {"clear": weather(0), "fog, trained in clear air": weather(-0.2), "fog, trained in it": weather(-0.1)}
    page = drawn({"variants": variants, "transfer": {}})
    (spot,) = page.axes
    dots = [line for line in spot.lines if line.get_marker() == "o" and len(line.get_xdata())]
    assert [float(line.get_xdata()[0]) for line in dots] == [-0.2, -0.1]
    assert [text.get_text() for text in spot.get_yticklabels()] == ["fog"]
    assert [text.get_text() for text in page.legends[0].get_texts()] == ["trained in clear air", "trained in it"]
    assert spot.get_title() == "bird's-eye map, mIoU\n(0.40 in clear)" and spot.get_xlabel() == "difference from clear"


def test_channels_are_drawn_from_the_first_on() -> None:
    variants = {
        f"{count}-channels": {"metrics": {m: {"mean": 0.3, "less_first": change(value)} for m in ("objects_5", "voxel_miou")}}
        for count, value in ((16, 0.0), (64, 0.2))
    }
    (spot,) = drawn({"variants": variants, "transfer": {}}).axes
    assert spot.lines[0].get_xdata().tolist() == [16, 64]
    np.testing.assert_allclose(spot.lines[0].get_ydata(), [0.3, 0.5])


def test_what_was_searched_elsewhere_is_drawn_and_nothing_else_is() -> None:
    transfer = {"best-of-street": {"birds_eye_miou": {"all": change(0.1), "street": 0.1}}}
    (spot,) = drawn({"variants": {}, "transfer": transfer}).axes
    assert [text.get_text() for text in spot.get_yticklabels()] == ["street"]
    assert not charts.of(None, {"variants": {}, "transfer": {}})


def test_placements_of_the_standard_run_come_again_out_of_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).resolve().parents[3])
    found = plan._again()
    names = [one.name for one in found]
    assert len(set(names)) == len(names) and set(plan.CONTROLLED) < set(names)
    assert {one.name for one in layouts.published()} | {f"best-{name}-1" for name in plan.OBJECTIVES} < set(names)
    assert all(one.phases is None for one in found if one.name not in plan.CONTROLLED)
    looked_at = {seed for name in ("quick", "standard", "channels", "conditions", "transfer") for _, seed in DESIGNS[name].test}
    assert not looked_at & {seed for _, seed in DESIGNS["again"].test}


def test_towns_have_those_in_the_mount_of_the_standard_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).resolve().parents[3])
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


def test_variants_are_of_placements_of_the_standard_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).resolve().parents[3])
    names = [one.name for one in plan._varied()]
    assert {one.name for one in layouts.published()} | {f"best-{name}-1" for name in plan.VARIED} < set(names)
    assert 20 <= len(names) == len(set(names)) and all(one.phases is not None for one in plan._varied())
    looked_at = {world for name, design in DESIGNS.items() if name not in ("channels", "conditions") for world in design.test + design.train}
    assert not looked_at & {*DESIGNS["channels"].test, *DESIGNS["conditions"].test}


def test_what_is_tested_in_fog_is_scored_in_fog(small_file: Path) -> None:
    world = worlds.world("small", small_file, "test", 1)
    bases = layouts.out_of_step(layouts.published()[:3])
    placed = layouts.conditions(bases)
    number = {layout.name: k for k, layout in enumerate(placed)}
    found = {score: np.array(values) for score, values in scores.of_world(world, placed, 2).items()}
    in_fog = world.source().open(2, conditions=("fog:level=heavy",), lidar=LIDAR)
    clear = world.source().open(2, lidar=LIDAR)
    rigs = [one.placement(one.name) for one in bases]
    for scene, variants_of in ((clear, ["clear"]), (in_fog, ["fog, trained in clear air", "fog, trained in it"])):
        expected = scene.score(rigs, self_hits=False)["near_gain"]
        for variant in variants_of:
            rows = [number[f"{one.name}@{variant}"] for one in bases]
            np.testing.assert_array_equal(found["near_gain"][rows], expected)
            # Candidates know no weather.
            assert np.isfinite(found["blend"][rows]).all() == np.isfinite(found["hits"][rows]).all() == (variant == "clear")
    assert found["near_gain"][number["Center@fog, trained in it"]] < found["near_gain"][number["Center@clear"]]


def in_two_weathers(here: list[float]) -> Gathered:
    """Five placements that fog turns round, with scores as in clear air and as ``here``."""
    names = ["Ours-seg", "Center", "Line", "best-near_gain-1", "random-low-wide-0"]
    metric = np.array([[1.0, 1.1], [2, 2.1], [3, 3.1], [4, 4.1], [5, 5.1]])
    both = np.concatenate([metric, metric[::-1]])
    known = np.concatenate([metric, np.repeat(np.array(here)[:, None], 2, axis=1)])
    anything: Any = SimpleNamespace()
    return Gathered(
        anything,
        [Layout(f"{name}@{variant}", "variant", np.zeros((4, 6))) for variant in ("clear", "fog, trained in it") for name in names],
        ["street-1", "yard-1"],
        [1],
        {m: both[None] for m in ("birds_eye_miou", "objects_5")},
        {name: known for name in variants.CHOOSING},
        {},
        [],
    )


def test_a_score_of_clear_air_loses_where_the_weather_turns_the_order_round() -> None:
    found = variants.of(in_two_weathers([5.0, 4, 3, 2, 1]))
    clear, fog = (found[name]["chosen"] for name in ("clear", "fog, trained in it"))
    near = clear["scores"]["near_gain"]
    assert near["as_first"]["regret"]["value"] == 0 and near["as_first"]["spearman"]["objects_5"]["value"] == pytest.approx(1)
    assert "here" not in near
    near = fog["scores"]["near_gain"]
    # The worst of five, as far below the mean as the best is above.
    assert near["as_first"]["regret"]["value"] == pytest.approx(2) and near["here"]["regret"]["value"] == 0
    assert near["less"]["value"] == pytest.approx(2)
    assert near["as_first"]["spearman"]["birds_eye_miou"]["value"] == pytest.approx(-1)
    # The optimum of four is worth 3 more than the published placement in clear air, and as much less in fog.
    assert clear["optima"]["near_gain"]["value"] == pytest.approx(1.5)
    assert fog["optima"]["near_gain"]["value"] == pytest.approx(-1.5)
    # What has no score in fog is shown as it is in clear air alone.
    fog = variants.of(in_two_weathers([np.nan] * 5))["fog, trained in it"]["chosen"]
    assert set(fog["scores"]["blend"]) == {"as_first"}


def test_first_choices_are_drawn_beneath() -> None:
    page = drawn({"variants": variants.of(in_two_weathers([5.0, 4, 3, 2, 1])), "transfer": {}})
    _, lower = page.subfigs
    near = lower.axes[0]
    dots = {line.get_color(): float(line.get_xdata()[0]) for line in near.lines if line.get_marker() == "o" and len(line.get_xdata())}
    assert dots["#2b6cb0"] == 0 and dots["#dd6b20"] == pytest.approx(2)
    assert [text.get_text() for text in near.get_yticklabels()] == ["clear", "fog"]
    assert [text.get_text() for text in lower.legends[0].get_texts()] == ["scored as in clear", "scored as here"]
