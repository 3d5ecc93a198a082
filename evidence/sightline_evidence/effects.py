"""Other findings of a study: height, spread and roll; other LiDARs; whether learners agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from scipy import stats

from . import correlate, decide
from ._types import F64
from .decide import SEED
from .designs import KINDS
from .gathered import Gathered, mean
from .layouts import Layout
from .worlds import OWN

#: Numbers that describe a placement of four in the mount, in the order of ``described``.
QUANTITIES = ("mean_height", "spread_of_heights", "spread_in_plan", "mean_roll")


def of(given: Gathered) -> dict[str, Any]:
    """Effects of poses in the mount, and of other LiDARs on the published optimum."""
    parts: dict[str, Callable[[Gathered], dict[str, Any]]] = {
        "poses": _poses,
        "sensors": lambda given: _less_published(given, "sensor"),
        "low": lambda given: _less_published(given, "mixed"),
        "phases": _phases,
        "needed": _needed,
        "to_win": _to_win,
        "places": _places,
    }
    return {name: part(given) for name, part in parts.items()}


def described(layout: Layout) -> list[float]:
    """``QUANTITIES`` of a placement: metres, metres, metres, radians (of its size, without sign)."""
    poses = layout.poses
    plan = np.hypot(poses[:, 0].std(), poses[:, 1].std())
    return [poses[:, 2].mean(), poses[:, 2].std(), float(plan), float(np.abs(poses[:, 3]).mean())]


def _poses(given: Gathered) -> dict[str, Any]:
    """Standardized coefficients of a linear regression of each metric, with intervals over placements."""
    kept = given.pool("box")
    told = np.array([described(layout) for layout, keep in zip(given.layouts, kept) if keep]).reshape(-1, len(QUANTITIES))
    if len(told) < 4 * len(QUANTITIES):
        return {}
    rng = np.random.default_rng(SEED)
    drawn = [rng.integers(0, len(told), len(told)) for _ in range(500)]
    found: dict[str, Any] = {}
    for metric in given.metrics:
        values = mean(given.mean(metric)[kept], 1)
        if not np.isfinite(values).all():
            continue
        each = np.array([_coefficients(told[rows], values[rows]) for rows in drawn])
        low, high = np.nanpercentile(each, [2.5, 97.5], axis=0)
        found[metric] = {
            name: {"value": float(v), "low": float(a), "high": float(b)}
            for name, v, a, b in zip(QUANTITIES, _coefficients(told, values), low, high)
        }
    return found


def _coefficients(told: F64, values: F64) -> F64:
    spread = np.r_[told.std(axis=0), values.std()]
    if np.any(spread == 0):
        return np.full(told.shape[1], np.nan)
    design = np.c_[np.ones(len(told)), (told - told.mean(axis=0)) / spread[:-1]]
    found: F64 = np.linalg.lstsq(design, (values - values.mean()) / spread[-1], rcond=None)[0][1:]
    return found


def _less_published(given: Gathered, pool: str) -> dict[str, Any]:
    """Each placement of a pool less the published optimum, paired over scenes."""
    names = [layout.name for layout in given.layouts if layout.pool == pool]
    rows = [given.place(name) for name in names]
    metrics = [m for m in decide.DECIDING if m in given.metrics and np.isfinite(given.mean(m)[rows]).any(axis=1).all()]
    return {name: {m: asdict(decide.paired(given, m, name, decide.PUBLISHED)) for m in metrics} for name in names}


def _phases(given: Gathered) -> dict[str, Any]:
    """Layouts whose LiDARs share azimuths: a quarter of a step apart less in step, paired over scenes."""
    names = [layout.name for layout in given.layouts]
    bases = [name.removesuffix("-in-step") for name in names if name.endswith("-in-step")]
    return {
        base: {m: asdict(decide.paired(given, m, f"{base}-staggered", f"{base}-in-step")) for m in decide.DECIDING if m in given.metrics}
        for base in bases
        if f"{base}-staggered" in names
    }


#: A difference worth seeing, as it is between optima of one mount.
DIFFERENCE = 0.01


def _needed(given: Gathered) -> dict[str, Any]:
    """Scenes that tell two placements of four in the mount apart by ``DIFFERENCE`` (80 % power, two-sided 5 %).

    From the median over all pairs of the spread of their difference between scenes.
    """
    kept = given.pool("box")
    if kept.sum() < 2 or len(given.scenes) < 3:
        return {}
    found = {}
    for metric in decide.DECIDING:
        table = given.mean(metric)[kept] if metric in given.metrics else np.zeros((0, 0))
        spread = [np.nanstd(a - b, ddof=1) for k, a in enumerate(table) for b in table[:k] if np.isfinite(a - b).sum() > 2]
        if spread:
            middle = float(np.median(spread))
            found[metric] = {"spread": middle, "scenes": float(np.ceil((2.8 * middle / DIFFERENCE) ** 2))}
    return found


def _to_win(given: Gathered) -> dict[str, Any]:
    """Gain of the best placement in the mount over the published optimum.

    Each metric takes the placement that is best by the first seed, and the other seeds judge it. The scenes are the
    ones it was picked in, so the gain is told too high rather than too low.
    """
    box, ours = given.pool("box"), given.number(decide.PUBLISHED)
    if ours is None or box.sum() < 4 or len(given.seeds) < 2:
        return {}
    best = {}
    for metric in (m for m in decide.DECIDING if m in given.metrics):
        by_seed = given.metrics[metric]
        if len(by_seed) < 2 or not np.isfinite(by_seed[1:, box]).any():
            continue
        chosen = int(np.flatnonzero(box)[np.nanargmax(mean(by_seed[0, box], 1))])
        others = by_seed[1:]
        best[metric] = {**asdict(decide.over_scenes(others[:, chosen] - others[:, ours])), "placement": given.layouts[chosen].name}
    return {"the best of those in the mount": best} if best else {}


def _places(given: Gathered) -> dict[str, Any]:
    """Regret of scores and of their optima, four in the mount, in scenes of each origin by themselves, if there are several."""
    origins = dict.fromkeys(_origin(scene) for scene in given.scenes)
    kept, found = given.pool("box"), {}
    for origin in origins if len(origins) > 1 and kept.sum() >= 4 else ():
        rows = [k for k, scene in enumerate(given.scenes) if _origin(scene) == origin]
        metrics = {m: values[:, :, rows] for m, values in given.metrics.items()}
        scores = {s: values[:, rows] for s, values in given.scores.items()}
        there = replace(given, scenes=[given.scenes[k] for k in rows], metrics=metrics, scores=scores)
        regret = decide.of(there, kept)
        found[origin] = {
            "scenes": there.scenes,
            "regret": {score: of["mean"] for score, of in regret["scores"].items()},
            "less_than_gain": {score: of["less_than_gain"] for score, of in regret["scores"].items()},
            "optima": {s: of["less_regret_than"].get(decide.PUBLISHED) for s, of in regret["optima"].items()},
        }
    return found


def _origin(scene: str) -> str:
    """Where a scene comes from, by its name."""
    if scene in OWN:
        return "own"
    return "generated" if scene.rpartition("-")[0] in KINDS else "on OpenDRIVE maps"


def agreement(given: Gathered) -> dict[str, Any]:
    """Spearman of the bird's-eye mIoU of the trees with the metrics of each other learner, with intervals."""
    found = {}
    for parts in (("box",), ("box", "mixed", "number", "sensor")):
        for metric in given.metrics:
            both = given.pool(*parts) & np.isfinite(given.mean(metric)).any(axis=1)
            if not metric.startswith("unet_") or both.sum() < 4:
                continue
            ours, theirs = given.mean("birds_eye_miou")[both], given.mean(metric)[both]
            drawn = correlate.Drawn.of(np.random.default_rng(SEED), len(ours), len(given.scenes))
            rho = correlate.spearman_interval(ours, theirs, drawn)
            tau = stats.kendalltau(mean(ours, 1), mean(theirs, 1))[0]
            found[f"{metric}, {'+'.join(parts)}"] = {**asdict(rho), "kendall": float(tau), "of": len(ours)}
    return found
