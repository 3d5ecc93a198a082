"""How well a score predicts a metric: rank correlation with intervals, what height explains, noise, regret."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import stats

from ._types import F64, I64, Floats

#: Draws of a bootstrap.
DRAWS = 2000


@dataclass(frozen=True)
class Interval:
    """A number and the 2.5 and 97.5 percentiles of its bootstrap; ``NaN`` where nothing varies."""

    value: float
    low: float
    high: float


def spearman(x: Floats, y: Floats) -> float:
    """Rank correlation of ``[N]`` with ``[N]``; ``NaN`` where either does not vary or fewer than three are finite."""
    return _linear(*_ranks(x, y))


def pearson(x: Floats, y: Floats) -> float:
    """Linear correlation; ``NaN`` as of ``spearman``."""
    kept = np.isfinite(x) & np.isfinite(y)
    return _linear(x[kept], y[kept])


def partial(x: Floats, y: Floats, given: Floats) -> float:
    """Rank correlation of ``x`` and ``y`` once the ranks of ``given`` ``[N]`` are regressed out of both."""
    kept = np.isfinite(x) & np.isfinite(y) & np.isfinite(given)
    ranks = [stats.rankdata(values[kept]) for values in (x, y, given)]
    if len(ranks[0]) < 4 or any(np.ptp(r) == 0 for r in ranks):
        return float("nan")
    design = np.c_[np.ones(len(ranks[2])), ranks[2]]
    left, right = (r - design @ np.linalg.lstsq(design, r, rcond=None)[0] for r in ranks[:2])
    # Ranks that the given ones explain wholly leave rounding errors, which correlate with nothing.
    bound = 1e-9 * len(left)
    return _linear(left, right) if min(np.ptp(left), np.ptp(right)) > bound else float("nan")


def _ranks(x: Floats, y: Floats) -> tuple[F64, F64]:
    kept = np.isfinite(x) & np.isfinite(y)
    return stats.rankdata(x[kept]), stats.rankdata(y[kept])


def _linear(x: Floats, y: Floats) -> float:
    if len(x) < 3 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return float("nan")
    return float(stats.pearsonr(x, y)[0])


@dataclass(frozen=True)
class Drawn:
    """A bootstrap over placements and scenes, both drawn with replacement."""

    #: ``[draws, placements]``, numbers of placements.
    placements: I64
    #: ``[draws, scenes]``, how often each scene was drawn.
    scenes: I64

    @staticmethod
    def of(rng: np.random.Generator, placements: int, scenes: int, draws: int = DRAWS) -> Drawn:
        """As many draws."""
        often = rng.multinomial(scenes, np.full(scenes, 1 / scenes), draws)
        return Drawn(rng.integers(0, placements, (draws, placements)), often)


@dataclass(frozen=True)
class Means:
    """Means over scenes of a table ``[placements, scenes]``: as it is, and in each draw.

    A scene without a value (``NaN``) for a placement is left out of its mean; placements that have none are left out.
    """

    #: ``[placements]``.
    whole: F64
    #: ``[draws, placements]``, of the placements that were drawn.
    drawn: F64

    @staticmethod
    def of(table: F64, drawn: Drawn) -> Means:
        """Means of a table in these draws."""
        whole = _means(table, np.ones((1, table.shape[1]), np.int64))[0]
        return Means(whole, np.take_along_axis(_means(table, drawn.scenes), drawn.placements, axis=1))

    @cached_property
    def standard(self) -> F64:
        """``drawn``, each draw with a mean of 0 and a length of 1: products of two are correlations."""
        return _standard(self.drawn)

    @cached_property
    def ranks(self) -> F64:
        """``standard`` of the ranks of placements within each draw."""
        return _standard(stats.rankdata(self.drawn, axis=1, nan_policy="omit"))


def _standard(rows: F64) -> F64:
    moved = rows - rows.mean(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        # A draw that does not vary correlates with nothing; of its mean rounding errors may be left.
        found: F64 = np.where(np.ptp(rows, axis=1, keepdims=True) > 0, moved / np.linalg.norm(moved, axis=1, keepdims=True), np.nan)
    return found


def spearman_interval(score: F64, metric: F64, drawn: Drawn) -> Interval:
    """``spearman`` of the means over scenes, with its interval; ``[placements, scenes]`` both."""
    return spearman_of(Means.of(score, drawn), Means.of(metric, drawn))


def spearman_of(score: Means, metric: Means) -> Interval:
    """``spearman`` with its interval."""
    return interval(spearman(score.whole, metric.whole), _by_row(score.ranks, metric.ranks))


def pearson_of(score: Means, metric: Means) -> Interval:
    """``pearson`` with its interval."""
    return interval(pearson(score.whole, metric.whole), _by_row(score.standard, metric.standard))


def partial_of(score: Means, metric: Means, given: Means) -> Interval:
    """``partial`` with its interval, out of the three rank correlations of each draw."""
    xy, xz, yz = (_by_row(a.ranks, b.ranks) for a, b in ((score, metric), (score, given), (metric, given)))
    left = (1 - xz**2) * (1 - yz**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        # Ranks that the given ones explain wholly leave nothing but rounding errors.
        values = np.where(left > 1e-12, (xy - xz * yz) / np.sqrt(left), np.nan)
    return interval(partial(score.whole, metric.whole, given.whole), values)


def _by_row(x: F64, y: F64) -> F64:
    found: F64 = np.einsum("dp,dp->d", x, y)
    return found


def _means(table: F64, often: I64) -> F64:
    """Means ``[draws, placements]`` over scenes that count as ``often`` ``[draws, scenes]``."""
    there = np.isfinite(table)
    count = often @ there.T
    means: F64 = np.where(count > 0, (often @ np.where(there, table, 0.0).T) / np.maximum(count, 1), np.nan)
    return means


def interval(value: float, drawn: F64) -> Interval:
    """A number with the percentiles of what draws make of it."""
    finite = drawn[np.isfinite(drawn)]
    low, high = np.percentile(finite, [2.5, 97.5]) if finite.size else (np.nan, np.nan)
    return Interval(float(value), float(low), float(high))


def noise_ceiling(by_seed: F64) -> float:
    """Rank correlation that a perfect score could reach with a metric measured by these seeds, ``[seeds, placements]``.

    The mean over all splits of the seeds in two halves is stepped up to all seeds by Spearman–Brown, to the
    reliability r. With an odd number of seeds one half has one more, and the step up is a little too long. A score that
    knows the truth correlates with √r. ``NaN`` for one seed.
    """
    seeds = len(by_seed)
    if seeds < 2:
        return float("nan")
    halves = [
        [k for k in range(seeds) if bits >> k & 1]
        for bits in range(1, 2**seeds - 1)
        if bin(bits).count("1") == seeds // 2
    ]
    found = []
    for half in halves:
        rest = [k for k in range(seeds) if k not in half]
        found.append(spearman(by_seed[half].mean(axis=0), by_seed[rest].mean(axis=0)))
    rho = float(np.nanmean(found)) if np.isfinite(found).any() else float("nan")
    return float(np.sqrt(max(2 * rho / (1 + rho), 0.0))) if rho > -1 else float("nan")
