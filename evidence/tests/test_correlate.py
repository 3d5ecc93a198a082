"""Correlations against SciPy and closed forms; intervals that hold what they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

pytest.importorskip("sklearn")
from sightline_evidence import correlate


def test_spearman_is_scipys_and_leaves_nan_out() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        x = rng.integers(0, 6, 20).astype(float)
        y = x + rng.normal(0, 2, 20)
        assert correlate.spearman(x, y) == pytest.approx(stats.spearmanr(x, y).statistic, abs=1e-12)
        with_gap = np.append(x, np.nan), np.append(y, 3.0)
        assert correlate.spearman(*with_gap) == pytest.approx(correlate.spearman(x, y))
    assert np.isnan(correlate.spearman(np.ones(5), np.arange(5.0)))


def test_partial_is_the_formula_of_three_correlations() -> None:
    rng = np.random.default_rng(1)
    given = rng.normal(size=40)
    x, y = given + rng.normal(size=40), given + rng.normal(size=40)
    xy, xz, yz = (correlate.spearman(a, b) for a, b in ((x, y), (x, given), (y, given)))
    expected = (xy - xz * yz) / np.sqrt((1 - xz**2) * (1 - yz**2))
    assert correlate.partial(x, y, given) == pytest.approx(expected, abs=1e-12)
    assert np.isnan(correlate.partial(given, y, given))


def test_interval_holds_the_truth_as_often_as_it_says() -> None:
    """Ranks of two normals with correlation .6 have ρ = 6/π·asin(.3)."""
    rng = np.random.default_rng(2)
    truth = 6 / np.pi * np.arcsin(0.3)
    held = 0
    for _ in range(60):
        x = rng.normal(size=(40, 1))
        y = 0.6 * x + 0.8 * rng.normal(size=(40, 1))
        drawn = correlate.Drawn.of(rng, 40, 1, 200)
        found = correlate.spearman_interval(x, y, drawn)
        assert found.low <= found.value <= found.high
        held += found.low <= truth <= found.high
    assert 49 <= held <= 60


def test_scenes_widen_the_interval() -> None:
    rng = np.random.default_rng(3)
    score = np.repeat(rng.normal(size=(30, 1)), 6, axis=1)
    sign = np.array([1, 1, 1, 1, -1, -1.0])
    metric = score * sign + 0.1 * rng.normal(size=(30, 6))
    placements = correlate.Drawn.of(rng, 30, 6, 300)
    fixed = correlate.Drawn(placements.placements, np.ones((300, 6), np.int64))
    wide, narrow = (correlate.spearman_interval(score, metric, d) for d in (placements, fixed))
    assert wide.high - wide.low > 2 * (narrow.high - narrow.low)


def test_interval_by_a_loop() -> None:
    rng = np.random.default_rng(5)
    score, metric = rng.normal(size=(2, 12, 4))
    metric[:, 2] = np.nan
    metric[3, 0] = np.nan
    drawn = correlate.Drawn.of(rng, 12, 4, 200)
    values = []
    for chosen, often in zip(drawn.placements, drawn.scenes, strict=True):
        scenes = np.repeat(np.arange(4), often)
        if set(scenes) == {2}:
            continue
        means = [np.array([np.nanmean(t[p, scenes]) if np.isfinite(t[p, scenes]).any() else np.nan for p in chosen]) for t in (score, metric)]
        if np.isfinite(means[1]).all():
            values.append(stats.spearmanr(*means).statistic)
    found = correlate.spearman_interval(score, metric, drawn)
    # Draws in which a placement has no value at all are left out by both.
    np.testing.assert_allclose([found.low, found.high], np.percentile(values, [2.5, 97.5]), atol=1e-12)


def test_intervals_of_pearson_and_partial_by_a_loop() -> None:
    rng = np.random.default_rng(6)
    given = rng.normal(size=(12, 4))
    score, metric = given + rng.normal(size=(2, 12, 4))
    drawn = correlate.Drawn.of(rng, 12, 4, 100)
    of = [correlate.Means.of(table, drawn) for table in (score, metric, given)]
    linear, partial = [], []
    for chosen, often in zip(drawn.placements, drawn.scenes, strict=True):
        x, y, z = (np.average(table, axis=1, weights=often)[chosen] for table in (score, metric, given))
        linear.append(stats.pearsonr(x, y).statistic)
        partial.append(correlate.partial(x, y, z))
    for found, values in ((correlate.pearson_of(*of[:2]), linear), (correlate.partial_of(*of), partial)):
        np.testing.assert_allclose([found.low, found.high], np.nanpercentile(values, [2.5, 97.5]), atol=1e-9)
    x, y, z = (table.mean(axis=1) for table in (score, metric, given))
    assert correlate.partial_of(*of).value == correlate.partial(x, y, z)
    assert np.isnan(correlate.partial_of(of[2], of[1], of[2]).low)


def test_ceiling_of_known_noise() -> None:
    """Two seeds with as much noise as signal: reliability of their mean is 2/3 by variance."""
    rng = np.random.default_rng(4)
    signal = rng.normal(size=20_000)
    seeds = signal + rng.normal(size=(2, 20_000))
    reached = correlate.spearman(signal, seeds.mean(axis=0))
    assert correlate.noise_ceiling(seeds) == pytest.approx(reached, abs=0.02)
    assert correlate.noise_ceiling(np.array([signal, signal])) == pytest.approx(1)
    assert np.isnan(correlate.noise_ceiling(seeds[:1]))
