"""Which score a search should follow: the rule of the study, fixed before its result and applied without a look."""

from __future__ import annotations

import functools
from dataclasses import asdict
from typing import Any

import numpy as np

from . import correlate
from ._types import F64, I64, Bools
from .gathered import Gathered, mean
from .plan import OBJECTIVES
from .trial import METRICS

#: Seed of all bootstraps.
SEED = 11

#: Metrics that decide: every metric on fixed targets, of every learner.
DECIDING = (
    *(metric for metric in METRICS if not metric.startswith("own_")),
    "unet_birds_eye_miou",
    "unet_centre_recall",
)

#: Deciding metrics by their subject, for a reader; the rule takes all alike.
ABOUT = {
    "recognized": ("voxel_miou", "voxel_1m_miou", "birds_eye_miou", "unet_birds_eye_miou"),
    "objects": ("objects_5", "objects_20", "unet_centre_recall"),
    "near ground": ("ground_seen_3m", "ground_seen_10m"),
}

#: Scores that no search would follow: null models, and the sums of which others are made.
NULL = ("hits", "mean_height", "shuffled", "covered")

#: Score that regrets are compared with: the default of ``optimize`` until these studies.
GAIN = "information_gain"

#: Score that the optima of others are compared with, too: the default of ``optimize`` since.
DEFAULT = OBJECTIVES[0]

#: The best published optimum.
PUBLISHED = "Ours-seg"


#: Draws of the bootstrap of a difference between placements.
DRAWS = 10_000

#: Numbers of a table that draws are put into at once: some tens of MB.
_AT_ONCE = 4_000_000


def of(given: Gathered, kept: Bools) -> dict[str, Any]:
    """Regret of each score over metrics, of each placement, and what the rule says, among placements ``kept``.

    Intervals of what a score picks are over placements and scenes: other placements, another pick, another best.
    Placements that are there anyhow are compared over scenes and seeds.
    """
    metrics = metrics_of(given, kept)
    tables = np.stack([given.mean(m)[kept] for m in metrics])
    drawn = correlate.Drawn.of(np.random.default_rng(SEED), *tables.shape[1:])
    groups = {"mean": metrics, **ABOUT, **{m: (m,) for m in metrics}}
    among = np.array([[m in group for m in metrics] for group in groups.values()])
    losses = picked(np.stack([v[kept] for v in given.scores.values()]), tables, among, drawn)
    numbers = {score: k for k, score in enumerate(given.scores)}
    by_score = {}
    for score, k in numbers.items():
        of = {group: asdict(interval_of(losses[:, k, j])) for j, group in enumerate(groups)}
        less = losses[:, numbers.get(GAIN, k), 0] - losses[:, k, 0]
        by_score[score] = {
            "less_than_gain": asdict(interval_of(less)),
            "mean": of["mean"],
            "about": {name: of[name] for name in ABOUT},
            "by_metric": {m: of[m] for m in metrics},
        }
    each = lost_by_seed(given, kept, metrics)
    lost = mean(each, 0)
    layouts = [layout for layout, keep in zip(given.layouts, kept) if keep]
    placements = {
        layout.name: {
            "mean": asdict(over_scenes(lost[:, k])),
            "by_metric": {m: float(mean(mean(of[:, k], 0), 0)) for m, of in zip(metrics, each)},
        }
        for k, layout in enumerate(layouts)
    }
    found = {"metrics": metrics, "scores": by_score, "placements": placements}
    return {**found, "optima": optima(given, kept, lost, metrics), "verdict": _verdict(given, kept, by_score, lost)}


def metrics_of(given: Gathered, kept: Bools) -> list[str]:
    """Metrics of ``DECIDING`` that most of the placements have."""
    return [m for m in DECIDING if m in given.metrics and _is_known(given.mean(m)[kept])]


def lost_by_seed(given: Gathered, kept: Bools, metrics: list[str]) -> F64:
    """``regrets`` ``[metrics, seeds, placements, scenes]`` in each seed, among the placements ``kept`` in the mean over seeds."""
    tables = np.stack([given.mean(m)[kept] for m in metrics])
    return regrets(np.stack([_by_seed(given, m)[:, kept] for m in metrics]), tables[:, None])


def _is_known(table: F64) -> bool:
    """Whether most placements have a metric, each in most scenes: one without objects has none of theirs."""
    return bool((np.isfinite(table).mean(axis=1) > 0.5).mean() > 0.8)


def _by_seed(given: Gathered, metric: str) -> F64:
    """``[seeds, placements, scenes]``, of as many seeds for every metric: for one that is missing the mean stands in."""
    most = max(len(table) for table in given.metrics.values())
    table, whole = given.metrics[metric], given.mean(metric)
    return np.stack([np.where(np.isfinite(table[k]), table[k], whole) if k < len(table) else whole for k in range(most)])


def regrets(metric: F64, whole: F64 | None = None) -> F64:
    """(best − each) / (best − mean) of ``[…, placements, scenes]``: 0 the best, 1 a random one; ``NaN`` if all are one.

    Best and mean are those of ``whole``, if that is given.
    """
    whole = metric if whole is None else whole
    best = np.where(np.isfinite(whole), whole, -np.inf).max(axis=-2, keepdims=True)
    middle = np.expand_dims(mean(whole, -2), -2)
    with np.errstate(invalid="ignore", divide="ignore"):
        found: F64 = np.where(best > middle, (best - metric) / (best - middle), np.nan)
    return found


def picked_regret(score: F64, regret: F64) -> F64:
    """Regret ``[…, scores, metrics, scenes]`` of the placement that a score puts first in each scene.

    ``score`` is ``[…, scores, placements, scenes]``, ``regret`` ``[…, metrics, placements, scenes]``. Placements that
    are equally first, but for the last bits, give their mean.
    """
    known = np.where(np.isfinite(score), score, -np.inf)
    best = known.max(axis=-2, keepdims=True)
    # Means of the same heights in another order differ in the last bit; ``best`` is never below.
    first = (known >= best - 1e-9 * np.abs(best)) & np.isfinite(known)
    there = np.isfinite(regret)
    first, there, regret = (np.moveaxis(x, -1, -3) for x in (first.astype(float), there.astype(float), np.where(there, regret, 0.0)))
    # [..., scenes, scores, metrics]
    count = first @ np.swapaxes(there, -1, -2)
    total = first @ np.swapaxes(regret, -1, -2)
    found: F64 = np.moveaxis(np.where(count > 0, total / np.maximum(count, 1), np.nan), -3, -1)
    return found


def picked(scores: F64, metrics: F64, among: Bools, drawn: correlate.Drawn) -> F64:
    """``[1 + draws, scores, groups]``: mean regret of what scores pick, first of all placements and scenes as they are.

    ``scores`` is ``[scores, placements, scenes]``, ``metrics`` ``[metrics, placements, scenes]``; ``among``
    ``[groups, metrics]`` says of which metrics a group is the mean. Pick, best and mean are those of each draw.
    """
    _, count, scenes = scores.shape
    rows = np.concatenate([np.arange(count)[None], drawn.placements])
    often = np.concatenate([np.ones((1, scenes), np.int64), drawn.scenes])
    found = []
    step = max(1, _AT_ONCE // ((len(scores) + len(metrics)) * count * scenes))
    for start in range(0, len(rows), step):
        chosen = rows[start : start + step]
        # [draws, …, placements, scenes]
        score, metric = (np.moveaxis(table[:, chosen], 1, 0) for table in (scores, metrics))
        each = picked_regret(score, regrets(metric))
        by_group = np.stack([mean(each[:, :, of], 2) for of in among], axis=2)
        found.append(_weighted(by_group, often[start : start + step, None, None]))
    return np.concatenate(found)


def _weighted(values: F64, often: I64) -> F64:
    """Mean along the last axis of what is finite, each as often as it was drawn."""
    weight = np.where(np.isfinite(values), often, 0)
    total = weight.sum(axis=-1)
    summed = (weight * np.where(np.isfinite(values), values, 0.0)).sum(axis=-1)
    found: F64 = np.where(total > 0, summed / np.maximum(total, 1), np.nan)
    return found


def interval_of(values: F64) -> correlate.Interval:
    """The first value that ``picked`` gives, and the percentiles of the others."""
    return correlate.interval(float(values[0]), values[1:])


def handmade(name: str) -> bool:
    """Whether people made a placement: Table 7, the same with azimuths out of step, those with low corners, counts."""
    return not name.startswith(("best-", "random-"))


def optima_of(given: Gathered, score: str) -> list[str]:
    """Names of the placements in the mount that were searched with a score."""
    of_engine, of_pool = f"best-{score}-", f"best-pool-{'gain' if score == 'information_gain' else score}-box"
    return [x.name for x in given.layouts if x.pool == "box" and (x.name.startswith(of_engine) or x.name == of_pool)]


def optima(given: Gathered, kept: Bools, lost: F64, metrics: list[str]) -> dict[str, Any]:
    """How the optima of each score that was searched with do against the published optimum and the best by hand.

    ``lost`` is ``[seeds, placements, scenes]``.
    """
    names = [layout.name for layout, keep in zip(given.layouts, kept) if keep]
    hand = [k for k, name in enumerate(names) if handmade(name)]
    if PUBLISHED not in names or not hand:
        return {}
    ours = names.index(PUBLISHED)
    usual = [names.index(name) for name in optima_of(given, DEFAULT) if name in names]
    least = _best(-lost, hand)
    found: dict[str, Any] = {}
    for score in given.scores:
        rows = [names.index(name) for name in optima_of(given, score) if name in names]
        if not rows:
            continue
        found[score] = {"placements": [names[k] for k in rows], "less_regret_than": {}, "metrics": {}}
        for other in dict.fromkeys((ours, least)):
            less = lost[:, other] - mean(lost[:, rows], 1)
            found[score]["less_regret_than"][names[other]] = asdict(over_scenes(less))
        if usual and score != DEFAULT:
            less = mean(lost[:, usual], 1) - mean(lost[:, rows], 1)
            found[score]["less_regret_than"][f"optima of {DEFAULT}"] = asdict(over_scenes(less))
        for metric in metrics:
            table = given.metrics[metric][:, kept]
            found[score]["metrics"][metric] = {
                f"minus {names[other]}": asdict(over_scenes(mean(table[:, rows], 1) - table[:, other]))
                for other in dict.fromkeys((ours, _best(table, hand)))
            }
    return found


def _best(table: F64, among: list[int]) -> int:
    """The placement of ``among`` with the highest mean over seeds and scenes of ``[seeds, placements, scenes]``."""
    return among[int(np.nanargmax(mean(mean(table, 0)[among], 1)))]


def _verdict(given: Gathered, kept: Bools, by_score: dict[str, Any], lost: F64) -> dict[str, Any]:
    ranked = sorted((s for s in by_score if s not in NULL), key=lambda s: by_score[s]["mean"]["value"])
    winner = ranked[0]
    names = [layout.name for layout, keep in zip(given.layouts, kept) if keep]
    hand = [k for k, name in enumerate(names) if handmade(name)]
    rows = [names.index(name) for name in optima_of(given, winner) if name in names]
    # Where nothing beats what people made, the engine keeps what loses least of what it can maximize.
    said: dict[str, Any] = {
        "least_mean_regret": winner,
        "order": ranked,
        "least_of_engine": next((score for score in ranked if score in OBJECTIVES), None),
    }
    if not hand:
        return said
    if not rows:
        return {**said, "becomes_default": False, "why": "it was not searched with"}
    best = _best(-lost, hand)
    less = over_scenes(lost[:, best] - mean(lost[:, rows], 1))
    why = f"its optima lose {_in_words(less)} than {names[best]}, the best by hand"
    return {**said, "becomes_default": bool(less.low > 0), "why": why}


def _in_words(less: correlate.Interval) -> str:
    """A loss less than another, with its interval: what is below 0 is so much more."""
    numbers, word = (less.value, less.low, less.high), "less"
    if less.value < 0:
        numbers, word = (-less.value, -less.high, -less.low), "more"
    value, low, high = (f"{number:.2f}".replace("-", "−") for number in numbers)
    return f"{value} [{low} {high}] {word}"


def over_scenes(values: F64) -> correlate.Interval:
    """Mean of ``[scenes]`` or ``[seeds, scenes]`` over both, with its interval: scenes are drawn, then seeds in each."""
    values = np.atleast_2d(values)
    values = values[:, np.isfinite(values).any(axis=0)]
    if not values.size:
        return correlate.Interval(float("nan"), float("nan"), float("nan"))
    seeds, scenes = _slots(*values.shape)
    drawn = mean(mean(values[seeds, scenes], 2), 1)
    return correlate.interval(float(mean(mean(values, 0), 0)), drawn)


@functools.lru_cache(maxsize=16)
def _slots(seeds: int, scenes: int) -> tuple[I64, I64]:
    """Numbers of seeds ``[draws, scenes, seeds]`` and of the scenes ``[draws, scenes, 1]`` that they are drawn in."""
    rng = np.random.default_rng(SEED)
    among = rng.integers(0, scenes, (DRAWS, scenes, 1))
    return rng.integers(0, seeds, (DRAWS, scenes, seeds)), among


def paired(given: Gathered, metric: str, one: str, other: str) -> correlate.Interval:
    """A placement's metric less another's, paired over scenes and seeds; ``NaN`` where one is missing."""
    rows = [given.number(name) for name in (one, other)]
    if rows[0] is None or rows[1] is None:
        return correlate.Interval(float("nan"), float("nan"), float("nan"))
    table = given.metrics[metric]
    return over_scenes(table[:, rows[0]] - table[:, rows[1]])
