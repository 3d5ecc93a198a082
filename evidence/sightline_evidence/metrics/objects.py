"""Objects that have enough points, and ground near the body that no beam meets."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .._types import Bools, F64, Floats, Ints

#: Least points by which an object counts as seen; 5 is Waymo's "level 1" bound, 20 is enough for a box.
ENOUGH = (5, 20)

#: Metres in plan within which a hit on the ground tells about it.
CLOSE = 0.5


def recall(points: Ints, targets: Bools, enough: int) -> tuple[int, int]:
    """Count of the boxes ``[B]`` among ``targets`` with at least ``enough`` points of the placement, and of all ``targets``."""
    return int(np.count_nonzero(points[targets] >= enough)), int(np.count_nonzero(targets))


def blind_ground(
    ground: Floats, hits: Floats, body: tuple[float, float, float, float], within: float, cell: float
) -> tuple[float, float]:
    """Square metres of ground near the body without a ground hit within ``CLOSE`` metres in plan, and of all of it.

    ``ground`` ``[G, 2]`` are middles of ground cells with edges of ``cell`` metres, ``hits`` ``[H, 2]`` the
    placement's points on ground, ``body`` the vehicle's outline (x and y from, x and y to), ``within`` metres from it.
    """
    near = ground[distance_to(body, ground) <= within]
    if not len(hits):
        return len(near) * cell**2, len(near) * cell**2
    far, _ = cKDTree(hits).query(near, distance_upper_bound=CLOSE)
    return float(np.count_nonzero(np.isinf(far)) * cell**2), len(near) * cell**2


def distance_to(body: tuple[float, float, float, float], xy: Floats) -> F64:
    """Metres in plan from an outline along the axes to points ``[P, 2]``; 0 inside."""
    x0, y0, x1, y1 = body
    outside = np.maximum(np.maximum([x0, y0] - xy, xy - [x1, y1]), 0.0)
    away: F64 = np.hypot(outside[:, 0], outside[:, 1]).astype(np.float64)
    return away
