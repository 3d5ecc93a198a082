"""The U-Net learns the small world from random placements, maps and boxes, and repeats itself."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="torch is not installed")
pytest.importorskip("sklearn")
from sightline.evidence import truth, worlds
from sightline.evidence.groups import GROUPS
from sightline.evidence.learners import unet
from sightline.evidence.metrics import segmentation, targets

# Small maps: more threads would wait for each other.
torch.set_num_threads(1)
SMALL = unet.Settings(steps=200, width=8, rate=5e-3, cell=2)


@pytest.fixture(scope="module")
def samples(small_file: Path) -> list[unet.Sample]:
    world = worlds.world("small", small_file, "train", 3)
    truths = truth.truth_of(world.source(), world.frames)
    return list(itertools.islice(unet.stream([(world, truths)], seed=1, cell=2), 14))


def test_learns_maps_and_centres(samples: list[unet.Sample], small_file: Path) -> None:
    grid = unet.coarse(truth.Source.read(small_file).grid, 2)
    trained = unet.train(itertools.cycle(samples[:11]), seed=1, settings=SMALL)
    assert np.mean(trained.curve[-10:]) < 0.3 * np.mean(trained.curve[:10])
    counts = np.zeros((len(GROUPS), len(GROUPS)), np.int64)
    for given in samples[11:]:
        labels, sure, objects = trained.predict(grid, given.image)
        counts += targets.birds_eye_confusion(given.labels, labels)
        assert np.all((sure > 0) & (sure <= 1)) and np.all(np.diff(objects.score) <= 0)
        # The car before the vehicle is at 9 m in all frames and seen by all.
        best = objects.kind.index("vehicle")
        np.testing.assert_allclose(objects.centre[best, :2], [9, 0], atol=1.5)
        np.testing.assert_allclose(objects.size[best], [4, 1.8, 1.5], rtol=0.3)
    assert segmentation.fixed(counts).mean > 0.5


def test_same_seed_same_net(samples: list[unet.Sample]) -> None:
    few = unet.Settings(steps=4, width=8, cell=2)
    curves = [unet.train(samples, seed, few).curve for seed in (1, 1, 2)]
    assert curves[0] == curves[1] != curves[2]


def test_targets_are_where_the_boxes_are(samples: list[unet.Sample]) -> None:
    for given in samples[:3]:
        assert given.image.shape[0] == unet.CHANNELS and np.all(np.isfinite(given.image))
        assert len(given.cells) == 2  # the hidden car is no target
        peaks = np.argwhere(given.heat.max(axis=0) == 1)
        assert {int(i * given.labels.shape[1] + j) for i, j in peaks} == set(given.cells.tolist())


def test_every_frame_has_another_placement(samples: list[unet.Sample]) -> None:
    assert len({given.image.tobytes() for given in samples}) == len(samples)


def test_no_points_is_an_empty_image(samples: list[unet.Sample]) -> None:
    grid = unet.coarse(truth.Grid((0, 0, 0), (1, 1, 1), (9, 7, 6)), 2)
    assert grid.shape == (5, 4, 6)
    assert not unet.image(grid, np.zeros((0, 3))).any()
