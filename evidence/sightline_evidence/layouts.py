"""Placements of the studies: published, in step, staggered, mixed, of one to six LiDARs, random by strata, and gamed."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import sightline

from ._types import F64
from .worlds import LIDAR


@dataclass(frozen=True)
class Layout:
    """A placement ``[L, 6]`` and the pool that it is compared in."""

    name: str
    #: ``box``: four LiDARs in the mount; ``mixed``: some beside it; ``number``: other counts; ``sensor``: other LiDARs;
    #: ``gamed``: must lose.
    pool: str
    poses: F64
    #: Another LiDAR than the study's, as a scene file has it.
    lidar: dict[str, Any] | None = None
    #: ``[L]``, shares of an azimuth step by which the beams of each LiDAR are turned; ``None``: as the LiDAR has them.
    phases: F64 | None = None

    def placement(self, name: str = "placement") -> sightline.Placement:
        """This layout in the form that the engine takes."""
        if self.phases is None:
            return sightline.Placement(self.poses, name=name)
        step = 2 * np.pi / (self.lidar or LIDAR)["azimuth_steps"]
        return sightline.Placement(self.poses, name=name, phases=step * self.phases)

    def to_dict(self) -> dict[str, Any]:
        """This layout in the form that a plan keeps."""
        kept = {"name": self.name, "pool": self.pool, "poses": self.poses.tolist()}
        more = {"lidar": self.lidar, "phases": [] if self.phases is None else self.phases.tolist()}
        return kept | {key: value for key, value in more.items() if value}

    @staticmethod
    def from_dict(kept: dict[str, Any]) -> Layout:
        """Out of a plan."""
        poses = np.array(kept["poses"], dtype=np.float64)
        phases = np.array(kept["phases"]) if "phases" in kept else None
        return Layout(kept["name"], kept["pool"], poses, kept.get("lidar"), phases)


def published() -> list[Layout]:
    """Table 7 of Place3D."""
    return [Layout(placement.name, "box", placement.poses) for placement in sightline.published()]


def out_of_step(given: list[Layout]) -> list[Layout]:
    """Layouts with a phase for each LiDAR whose phase is not settled, drawn by its name.

    LiDARs that turn by themselves fire out of step. Were those of some placements in step and others' not, a study would
    see the phases in place of the poses.
    """

    def drawn_for(layout: Layout) -> F64:
        named = hashlib.sha256(layout.name.encode()).digest()
        shares = np.random.default_rng(int.from_bytes(named[:8], "little")).random(len(layout.poses))
        return np.round(shares, 4)

    return [replace(one, phases=drawn_for(one)) if one.phases is None else one for one in given]


def in_step_and_staggered() -> list[Layout]:
    """Layouts whose LiDARs share azimuths: all firing in step, and a quarter of an azimuth step apart."""
    found = []
    for layout in published():
        if layout.name in ("Center", "Line", "Square"):
            count = len(layout.poses)
            for name, phases in (("in-step", np.zeros(count)), ("staggered", np.arange(count) / count)):
                found.append(replace(layout, name=f"{layout.name}-{name}", phases=phases))
    return found


def mixed() -> list[Layout]:
    """Two on the roof, two low at the corners of a body of 4.5 × 1.8 m."""
    high = [[0.0, 0.5, 2.5, 0, 0, 0], [0.0, -0.5, 2.5, 0, 0, 0]]
    corners = {"front": [(2.35, 1.0), (2.35, -1.0)], "rear": [(-2.35, 1.0), (-2.35, -1.0)]}
    corners["diagonal"] = [(2.35, 1.0), (-2.35, -1.0)]
    return [
        Layout(f"low-{name}", "mixed", np.array(high + [[x, y, 0.6, 0, 0, 0] for x, y in spots]))
        for name, spots in corners.items()
    ]


def numbers() -> list[Layout]:
    """One to six LiDARs, each with all of the one before, phases included: their yaws are no multiples of a step."""
    spots = [(0, 0, 2.8), (0.6, 0.6, 2.5), (-0.6, -0.6, 2.5), (0.6, -0.6, 2.2), (-0.6, 0.6, 2.2), (0, 0.6, 2.8)]
    poses = np.array([[*spot, 0.0, 0.0, 0.7 * k] for k, spot in enumerate(spots)])
    return [Layout(f"count-{n}", "number", poses[:n], phases=np.zeros(n)) for n in range(1, len(spots) + 1)]


def sensors() -> list[Layout]:
    """The published optimum with LiDARs of as many points: other channels, other fields of view."""
    (ours,) = (layout.poses for layout in published() if layout.name == "Ours-seg")
    points = LIDAR["channels"] * LIDAR["azimuth_steps"]
    patterns = [(f"channels-{n}", {"channels": n, "azimuth_steps": points // n}) for n in (8, 32, 64)]
    patterns += [(f"fov-{low}-{high}", {"fov": [low, high]}) for low, high in ((-15, 15), (-45, 5), (-12, 2))]
    return [Layout(f"Ours-seg-{name}", "sensor", ours, {**LIDAR, **changed}) for name, changed in patterns]


def gamed() -> list[Layout]:
    """Rigs that no vehicle should carry: aimed at the sky, inside the cabin, four in one spot and in step."""
    (pyramid,) = (layout.poses for layout in published() if layout.name == "Pyramid")
    sky = pyramid.copy()
    sky[:, 4] = -math.pi / 2
    cabin = np.array([[x, y, 1.2, 0, 0, 0] for x in (-0.6, 0.2) for y in (-0.3, 0.3)])
    stacked = np.tile([0.0, 0, 2.2, 0, 0, 0], (4, 1))
    one = Layout("stacked", "gamed", stacked, phases=np.zeros(4))
    return [Layout("sky", "gamed", sky), Layout("cabin", "gamed", cabin), one]


def stratified(mount: dict[str, Any], each: int, seed: int) -> list[Layout]:
    """``each`` random layouts of four in every stratum of mean height (3) × spread (2) × roll (2).

    Yaw is uniform, so that the phases of azimuth steps are free. Sensors keep the mount's distance.
    """
    low, high = np.array(mount["min"], dtype=float), np.array(mount["max"], dtype=float)
    found = []
    for level in range(3):
        for wide in (False, True):
            for rolled in (False, True):
                for n in range(each):
                    rng = np.random.default_rng([seed, level, wide, rolled, n])
                    name = f"random-{'low mid high'.split()[level]}-{'wide' if wide else 'narrow'}"
                    name += f"{'-roll' if rolled else ''}-{n}"
                    roll = mount["roll"] if rolled else [0.0, 0.0]
                    poses = drawn(rng, low, high, level, wide, roll, mount.get("min_distance", 0.0))
                    found.append(Layout(name, "box", poses))
    return found


def drawn(
    rng: np.random.Generator, low: F64, high: F64, level: int, wide: bool, roll: list[float], apart: float
) -> F64:
    """Four poses ``[4, 6]`` in a third (``level``) of the height of a mount, over all of its plan or the inner part."""
    third = (high[2] - low[2]) / 3
    middle, half = (low + high) / 2, (high - low) / 2 * (1.0 if wide else 0.4)
    # A mount with little room gets what of the distance it has room for.
    for attempt in range(1000):
        xy = rng.uniform(middle[:2] - half[:2], middle[:2] + half[:2], (4, 2))
        z = low[2] + third * (level + rng.uniform(size=(4, 1)))
        if _nearest(np.c_[xy, z]) >= apart * (1 - attempt / 1000):
            break
    angles = np.c_[rng.uniform(roll[0], roll[1], 4), np.zeros(4), rng.uniform(-np.pi, np.pi, 4)]
    poses: F64 = np.concatenate([xy, z, angles], axis=1).round(4)
    return poses


def _nearest(spots: F64) -> float:
    away = np.linalg.norm(spots[:, None] - spots[None], axis=2)
    return float(away[np.triu_indices(len(spots), 1)].min())
