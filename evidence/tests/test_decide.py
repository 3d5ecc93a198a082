"""Regret and the rule on studies whose answer is known."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("scipy", reason="SciPy is not installed")
pytest.importorskip("lightgbm", reason="lightgbm is not installed")
from sightline_evidence import correlate, decide, effects
from sightline_evidence.gathered import Gathered
from sightline_evidence.layouts import Layout

NAMES = ["Ours-seg", "Center", "best-pool-gain-box", "random-a", "random-b", "random-c"]


def study(metric: Any, scores: dict[str, Any]) -> Gathered:
    layouts = [Layout(name, "box", np.zeros((4, 6))) for name in NAMES]
    scenes = [f"scene-{k}" for k in range(np.shape(metric)[1])]
    plan: Any = SimpleNamespace()
    tables = {"birds_eye_miou": np.array([metric], dtype=float)}
    return Gathered(plan, layouts, scenes, [1], tables, {k: np.array(v, dtype=float) for k, v in scores.items()}, {}, [])


def noisy(means: list[float], noise: float) -> Any:
    return np.array(means)[:, None] + noise * np.random.default_rng(1).standard_normal((len(means), 12))


def test_an_optimum_that_is_better_becomes_the_default() -> None:
    metric = noisy([0.5, 0.4, 0.6, 0.2, 0.3, 0.1], 0.005)
    given = study(metric, {"information_gain": metric, "m_sog": -metric, "mean_height": metric})
    found = decide.of(given, given.pool("box"))
    assert found["scores"]["information_gain"]["mean"]["value"] == 0
    assert found["scores"]["m_sog"]["mean"]["value"] > 1
    assert found["verdict"]["least_mean_regret"] == "information_gain"
    assert found["verdict"]["becomes_default"] is True
    against = found["optima"]["information_gain"]["metrics"]["birds_eye_miou"]
    assert against["minus Ours-seg"]["value"] == pytest.approx(0.1, abs=0.01)


def test_what_loses_more_is_not_told_to_lose_less() -> None:
    for best, words in [(0.6, r"its optima lose 0\.\d\d \[0\.\d\d 0\.\d\d\] less than Ours-seg"),
                        (0.4, r"its optima lose 0\.\d\d \[0\.\d\d 0\.\d\d\] more than Ours-seg")]:  # fmt: skip
        metric = noisy([0.5, 0.3, best, 0.2, 0.3, 0.1], 0.005)
        given = study(metric, {"information_gain": metric, "m_sog": -metric})
        assert re.search(words, decide.of(given, given.pool("box"))["verdict"]["why"])


def test_one_that_is_not_does_not() -> None:
    metric = noisy([0.5, 0.4, 0.5, 0.2, 0.3, 0.1], 0.05)
    given = study(metric, {"information_gain": metric, "m_sog": -metric})
    assert decide.of(given, given.pool("box"))["verdict"]["becomes_default"] is False
    given = study(metric, {"gain_low": metric, "m_sog": -metric})
    assert decide.of(given, given.pool("box"))["verdict"]["why"] == "it was not searched with"


def test_regret_of_best_random_and_worst() -> None:
    metric = np.array([[0.1, 0.2, 0.3, 0.6], [0.6, 0.3, 0.2, 0.1]]).T
    lost = decide.regrets(metric)
    worst = (0.6 - 0.1) / (0.6 - 0.3)
    # Placements that a score puts first together count with their mean, also where the last bit tells them apart.
    heights = np.array([np.mean([0.1, 0.2, 0.3]), np.mean([0.3, 0.2, 0.1]), 0, 0])
    assert heights[0] != heights[1]
    scores = np.stack([metric, np.ones((4, 2)), -metric, np.repeat(heights[:, None], 2, axis=1)])
    expected = [[0, 0], [1, 1], [worst, worst], lost[:2].mean(axis=0)]
    np.testing.assert_allclose(decide.picked_regret(scores, lost[None])[:, 0], expected, atol=1e-12)
    assert np.isnan(decide.regrets(np.ones((4, 1)))).all()


def test_intervals_are_over_placements_too() -> None:
    """Scenes that all say the same leave nothing to be drawn but the placements that there were to choose from."""
    metric = np.repeat(np.array([[0.5, 0.4, 0.6, 0.2, 0.3, 0.1]]).T, 12, axis=1)
    # Puts the third best first.
    given = study(metric, {"information_gain": metric, "m_sog": -np.abs(metric - 0.4), "shuffled": metric[::-1]})
    found = decide.of(given, given.pool("box"))["scores"]
    mean = found["m_sog"]["mean"]
    assert mean["value"] == pytest.approx(0.2 / 0.25) and mean["low"] < 0.5 and mean["high"] > 1.2
    assert found["information_gain"]["mean"] == {"value": 0, "low": 0, "high": 0}
    less = found["m_sog"]["less_than_gain"]
    assert less["value"] == pytest.approx(-0.8) and less["low"] < -1.2 and less["high"] > -0.5


def test_picks_by_a_loop_over_draws() -> None:
    rng = np.random.default_rng(4)
    scores, metrics = rng.random((3, 7, 5)), rng.random((2, 7, 5))
    metrics[1, :, 2] = np.nan
    among = np.array([[True, True], [False, True]])
    drawn = correlate.Drawn.of(rng, 7, 5, 20)
    found = decide.picked(scores, metrics, among, drawn)
    rows = [np.arange(7), *drawn.placements]
    for k, (chosen, often) in enumerate(zip(rows, [np.ones(5, int), *drawn.scenes])):
        for j, score in enumerate(scores):
            each = []
            for scene in np.repeat(np.arange(5), often):
                top = chosen[np.argmax(score[chosen, scene])]
                of = metrics[:, chosen, scene]
                lost = (of.max(axis=1) - metrics[:, top, scene]) / (of.max(axis=1) - of.mean(axis=1))
                each.append([np.nanmean(lost), lost[1]])
            np.testing.assert_allclose(found[k, j], np.nanmean(each, axis=0), atol=1e-12)


def test_seeds_widen_a_difference() -> None:
    rng = np.random.default_rng(5)
    seeds = rng.normal(0, 1, (2, 12))
    alike = np.array([[1.0], [-1.0]]) + np.zeros((2, 12))
    both, mean = decide.over_scenes(seeds), decide.over_scenes(seeds.mean(axis=0))
    assert both.value == pytest.approx(mean.value) and both.high - both.low > 1.1 * (mean.high - mean.low)
    # Scenes alone see nothing of what a seed changes.
    assert decide.over_scenes(alike.mean(axis=0)).high == 0 and decide.over_scenes(alike).high > 0.3
    # With one seed scenes alone are drawn, and missing values are left out.
    seeds[1, 3], seeds[:, 4] = np.nan, np.nan
    assert decide.over_scenes(seeds).value == pytest.approx(np.nanmean([np.nanmean(c) for c in seeds.T if np.isfinite(c).any()]))


def test_learners_with_other_seeds_weigh_alike() -> None:
    """The trees have one seed, the nets two: each metric counts once, as it does in the regret of a placement."""
    metric = noisy([0.5, 0.4, 0.6, 0.2, 0.3, 0.1], 0.01)
    given = study(metric, {"information_gain": metric})
    nets = np.stack([metric[::-1] + 0.01, metric[::-1] - 0.01])
    given.metrics["unet_birds_eye_miou"] = nets
    found = decide.of(given, given.pool("box"))
    lost = np.mean([decide.regrets(metric), decide.regrets(nets.mean(axis=0))], axis=0).mean(axis=1)
    assert [of["mean"]["value"] for of in found["placements"].values()] == pytest.approx(lost.tolist())
    less = found["optima"]["information_gain"]["less_regret_than"]["Ours-seg"]
    assert less["value"] == pytest.approx(lost[0] - lost[2])


def test_a_scene_without_objects_does_not_drop_their_metric() -> None:
    metric = noisy([0.5, 0.4, 0.6, 0.2, 0.3, 0.1], 0.005)
    given = study(metric, {"information_gain": metric})
    objects = metric.copy()
    objects[:, 3] = np.nan
    given.metrics["objects_5"] = objects[None]
    found = decide.of(given, given.pool("box"))
    assert found["metrics"] == ["birds_eye_miou", "objects_5"]
    assert found["scores"]["information_gain"]["by_metric"]["objects_5"]["value"] == 0
    objects[:, 3:] = np.nan
    given.metrics["objects_5"] = objects[None]
    assert decide.of(given, given.pool("box"))["metrics"] == ["birds_eye_miou"]


def pairs(values: dict[str, float], pools: dict[str, str]) -> Gathered:
    """Placements with these values in each of two scenes."""
    plan: Any = SimpleNamespace()
    layouts = [Layout(name, pools.get(name, "box"), np.zeros((4, 6))) for name in values]
    metric = np.repeat(np.array([list(values.values())]).T, 2, axis=1)
    scores = {name: metric for name in ("near_gain", "information_gain")}
    return Gathered(plan, layouts, ["a", "b"], [1], {"birds_eye_miou": metric[None]}, scores, {}, [])


def test_optima_are_compared_with_those_of_the_default() -> None:
    given = pairs({"Ours-seg": 4.0, "Center": 2, "best-near_gain-1": 5, "best-pool-gain-box": 3, "random-a": 1}, {})
    found = decide.of(given, given.pool("box"))["optima"]
    # Best − mean is 2: the default's lose nothing, the gain's lose 1, Ours-seg loses a half.
    less = found["information_gain"]["less_regret_than"]
    assert {other: one["value"] for other, one in less.items()} == {"Ours-seg": -0.5, "optima of near_gain": -1}
    assert list(found["near_gain"]["less_regret_than"]) == ["Ours-seg"]


def test_low_ones_and_phases_are_differences() -> None:
    values = {"Ours-seg": 4.0, "Line-in-step": 1, "Line-staggered": 1.5, "Square-in-step": 9, "low-front": 3}
    found = effects.of(pairs(values, {"low-front": "mixed"}))
    assert {name: of["birds_eye_miou"]["value"] for name, of in found["low"].items()} == {"low-front": -1}
    assert {name: of["birds_eye_miou"]["value"] for name, of in found["phases"].items()} == {"Line": 0.5}


def test_what_there_is_to_win() -> None:
    """Chosen on the first seed, told by the second."""
    names = ["Ours-seg", "Center", "random-a", "random-b", "count-6"]
    layouts = [Layout(name, "number" if name == "count-6" else "box", np.zeros((4, 6))) for name in names]
    first = np.array([[4.0, 4], [2, 2], [5, 5], [1, 1], [6, 6]])
    second = np.array([[4.0, 4], [2, 2], [3, 3], [3, 3], [6, 6]])
    plan: Any = SimpleNamespace()
    given = Gathered(plan, layouts, ["a", "b"], [1, 2], {"birds_eye_miou": np.array([first, second])}, {}, {}, [])
    best = effects.of(given)["to_win"]["the best of those in the mount"]["birds_eye_miou"]
    assert (best["placement"], best["value"]) == ("random-a", -1)
    assert effects.of(replace(given, seeds=[1]))["to_win"] == {}


def test_scenes_of_each_origin_by_themselves() -> None:
    """The gain's optimum is best in generated scenes and worst in towns on maps."""
    good, bad = [0.5, 0.4, 0.6, 0.2, 0.3, 0.1], [0.5, 0.4, 0.05, 0.2, 0.3, 0.1]
    metric = np.array([good, good, bad, bad, good]).T
    given = study(metric, {"information_gain": np.repeat(np.array([good]).T, 5, axis=1)})
    given = replace(given, scenes=["street-401", "town-402", "Town03", "Town04", "highway"])
    found = effects.of(given)["places"]
    assert {origin: len(of["scenes"]) for origin, of in found.items()} == {"generated": 2, "on OpenDRIVE maps": 2, "own": 1}
    assert [of["regret"]["information_gain"]["value"] > 0 for of in found.values()] == [False, True, False]
    assert [of["optima"]["information_gain"]["value"] > 0 for of in found.values()] == [True, False, True]


def test_regret_by_hand() -> None:
    metric = np.array([[3.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
    found = decide.regrets(metric)
    np.testing.assert_allclose(found[:, 0], [0, 2, 1])
    assert np.isnan(found[:, 1]).all()
    score = np.array([[0.0, 0], [1, 0], [1, 0]])
    np.testing.assert_allclose(decide.picked_regret(score[None], found[None])[0, 0, 0], 1.5)


def test_effects_find_the_height() -> None:
    rng = np.random.default_rng(2)
    layouts, heights = [], rng.uniform(2.2, 2.8, 40)
    for height in heights:
        poses = np.zeros((4, 6))
        poses[:, :2] = rng.uniform(-0.5, 0.5, (4, 2))
        poses[:, 2] = height + rng.uniform(-0.05, 0.05, 4)
        poses[:, 3] = rng.uniform(-0.3, 0.3, 4)
        layouts.append(Layout(f"random-{height}", "box", poses))
    plan: Any = SimpleNamespace()
    metric = np.repeat(heights[:, None], 3, axis=1)[None]
    given = Gathered(plan, layouts, ["a", "b", "c"], [1], {"birds_eye_miou": metric}, {}, {}, [])
    found = effects.of(given)["poses"]["birds_eye_miou"]
    assert found["mean_height"]["low"] > 0.9
    assert found["mean_roll"]["low"] < 0 < found["mean_roll"]["high"]


def test_scenes_needed_follow_the_spread_of_differences() -> None:
    rng = np.random.default_rng(3)
    metric = 0.4 + 0.02 / np.sqrt(2) * rng.standard_normal((6, 400))
    found = effects.of(study(metric, {}))["needed"]["birds_eye_miou"]
    assert found["spread"] == pytest.approx(0.02, rel=0.1)
    assert found["scenes"] == pytest.approx(31.4, rel=0.25)
