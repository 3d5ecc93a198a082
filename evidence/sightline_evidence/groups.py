"""Groups of classes that learners tell apart: 1 to 10, and 0 for what is unseen or has no class."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ._types import U8

#: Names by number; 0 is never a truth.
GROUPS = (
    "unseen",
    "road",
    "sidewalk",
    "terrain",
    "building",
    "barrier",
    "vegetation",
    "pole",
    "vehicle",
    "pedestrian",
    "other",
)

#: Groups that one drives or walks on.
GROUND = (1, 2, 3)

_OF_CLASS = {
    "road": "road",
    "road_line": "road",
    "rail_track": "road",
    "sidewalk": "sidewalk",
    "terrain": "terrain",
    "ground": "terrain",
    "water": "terrain",
    "building": "building",
    "wall": "building",
    "bridge": "building",
    "fence": "barrier",
    "guard_rail": "barrier",
    "vegetation": "vegetation",
    "pole": "pole",
    "traffic_sign": "pole",
    "traffic_light": "pole",
    "vehicle": "vehicle",
    "pedestrian": "pedestrian",
}

#: Kinds of actors as objects: the three that detection is judged on.
OBJECTS = {
    "car": "vehicle",
    "van": "vehicle",
    "truck": "vehicle",
    "bus": "vehicle",
    "trailer": "vehicle",
    "construction": "vehicle",
    "motorcycle": "cyclist",
    "bicycle": "cyclist",
    "pedestrian": "pedestrian",
}


def groups_of(classes: Sequence[str], class_id: np.ndarray[tuple[int, ...], np.dtype[np.integer[Any]]]) -> U8:
    """Groups ``[P]`` of class numbers ``[P]``; 0 for 65535 and −1 (fog, snow, nothing), ``other`` for unlisted names."""
    table = np.zeros(65536, np.uint8)
    table[: len(classes)] = [GROUPS.index(_OF_CLASS.get(name, "other")) for name in classes]
    found: U8 = table[class_id]
    return found
