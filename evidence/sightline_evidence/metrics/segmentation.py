"""Confusion and mIoU by the two public rules, which differ where classes are absent or ignored."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from sklearn.metrics import confusion_matrix

from .._types import F64, I64, Ints


def confusion(truth: Ints, predicted: Ints, classes: int) -> I64:
    """Counts ``[truth, predicted]`` of labels ``[P]`` from 0 to ``classes`` − 1."""
    for name, labels in (("truth", truth), ("predicted", predicted)):
        if labels.size and not 0 <= labels.min() <= labels.max() < classes:
            raise ValueError(f"{name}: holds labels beyond 0 to {classes - 1}; map them to groups first")
    if truth.shape != predicted.shape:
        raise ValueError(
            f"truth has the shape {truth.shape}, predicted {predicted.shape}; give a label for each"
        )
    if not truth.size:
        return np.zeros((classes, classes), np.int64)
    counts: I64 = confusion_matrix(truth, predicted, labels=np.arange(classes)).astype(np.int64)
    return counts


@dataclass(frozen=True)
class Iou:
    """Intersection over union by class ``[C]``, ``NaN`` where the rule leaves a class out, and their mean."""

    rule: str
    by_class: F64
    mean: float


def semantickitti(counts: I64, ignore: int = 0) -> Iou:
    """mIoU of ``np_ioueval.py``: ignored truth does not count, ignored predictions do, as misses.

    IoU = TP/(TP + FP + FN + 1e-15); a class that is neither there nor predicted counts as 0 in the mean.
    """
    kept = counts.copy()
    kept[ignore] = 0
    hits = np.diagonal(kept)
    union = kept.sum(axis=0) + kept.sum(axis=1) - hits
    by_class = hits / (union + 1e-15)
    by_class[ignore] = np.nan
    return Iou("semantickitti", by_class, float(np.nanmean(by_class)))


def nuscenes(counts: I64, ignore: int = 0) -> Iou:
    """mIoU of nuScenes-lidarseg: ignored truth and predictions do not count, absent classes are left out.

    The devkit's union is rounded to ``f32``, which tells from 2²⁴ points on; ours is not.
    """
    kept = counts.copy()
    kept[ignore] = 0
    kept[:, ignore] = 0
    return _present(kept, "nuscenes")


def fixed(counts: I64) -> Iou:
    """mIoU on fixed targets: label 0 as prediction means "not seen" and counts as a miss; absent classes are left out.

    Nothing may be ignored here, or a placement would be tested on what it sees.
    """
    kept = counts.copy()
    kept[0] = 0
    found = _present(kept, "fixed targets")
    found.by_class[0] = np.nan
    there = found.by_class[1:]
    return Iou(found.rule, found.by_class, float(np.nanmean(there)) if np.any(~np.isnan(there)) else np.nan)


def _present(kept: I64, rule: str) -> Iou:
    hits = np.diagonal(kept)
    union = kept.sum(axis=0) + kept.sum(axis=1) - hits
    with np.errstate(divide="ignore", invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        by_class = hits / union.astype(np.float64)
        return Iou(rule, by_class, float(np.nanmean(by_class)))
