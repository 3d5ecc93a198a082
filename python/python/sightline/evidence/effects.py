"""What else a study tells: height, spread and roll; other LiDARs; whether learners agree."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from scipy import stats

from . import correlate, decide
from ._types import F64
from .decide import SEED
from .gathered import Gathered, mean
from .layouts import Layout

#: What describes a placement of four in the mount, in the order of ``described``.
QUANTITIES = ("mean_height", "spread_of_heights", "spread_in_plan", "mean_roll")


def of(given: Gathered) -> dict[str, Any]:
    """Effects of poses in the mount, and of other LiDARs on the published optimum."""
    return {"poses": _poses(given), "sensors": _sensors(given)}


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


def _sensors(given: Gathered) -> dict[str, Any]:
    """Each other LiDAR less the study's own at the same poses, paired over scenes."""
    names = [layout.name for layout in given.layouts if layout.pool == "sensor"]
    return {
        name: {m: asdict(decide.paired(given, m, name, decide.PUBLISHED)) for m in decide.DECIDING if m in given.metrics}
        for name in names
    }


def agreement(given: Gathered) -> dict[str, Any]:
    """Spearman of the bird's-eye mIoU of the trees with the metrics of each other learner, with intervals."""
    found = {}
    for parts in (("box",), ("box", "mixed", "number", "sensor")):
        kept = given.pool(*parts)
        ours = given.mean("birds_eye_miou")[kept]
        drawn = correlate.Drawn.of(np.random.default_rng(SEED), int(kept.sum()), len(given.scenes))
        for metric in given.metrics:
            theirs = given.mean(metric)[kept]
            both = np.isfinite(mean(ours, 1)) & np.isfinite(mean(theirs, 1))
            if metric.startswith("unet_") and both.sum() >= 4:
                rho = correlate.spearman_interval(ours, theirs, drawn)
                tau = stats.kendalltau(mean(ours, 1)[both], mean(theirs, 1)[both])[0]
                found[f"{metric}, {'+'.join(parts)}"] = {**asdict(rho), "kendall": float(tau), "of": int(both.sum())}
    return found
