"""Points that a placement meets in a frame, for the learner of maps: first hits with noise, thousands of rigs in a minute."""

from __future__ import annotations

import numpy as np

from .._types import F64
from ..layouts import Layout
from ..metrics.objects import distance_to
from ..worlds import World

#: Metres, standard deviation along the beam; that of the sensors of the studies.
NOISE = 0.02


def met(world: World, frame: int, layout: Layout, body: F64, draw: int) -> F64:
    """Points ``[P, 3]`` in metres, ego frame, without those on the own body, whose outline in plan is ``body`` ``[4]``.

    Beams are cast all together in the world at rest, without a sensor's response: a scan of one frame takes forty
    times as long to prepare.
    """
    cast = world.scene(layout.lidar).cast(layout.placement(), frame=frame)
    hit = np.isfinite(cast["t_hit"])
    far = cast["t_hit"][hit] + NOISE * np.random.default_rng([draw, 4]).standard_normal(int(hit.sum()))
    xyz = cast["origin"][hit] + far[:, None] * cast["direction"][hit]
    outline = (float(body[0]), float(body[1]), float(body[2]), float(body[3]))
    others: F64 = xyz[distance_to(outline, xyz[:, :2]) > NOISE].astype(np.float64)
    return others
