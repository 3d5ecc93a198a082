"""Boosted trees learn the small world, repeat themselves, and learn nothing from shuffled labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
import sightline
from sightline_evidence.groups import GROUPS, groups_of
from sightline_evidence.learners import trees
from sightline_evidence.metrics import segmentation

FEW = trees.Settings(rounds=10, points=8000)


@pytest.fixture(scope="module")
def frames(small_file: Path, published: list[sightline.Placement]) -> list[tuple[np.ndarray, np.ndarray]]:
    scene = sightline.Scene.load(small_file, backend="cpu")
    scans = scene.scan(published[0], seed=1)
    return [(trees.features(scan.xyz), groups_of(scan.classes, scan.class_id)) for scan in scans]


def quality(trained: trees.Trees, frame: tuple[np.ndarray, np.ndarray]) -> float:
    predicted, _ = trained.predict(frame[0])
    return segmentation.nuscenes(segmentation.confusion(frame[1], predicted, len(GROUPS))).mean


def test_learns_and_repeats_itself(frames: list[tuple[np.ndarray, np.ndarray]]) -> None:
    trained = trees.train(*frames[0], seed=3, settings=FEW)
    assert quality(trained, frames[2]) > 0.6
    assert trained.curve[-1] < 0.5 * trained.curve[0]
    again, other = (trees.train(*frames[0], seed=seed, settings=FEW) for seed in (3, 4))
    np.testing.assert_array_equal(trained.predict(frames[2][0])[1], again.predict(frames[2][0])[1])
    assert np.any(trained.predict(frames[2][0])[1] != other.predict(frames[2][0])[1])


def test_shuffled_labels_are_chance(frames: list[tuple[np.ndarray, np.ndarray]]) -> None:
    described, labels = frames[0]
    shuffled = np.random.default_rng(0).permutation(labels)
    trained = trees.train(described, shuffled, seed=3, settings=FEW)
    truth = frames[2][1]
    commonest = np.full(len(truth), np.bincount(truth).argmax())
    chance = segmentation.nuscenes(segmentation.confusion(truth, commonest, len(GROUPS))).mean
    assert quality(trained, frames[2]) < chance + 0.05


def test_features_do_not_know_the_order_of_points() -> None:
    rng = np.random.default_rng(2)
    xyz = rng.normal(0, 5, (500, 3))
    order = rng.permutation(500)
    np.testing.assert_allclose(trees.features(xyz)[order], trees.features(xyz[order]), atol=1e-5)


def test_a_plane_is_flat_and_a_line_is_thin() -> None:
    x, y = np.meshgrid(np.arange(20) * 0.1, np.arange(20) * 0.1)
    plane = trees.features(np.c_[x.ravel(), y.ravel(), np.zeros(400)])
    inner = plane[210]
    assert inner[4] > 0.7 and inner[5] < 1e-3 and inner[6] == pytest.approx(1)
    line = trees.features(np.c_[np.zeros(50), np.zeros(50), np.arange(50) * 0.1])[25]
    assert line[3] == pytest.approx(1) and line[6] == pytest.approx(0, abs=1e-6)


def test_few_points_and_one_group() -> None:
    assert trees.features(np.zeros((0, 3))).shape[0] == 0
    assert np.all(np.isfinite(trees.features(np.zeros((3, 3)))))
    assert trees.features(np.zeros((3, 3))).shape[1] == trees.features(np.zeros((0, 3))).shape[1]
    with pytest.raises(ValueError, match="needs two"):
        trees.train(np.zeros((10, 4), np.float32), np.ones(10, np.uint8), 0, FEW)
