"""mIoU by both rules against the devkit, torchmetrics and the arithmetic of np_ioueval.py, on random labels."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("sklearn")
from sightline_evidence.metrics import segmentation

CLASSES = 11


def pairs(count: int = 200) -> list[tuple[np.ndarray, np.ndarray]]:
    """Random labels, every third time without some classes."""
    drawn = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        classes = CLASSES if seed % 3 else 6
        truth = rng.integers(0, classes, 500)
        right = rng.random(500) < rng.random()
        drawn.append((truth, np.where(right, truth, rng.integers(0, classes, 500))))
    return drawn


def np_ioueval(truth: np.ndarray, predicted: np.ndarray) -> tuple[float, np.ndarray]:
    """SemanticKITTI's evaluation, by sets of points instead of a matrix; class 0 ignored."""
    valid = truth != 0
    ious = []
    for c in range(1, CLASSES):
        both = np.sum(valid & (truth == c) & (predicted == c))
        either = np.sum(valid & ((truth == c) | (predicted == c)))
        ious.append(both / (either + 1e-15))
    return float(np.mean(ious)), np.array(ious)


def test_semantickitti_rule() -> None:
    for truth, predicted in pairs():
        found = segmentation.semantickitti(segmentation.confusion(truth, predicted, CLASSES))
        mean, by_class = np_ioueval(truth, predicted)
        assert found.mean == pytest.approx(mean, abs=1e-14)
        np.testing.assert_allclose(found.by_class[1:], by_class, atol=1e-14)


def test_nuscenes_rule_is_the_devkits() -> None:
    utils = pytest.importorskip("nuscenes.eval.lidarseg.utils", reason="nuscenes-devkit is not installed")
    for truth, predicted in pairs():
        predicted = np.maximum(predicted, 1)  # the devkit refuses 0
        matrix = utils.ConfusionMatrix(CLASSES, 0)
        matrix.update(truth, predicted)
        found = segmentation.nuscenes(segmentation.confusion(truth, predicted, CLASSES))
        assert found.mean == matrix.get_mean_iou()
        np.testing.assert_array_equal(found.by_class, matrix.get_per_class_iou())


def test_both_rules_beside_torchmetrics() -> None:
    """Its "none" averages leave absent classes to us; by class it is SemanticKITTI's IoU with ignored truth."""
    torch = pytest.importorskip("torch", reason="torch is not installed")
    classification = pytest.importorskip("torchmetrics.classification", reason="torchmetrics is not installed")
    for truth, predicted in pairs(50):
        jaccard = classification.MulticlassJaccardIndex(CLASSES, average="none", ignore_index=0)
        theirs = jaccard(torch.as_tensor(predicted), torch.as_tensor(truth)).numpy()[1:]
        ours = segmentation.semantickitti(segmentation.confusion(truth, predicted, CLASSES)).by_class[1:]
        np.testing.assert_allclose(ours, theirs, atol=1e-6)  # theirs divides in f32


def test_rules_differ_by_absent_classes_only() -> None:
    truth = np.array([1, 1, 2, 2])
    counts = segmentation.confusion(truth, truth, 5)
    assert segmentation.nuscenes(counts).mean == 1.0
    assert segmentation.semantickitti(counts).mean == pytest.approx(0.5)
    assert segmentation.fixed(counts).mean == 1.0


def test_what_is_not_seen_is_wrong_on_fixed_targets() -> None:
    truth = np.array([1, 1, 1, 1, 2, 2])
    seen = np.array([1, 1, 0, 0, 2, 2])
    counts = segmentation.confusion(truth, seen, 3)
    assert segmentation.fixed(counts).mean == pytest.approx((0.5 + 1) / 2)
    # The published reading does not notice.
    assert segmentation.nuscenes(counts).mean == 1.0


def test_labels_beyond_the_classes_are_refused() -> None:
    with pytest.raises(ValueError, match="beyond 0 to 2"):
        segmentation.confusion(np.array([3]), np.array([0]), 3)
    assert segmentation.confusion(np.zeros(0, int), np.zeros(0, int), 3).sum() == 0
