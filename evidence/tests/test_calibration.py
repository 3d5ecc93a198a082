"""ECE against torchmetrics on random inputs, and in closed form."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("sklearn")
from sightline_evidence.metrics.calibration import BINS, calibration


def test_against_torchmetrics() -> None:
    torch = pytest.importorskip("torch", reason="torch is not installed")
    classification = pytest.importorskip("torchmetrics.classification", reason="torchmetrics is not installed")
    for seed in range(100):
        rng = np.random.default_rng(seed)
        probabilities = rng.dirichlet(np.full(10, rng.choice([0.2, 1.0])), 400).astype(np.float32)
        truth = rng.integers(0, 10, 400)
        metric = classification.MulticlassCalibrationError(10, n_bins=BINS, norm="l1")
        theirs = float(metric(torch.as_tensor(probabilities), torch.as_tensor(truth)))
        ours = calibration(probabilities.max(axis=1), probabilities.argmax(axis=1) == truth)
        assert ours.bins == 15
        assert ours.error == pytest.approx(theirs, abs=1e-6)  # theirs adds in f32


def test_a_bin_by_hand() -> None:
    found = calibration(np.array([0.8, 0.8, 0.8, 0.8, 1.0]), np.array([True, True, False, False, True]), bins=5)
    assert found.error == pytest.approx(4 / 5 * 0.3)
    # The upper edge belongs to a bin: 0.8 is in the fourth of (0.6, 0.8].
    assert list(found.count) == [0, 0, 0, 4, 1]


def test_bad_confidences_are_refused() -> None:
    with pytest.raises(ValueError, match="0 to 1"):
        calibration(np.array([1.2]), np.array([True]))
    with pytest.raises(ValueError, match="0 to 1"):
        calibration(np.array([np.nan]), np.array([True]))
    with pytest.raises(ValueError, match="one or more"):
        calibration(np.zeros(0), np.zeros(0, bool))
