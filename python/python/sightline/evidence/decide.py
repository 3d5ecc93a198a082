"""Which score a search should follow: the rule of the study, fixed before its result and applied without a look."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from . import correlate
from ._types import F64, Bools
from .gathered import Gathered, mean
from .plan import OBJECTIVES
from .trial import METRICS

#: Seed of all bootstraps.
SEED = 11

#: What is decided on: every metric on fixed targets, of every learner.
DECIDING = (
    *(metric for metric in METRICS if not metric.startswith("own_")),
    "unet_birds_eye_miou",
    "unet_centre_recall",
)

#: The same by what they are about, for a reader; the rule takes all alike.
ABOUT = {
    "recognized": ("voxel_miou", "voxel_1m_miou", "birds_eye_miou", "unet_birds_eye_miou"),
    "objects": ("objects_5", "objects_20", "unet_centre_recall"),
    "near ground": ("ground_seen_3m", "ground_seen_10m"),
}

#: Scores that no search would follow: null models, and the sums of which others are made.
NULL = ("hits", "mean_height", "shuffled", "covered")

#: What regrets are compared with: the default of ``optimize`` until these studies.
GAIN = "information_gain"

#: What the optima of other scores are compared with, too: the default of ``optimize`` since.
DEFAULT = OBJECTIVES[0]

#: The best published optimum.
PUBLISHED = "Ours-seg"


def of(given: Gathered, kept: Bools) -> dict[str, Any]:
    """Regret of each score over metrics, of each placement, and what the rule says, among placements ``kept``."""
    metrics = [m for m in DECIDING if m in given.metrics and np.isfinite(given.mean(m)[kept]).all(axis=1).mean() > 0.8]
    each = {m: regrets(given.mean(m)[kept]) for m in metrics}
    # [placements, scenes]
    lost = mean(np.stack(list(each.values())), 0)
    layouts = [layout for layout, keep in zip(given.layouts, kept) if keep]
    by_score = {}
    losses = {s: np.stack([picked_regret(v[kept], one) for one in each.values()]) for s, v in given.scores.items()}
    for score, picked in losses.items():
        by_gain = losses.get(GAIN, picked)
        by_score[score] = {
            "less_than_gain": asdict(over_scenes(mean(by_gain - picked, 0))),
            "mean": asdict(over_scenes(mean(picked, 0))),
            "about": {
                name: asdict(over_scenes(mean(picked[[m in group for m in metrics]], 0))) for name, group in ABOUT.items()
            },
            "by_metric": {m: asdict(over_scenes(row)) for m, row in zip(each, picked)},
        }
    placements = {
        layout.name: {"mean": asdict(over_scenes(row)), "by_metric": {m: float(mean(each[m][k], 0)) for m in each}}
        for k, (layout, row) in enumerate(zip(layouts, lost))
    }
    found = {"metrics": metrics, "scores": by_score, "placements": placements}
    return {**found, "optima": _optima(given, kept, lost, each), "verdict": _verdict(given, kept, by_score, lost)}


def regrets(metric: F64) -> F64:
    """(best − each) / (best − mean) of ``[placements, scenes]``: 0 the best, 1 a random one; ``NaN`` if all are one."""
    best, middle = np.nanmax(metric, axis=0), mean(metric, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        found: F64 = np.where(best > middle, (best - metric) / (best - middle), np.nan)
    return found


def picked_regret(score: F64, regret: F64) -> F64:
    """Regret ``[scenes]`` of the placement that a score puts first in each; a mean over those that are equally first."""
    best = np.nanmax(np.where(np.isfinite(score), score, -np.inf), axis=0)
    return mean(np.where(score == best, regret, np.nan), 0)


def handmade(name: str) -> bool:
    """Whether people made a placement: Table 7, the same with azimuths out of step, those with low corners, counts."""
    return not name.startswith(("best-", "random-"))


def optima_of(given: Gathered, score: str) -> list[str]:
    """Names of the placements in the mount that were searched with a score."""
    of_engine, of_pool = f"best-{score}-", f"best-pool-{'gain' if score == 'information_gain' else score}-box"
    return [x.name for x in given.layouts if x.pool == "box" and (x.name.startswith(of_engine) or x.name == of_pool)]


def _optima(given: Gathered, kept: Bools, lost: F64, each: dict[str, F64]) -> dict[str, Any]:
    """Of each score that was searched with: how its optima do against the published optimum and the best by hand."""
    names = [layout.name for layout, keep in zip(given.layouts, kept) if keep]
    hand = [k for k, name in enumerate(names) if handmade(name)]
    if PUBLISHED not in names or not hand:
        return {}
    ours = names.index(PUBLISHED)
    usual = [names.index(name) for name in optima_of(given, DEFAULT) if name in names]
    least = hand[int(np.nanargmin(mean(lost[hand], 1)))]
    found: dict[str, Any] = {}
    for score in given.scores:
        rows = [names.index(name) for name in optima_of(given, score) if name in names]
        if not rows:
            continue
        found[score] = {"placements": [names[k] for k in rows], "less_regret_than": {}, "metrics": {}}
        for other in dict.fromkeys((ours, least)):
            less = lost[other] - mean(lost[rows], 0)
            found[score]["less_regret_than"][names[other]] = asdict(over_scenes(less))
        if usual and score != DEFAULT:
            less = mean(lost[usual], 0) - mean(lost[rows], 0)
            found[score]["less_regret_than"][f"optima of {DEFAULT}"] = asdict(over_scenes(less))
        for metric in each:
            table = given.mean(metric)[kept]
            best = hand[int(np.nanargmax(mean(table[hand], 1)))]
            found[score]["metrics"][metric] = {
                f"minus {names[other]}": asdict(over_scenes(mean(table[rows], 0) - table[other]))
                for other in dict.fromkeys((ours, best))
            }
    return found


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
    best = hand[int(np.nanargmin(mean(lost[hand], 1)))]
    less = over_scenes(lost[best] - mean(lost[rows], 0))
    shown = f"{less.value:.2f} [{less.low:.2f} {less.high:.2f}]".replace("-", "−")
    why = f"its optima lose {shown} less than {names[best]}, the best by hand"
    return {**said, "becomes_default": bool(less.low > 0), "why": why}


def over_scenes(values: F64) -> correlate.Interval:
    """Mean of ``[scenes]`` with its interval over scenes drawn with replacement."""
    there = values[np.isfinite(values)]
    if not there.size:
        return correlate.Interval(float("nan"), float("nan"), float("nan"))
    drawn = np.random.default_rng(SEED).choice(there, (correlate.DRAWS, there.size)).mean(axis=1)
    low, high = np.percentile(drawn, [2.5, 97.5])
    return correlate.Interval(float(there.mean()), float(low), float(high))


def paired(given: Gathered, metric: str, one: str, other: str) -> correlate.Interval:
    """A placement's metric less another's, paired over scenes; ``NaN`` where one is missing."""
    rows = [given.number(name) for name in (one, other)]
    if rows[0] is None or rows[1] is None:
        return correlate.Interval(float("nan"), float("nan"), float("nan"))
    table = given.mean(metric)
    return over_scenes(table[rows[0]] - table[rows[1]])
