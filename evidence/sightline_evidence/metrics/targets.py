"""Voxel and bird's-eye confusion on targets that are the same for all placements: what is missed is wrong."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .._types import I64, U8, Bools, Floats
from ..grid import Grid, majority
from ..groups import GROUND, GROUPS
from .segmentation import confusion

#: Metres from the middle of the vehicle in plan, by which results are split.
RINGS = (0.0, 10.0, 20.0, 30.0, 60.0)

#: Metres above the ground beyond which nothing meets a vehicle.
OVERHEAD = 2.9


def seen_as(grid: Grid, targets: I64, xyz: Floats, predicted: U8, reach: float = 0.0) -> U8:
    """Class that a placement took each target voxel ``[V]`` for, from points ``[P, 3]`` with predictions ``[P]``; 0: unseen.

    With ``reach`` 0 a voxel has the majority of its own points; else that of the nearest voxel with points, if one
    is within ``reach`` metres, middle to middle.
    """
    keys, labels = majority(grid.keys(xyz), predicted, len(GROUPS))
    if not len(keys):
        return np.zeros(len(targets), np.uint8)
    if reach > 0:
        far, near = cKDTree(grid.centres(keys)).query(grid.centres(targets), distance_upper_bound=reach)
        return np.where(np.isfinite(far), np.append(labels, 0)[near], 0).astype(np.uint8)
    place = np.minimum(np.searchsorted(keys, targets), len(keys) - 1)
    return np.where(keys[place] == targets, labels[place], 0).astype(np.uint8)


def by_ring(grid: Grid, targets: I64, truth: U8, seen: U8) -> list[I64]:
    """Confusion of voxels in each of ``RINGS``; their sum is the confusion of all within the last."""
    distance = np.hypot(*grid.centres(targets)[:, :2].T)
    ring = np.digitize(distance, RINGS) - 1
    return [confusion(truth[ring == k], seen[ring == k], len(GROUPS)) for k in range(len(RINGS) - 1)]


def birds_eye(grid: Grid, keys: I64, labels: U8) -> U8:
    """The map ``[nx, ny]`` of labelled voxels ``[V]`` below ``OVERHEAD``; 0 where there is none.

    Things that stand on the ground hide it; of several such labels in a column the most frequent counts, of equally
    frequent ones the lowest.
    """
    centres = grid.centres(keys)
    low = centres[:, 2] < OVERHEAD
    column, label = keys[low] // grid.shape[2], labels[low]
    standing = ~np.isin(label, GROUND)
    flat = np.zeros(grid.shape[0] * grid.shape[1], np.uint8)
    for part in (~standing, standing):
        cells, winner = majority(column[part], label[part], len(GROUPS))
        flat[cells] = winner
    return flat.reshape(grid.shape[:2])


def birds_eye_confusion(truth: U8, seen: U8) -> I64:
    """Confusion of two maps ``[nx, ny]`` over the cells that have a truth."""
    there = truth > 0
    return confusion(truth[there], seen[there], len(GROUPS))


def beneath(grid: Grid, targets: I64) -> Bools:
    """Mask ``[V]`` of the voxels whose middle is below ``OVERHEAD``."""
    low: Bools = grid.centres(targets)[:, 2] < OVERHEAD
    return low
