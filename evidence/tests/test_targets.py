"""Fixed targets: voxels, the bird's-eye map, objects and blind ground, in closed form and by brute force."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("sklearn")
from sightline_evidence.grid import Grid, majority
from sightline_evidence.metrics import objects, segmentation, targets

GRID = Grid((-4.0, -4.0, -0.5), (0.5, 0.5, 0.5), (16, 16, 8))


def test_keys_are_numpys_order() -> None:
    keys = np.arange(16 * 16 * 8)
    np.testing.assert_array_equal(GRID.keys(GRID.centres(keys)), keys)
    outside = np.array([[4.0, 0, 0], [-4.01, 0, 0], [0, 0, 3.5]])
    np.testing.assert_array_equal(GRID.keys(outside), [-1, -1, -1])
    assert GRID.keys(np.array([[-4.0, -4.0, -0.5]]))[0] == 0
    assert Grid.of({"min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2] * 3}).shape == (400, 400, 30)


def test_majority_by_brute_force() -> None:
    rng = np.random.default_rng(3)
    keys, labels = rng.integers(-1, 30, 400), rng.integers(0, 5, 400).astype(np.uint8)
    found = dict(zip(*(part.tolist() for part in majority(keys, labels, 5)), strict=True))
    for key in range(30):
        counts = [np.sum((keys == key) & (labels == label)) for label in range(1, 5)]
        assert found.get(key) == (1 + int(np.argmax(counts)) if max(counts) else None)
    assert -1 not in found


def test_unseen_voxels_are_misses() -> None:
    truth_keys = np.array([3, 10, 700])
    xyz = GRID.centres(np.array([3, 3, 3, 700]))
    seen = targets.seen_as(GRID, truth_keys, xyz, np.array([2, 2, 1, 8], np.uint8))
    np.testing.assert_array_equal(seen, [2, 0, 8])
    nobody = targets.seen_as(GRID, truth_keys, np.zeros((0, 3)), np.zeros(0, np.uint8))
    np.testing.assert_array_equal(nobody, [0, 0, 0])


def test_reach_takes_the_nearest_by_brute_force() -> None:
    rng = np.random.default_rng(4)
    truth_keys = np.sort(rng.choice(16 * 16 * 8, 300, replace=False))
    xyz = rng.uniform([-4, -4, -0.5], [4, 4, 3.5], (60, 3))
    predicted = rng.integers(1, 11, 60).astype(np.uint8)
    seen = targets.seen_as(GRID, truth_keys, xyz, predicted, reach=1.0)
    keys, labels = majority(GRID.keys(xyz), predicted, 11)
    for key, found in zip(truth_keys, seen, strict=True):
        away = np.linalg.norm(GRID.centres(keys) - GRID.centres(np.array([key])), axis=1)
        best = set(labels[away <= away.min() + 1e-9].tolist())
        assert found in (best if away.min() < 1.0 - 1e-9 else best | {0})
        assert away.min() <= 1.0 + 1e-9 or found == 0


def test_rings_add_up() -> None:
    rng = np.random.default_rng(5)
    keys = np.sort(rng.choice(16 * 16 * 8, 500, replace=False))
    truth, seen = (rng.integers(low, 11, 500).astype(np.uint8) for low in (1, 0))
    whole = segmentation.confusion(truth, seen, 11)
    np.testing.assert_array_equal(sum(targets.by_ring(GRID, keys, truth, seen)), whole)


def test_what_stands_hides_the_ground_and_what_is_overhead_is_left_out() -> None:
    place = np.array([[0.1, 0.1, 0.1], [0.1, 0.1, 1.1], [0.1, 0.1, 3.2], [2.1, 0.1, 0.1], [2.1, 1.1, 3.2]])
    labels = np.array([1, 8, 4, 1, 4], np.uint8)
    seen = targets.birds_eye(GRID, GRID.keys(place), labels)
    assert seen[8, 8] == 8 and seen[12, 8] == 1 and seen[12, 10] == 0
    assert np.count_nonzero(seen) == 2


def test_recall_counts_targets_only() -> None:
    points = np.array([0, 4, 5, 20, 100])
    target = np.array([True, True, True, True, False])
    assert objects.recall(points, target, 5) == (2, 4)
    assert objects.recall(points, target, 20) == (1, 4)


def test_blind_ground_of_a_ring() -> None:
    edge = 0.1
    x, y = np.meshgrid(np.arange(-12, 12, edge) + edge / 2, np.arange(-12, 12, edge) + edge / 2)
    ground = np.c_[x.ravel(), y.ravel()]
    body = (-2.0, -1.0, 2.0, 1.0)
    away = objects.distance_to(body, ground)
    blind, whole = objects.blind_ground(ground[away > 0], ground[(away > 3.5)], body, 10.0, edge)
    # Within 10 m of a rectangle: a rounded one, without itself; seen from 3 m on (CLOSE reaches half a metre in).
    area = lambda r: np.pi * r**2 + 2 * r * (4 + 2)  # noqa: E731
    assert whole == pytest.approx(area(10), rel=0.01)
    assert blind == pytest.approx(area(3), rel=0.02)
    assert objects.blind_ground(ground, np.zeros((0, 2)), body, 3.0, edge)[0] > 0
