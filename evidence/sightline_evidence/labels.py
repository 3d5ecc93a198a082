"""Classes of the two public label formats that exports are written in, and the groups in which both can be held to one truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._types import U8, Ints
from .groups import GROUPS

#: Kinds of voxels that are told apart; 0 is none of them.
COMMON = ("none", "road", "other ground", "built", "vegetation", "vehicle", "pedestrian")

#: Our groups in the common ones.
_OF_GROUP = {
    "road": "road",
    "sidewalk": "other ground",
    "terrain": "other ground",
    "building": "built",
    "barrier": "built",
    "pole": "built",
    "vegetation": "vegetation",
    "vehicle": "vehicle",
    "pedestrian": "pedestrian",
}


@dataclass(frozen=True)
class Format:
    """Classes that are evaluated, 0 ignored, with the common group of each."""

    name: str
    classes: tuple[str, ...]
    common: tuple[str, ...]

    def groups(self, labels: Ints) -> U8:
        """Common groups of class numbers ``[P]``."""
        table = np.array([COMMON.index(name) for name in self.common], np.uint8)
        found: U8 = table[labels]
        return found


def common_of(groups: U8) -> U8:
    """Common groups of our own ``[V]``."""
    table = np.array([COMMON.index(_OF_GROUP.get(name, "none")) for name in GROUPS], np.uint8)
    found: U8 = table[groups]
    return found


#: ``learning_map`` of semantic-kitti.yaml: raw labels of each class, moving ones included.
_KITTI = (
    ("unlabeled", "none", (0, 1, 52, 99)),
    ("car", "vehicle", (10, 252)),
    ("bicycle", "vehicle", (11,)),
    ("motorcycle", "vehicle", (15,)),
    ("truck", "vehicle", (18, 258)),
    ("other-vehicle", "vehicle", (13, 16, 20, 256, 257, 259)),
    ("person", "pedestrian", (30, 254)),
    ("bicyclist", "vehicle", (31, 253)),
    ("motorcyclist", "vehicle", (32, 255)),
    ("road", "road", (40, 60)),
    ("parking", "road", (44,)),
    ("sidewalk", "other ground", (48,)),
    ("other-ground", "other ground", (49,)),
    ("building", "built", (50,)),
    ("fence", "built", (51,)),
    ("vegetation", "vegetation", (70,)),
    ("trunk", "vegetation", (71,)),
    ("terrain", "other ground", (72,)),
    ("pole", "built", (80,)),
    ("traffic-sign", "built", (81,)),
)

#: Raw labels of SemanticKITTI to classes.
KITTI_CLASS = {raw: number for number, (_, _, labels) in enumerate(_KITTI) for raw in labels}

SEMANTICKITTI = Format("SemanticKITTI", tuple(row[0] for row in _KITTI), tuple(row[1] for row in _KITTI))

#: The 16 classes of the nuScenes-lidarseg challenge.
_NUSCENES = (
    ("ignore", "none"),
    ("barrier", "built"),
    ("bicycle", "vehicle"),
    ("bus", "vehicle"),
    ("car", "vehicle"),
    ("construction_vehicle", "vehicle"),
    ("motorcycle", "vehicle"),
    ("pedestrian", "pedestrian"),
    ("traffic_cone", "none"),
    ("trailer", "vehicle"),
    ("truck", "vehicle"),
    ("driveable_surface", "road"),
    ("other_flat", "other ground"),
    ("sidewalk", "other ground"),
    ("terrain", "other ground"),
    ("manmade", "built"),
    ("vegetation", "vegetation"),
)

NUSCENES = Format("nuScenes-lidarseg", tuple(row[0] for row in _NUSCENES), tuple(row[1] for row in _NUSCENES))
