"""The U-Net that all placements share: trained on another random rig in every frame, so that it favours none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .._types import F64, I64
from ..groups import GROUPS
from ..layouts import Layout
from ..metrics import segmentation, targets
from ..truth import Truth
from ..worlds import LIDAR, World
from . import points, unet

#: Most LiDARs of a random rig.
MOST = 6

#: Every so many-th frame is seen by other LiDARs of as many points, each world by one kind of them.
OTHER = 4

#: Variants: other channels and fields of view, as the studies have them.
_POINTS = 16 * 250
VARIANTS: tuple[dict[str, Any], ...] = (
    {"channels": 8, "azimuth_steps": _POINTS // 8},
    {"channels": 32, "azimuth_steps": _POINTS // 32},
    {"channels": 64, "azimuth_steps": _POINTS // 64},
    {"fov": [-15, 15]},
    {"fov": [-45, 5]},
    {"fov": [-12, 2]},
)


@dataclass(frozen=True)
class Lesson:
    """A frame of a world with its targets."""

    world: World
    frame: int
    truth: Truth
    target: unet.Target
    cell: int
    #: LiDARs of the rigs of successive steps; ``None``: the study's.
    lidars: tuple[dict[str, Any] | None, ...]


def lessons(given: list[tuple[World, list[Truth]]], cell: int, lidar: dict[str, Any] | None = None) -> list[Lesson]:
    """Lessons of all frames of these worlds; ``lidar`` takes the place of the study's and of its variants."""
    found = []
    for number, (world, truths) in enumerate(given):
        grid = world.source().grid
        others = (None,) * (OTHER - 1)
        lidars = (lidar,) if lidar else ({**LIDAR, **VARIANTS[number % len(VARIANTS)]}, *others)
        found += [
            Lesson(world, frame, truth, unet.target(grid, truth, cell), cell, lidars)
            for frame, truth in zip(world.frames, truths, strict=True)
        ]
    return found


def rig(rng: np.random.Generator, mount: dict[str, Any], body: F64) -> F64:
    """One to six poses ``[L, 6]``, uniform in the mount; of a third of the rigs some stand low around the body.

    ``body`` ``[4]`` is its outline in plan. Half of the rigs roll as far as the mount allows.
    """
    low, high = np.array(mount["min"], dtype=float), np.array(mount["max"], dtype=float)
    count = int(rng.integers(1, MOST + 1))
    rolled = mount.get("roll", [0.0, 0.0]) if rng.random() < 0.5 else [0.0, 0.0]
    roll = np.array(rolled, dtype=np.float64)
    spots = rng.uniform(low, high, (count, 3))
    if rng.random() < 1 / 3:
        below = rng.random(count) < 0.5
        spots[below] = _around(rng, body, int(below.sum()))
    angles = np.c_[rng.uniform(roll[0], roll[1], count), np.zeros(count), rng.uniform(-math.pi, math.pi, count)]
    poses: F64 = np.c_[spots, angles]
    return poses


def _around(rng: np.random.Generator, body: F64, count: int) -> F64:
    # Corners and middles of the sides, a tenth of a metre outside.
    x0, y0, x1, y1 = body
    x, y = [x0 - 0.1, x1 + 0.1, (x0 + x1) / 2], [y0 - 0.1, y1 + 0.1, (y0 + y1) / 2]
    places = np.array([(a, b) for a in x for b in y][:-1])
    chosen = places[rng.integers(len(places), size=count)]
    spots: F64 = np.c_[chosen, rng.uniform(0.4, 1.2, count)]
    return spots


def lesson_at(given: list[Lesson], seed: int, only: Layout | None = None) -> Callable[[int], unet.Sample]:
    """The sample of each step: a frame drawn at random, seen by a rig drawn anew, or by ``only``.

    A step's draw depends on the seed and the step alone, so that a training can go on anywhere.
    """

    def at(step: int) -> unet.Sample:
        rng = np.random.default_rng([seed, 2, step])
        lesson = given[int(rng.integers(len(given)))]
        mount = lesson.world.source().described["mount"]
        lidar = lesson.lidars[step % len(lesson.lidars)]
        layout = only or Layout("random", "box", rig(rng, mount, lesson.truth.body), lidar)
        return seen(lesson, layout, int(rng.integers(2**31)))

    return at


def shuffled(at: Callable[[int], unet.Sample], seed: int) -> Callable[[int], unet.Sample]:
    """Samples with the groups of each map in random order: nothing can be learnt but how common they are."""

    def wrong(step: int) -> unet.Sample:
        given = at(step)
        labels = given.target.labels.copy()
        labels[labels > 0] = np.random.default_rng([seed, 3, step]).permutation(labels[labels > 0])
        return replace(given, target=replace(given.target, labels=labels))

    return wrong


def seen(lesson: Lesson, layout: Layout, draw: int) -> unet.Sample:
    """A frame as a placement sees it, its noise drawn by a number."""
    xyz = points.met(lesson.world, lesson.frame, layout, lesson.truth.body, draw)
    small = unet.coarse(lesson.world.source().grid, lesson.cell)
    return unet.Sample(unet.image(small, xyz), lesson.target)


def quality(net: unet.Unet, samples: list[unet.Sample]) -> tuple[float, float]:
    """mIoU of the maps of some frames, and that of naming their commonest group everywhere."""
    counts = np.zeros((len(GROUPS), len(GROUPS)), np.int64)
    for given in samples:
        counts += targets.birds_eye_confusion(given.target.labels, net.groups(given.image))
    return segmentation.fixed(counts).mean, chance(counts)


def chance(counts: I64) -> float:
    """mIoU of naming the commonest group everywhere, on fixed targets of a confusion ``[truth, predicted]``."""
    blind = np.zeros_like(counts)
    blind[:, int(counts.sum(axis=1).argmax())] = counts.sum(axis=1)
    return segmentation.fixed(blind).mean
