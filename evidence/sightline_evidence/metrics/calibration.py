"""Expected calibration error of Guo 2017, the number of bins said."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._types import F64, I64, Bools, Floats

#: Bins where nobody says otherwise: those of torchmetrics.
BINS = 15


@dataclass(frozen=True)
class Calibration:
    """Σ |B|/n · |accuracy − confidence| over ``bins`` bins of equal width, and each bin's numbers ``[bins]``."""

    bins: int
    error: float
    count: I64
    confidence: F64
    accuracy: F64


def calibration(confidence: Floats, correct: Bools, bins: int = BINS) -> Calibration:
    """Calibration of the largest probabilities ``[P]``, with whether they were right ``[P]``; bins are (lower, upper].

    torchmetrics takes [lower, upper) and adds in ``f32``: the same but for confidences on a bin's very edge.
    """
    if len(confidence) != len(correct) or not len(confidence):
        raise ValueError(
            f"confidence and correct: have {len(confidence)} and {len(correct)} entries; give one or more of both"
        )
    if not (np.all(confidence >= 0) and np.all(confidence <= 1)):
        raise ValueError("confidence: leaves 0 to 1; give probabilities")
    place = np.clip(np.ceil(confidence * bins).astype(np.int64) - 1, 0, bins - 1)
    count = np.bincount(place, minlength=bins)
    safe = np.maximum(count, 1)
    mean_confidence = np.bincount(place, weights=confidence, minlength=bins) / safe
    accuracy = np.bincount(place, weights=correct, minlength=bins) / safe
    error = float(np.sum(count * np.abs(accuracy - mean_confidence)) / len(confidence))
    return Calibration(bins, error, count, mean_confidence, accuracy)
