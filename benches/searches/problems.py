"""The problems, and the map from variables in [0, 1] to poses that a mount allows."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FIELDS = ("x", "y", "z", "roll", "pitch", "yaw")
#: Fields that change sign in a mirror at the plane y = 0.
MIRRORED = (1, 3, 5)
#: Rules that the map does not know; a problem with one is refused.
UNKNOWN_RULES = ("keep_out", "equal_height", "mesh")
Lidars = list[dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Scenes, vehicle and options of one search."""

    key: str
    scenes: tuple[Path, ...]
    vehicle: Path | None = None
    options: tuple[str, ...] = ()
    #: Arguments of `scene new` that make the one scene, if it is not there.
    made: tuple[str, ...] = ()
    #: Text of the vehicle file, if it is not there.
    vehicle_made: str = ""
    title: str = ""
    #: Placements that are injected; a file of the repository.
    start: Path | None = None
    #: Plain relative of a variant, without its option; in words, how the relative's placement is compared.
    plain: Problem | None = None
    fair: str = ""
    #: Placements that keep the rules of the variant, made of the one found for `plain`.
    rivals: Callable[[Lidars], list[Lidars]] = lambda lidars: [lidars]

    @property
    def arguments(self) -> list[str]:
        """Arguments of `sightline optimize` for this problem."""
        vehicle = ["--vehicle", str(self.vehicle)] if self.vehicle else []
        start = ["--inject", str(self.start)] if self.start else []
        return [*map(str, self.scenes), *vehicle, *start, *self.options]

    @property
    def shown(self) -> list[str]:
        """`arguments` with paths from the root of the repository, and names of generated scenes."""
        inside = [path.relative_to(ROOT) if path.is_relative_to(ROOT) and not self.made else path.name
                  for path in self.scenes]
        vehicle = ["--vehicle", self.vehicle.name if self.vehicle_made else str(self.vehicle.relative_to(ROOT))] \
            if self.vehicle else []
        start = ["--inject", str(self.start.relative_to(ROOT))] if self.start else []
        return [*map(str, inside), *vehicle, *start, *self.options]


def problems(out: Path) -> dict[str, Problem]:
    """All problems by key, of the steep street where its file is; generated scenes lie in `out`."""
    scenes = ROOT / "scenes"
    own = {"uc": "urban-crossing", "hw": "highway", "re": "residential", "iy": "industrial-yard"}
    crossing, residential = (scenes / f"{own[key]}.json" for key in ("uc", "re"))
    street = ("--kind", "street", "--seed", "11")
    found = [Problem(key=key, scenes=(scenes / f"{name}.json",), title=name) for key, name in own.items()]
    found += [
        Problem(key="car", scenes=(crossing,), vehicle=scenes / "vehicles/car.json", title="car on urban-crossing"),
        Problem(key="van", scenes=(out / "street.json",), vehicle=Path(__file__).with_name("van.json"),
                options=("--budget", "12000"), made=street, title="van on a street"),
        Problem(key="two", scenes=(crossing, residential), title="urban-crossing and residential at once"),
    ]
    shared = ROOT.parent / "shared/data"
    if (shared / "rigs/lexus").is_dir():
        found.append(Problem(key="lexus", scenes=(out / "street.json",), vehicle=out / "lexus.json", made=street,
                             vehicle_made=lexus(shared), title="Lexus of Autoware on a street"))
    if (shared / "hill/hill.json").is_file():
        found.append(Problem(key="hill", scenes=(shared / "hill/hill.json",), title="a steep street"))
    return {problem.key: problem for problem in found}


def lexus(shared: Path) -> str:
    """A vehicle file: Autoware's Lexus, each LiDAR free within 0.2 m and 0.3 rad of where its users put it.

    Poses and models: awsim_sensor_kit of autoware_individual_params, base_link on the ground. The body is two
    boxes, since no drawing is published: lengths are about those of the car.
    """
    top = {"file": str(shared / "sensors/velodyne_vls_128.json"), "azimuth_steps": 900, "range": 200}
    side = {"channels": 16, "fov": [-15, 15], "azimuth_steps": 900, "range": 100}
    places = {"top": (0.9, 0.0, 2.07, 0.0, 0.0), "left": (0.9, 0.59, 1.73, 0.71, 1.575),
              "right": (0.9, -0.59, 1.73, 0.71, -1.575), "rear": (-0.358, 0.0, 1.67, 0.728, 3.1)}
    mounts = [{"name": name, "sensors": ["VLS-128" if name == "top" else "VLP-16"],
               "count": [1, 1], "min": [x - 0.2, y - 0.2 if y else 0.0, z],
               "max": [x + 0.2, y + 0.2 if y else 0.0, z + 0.2],
               "pitch": [pitch - 0.3, pitch + 0.3], "yaw": [yaw, yaw]}
              for name, (x, y, z, pitch, yaw) in places.items()]
    boxes = [((-1.05, -0.95, 0.3), (3.85, 0.95, 1.0)), ((-0.9, -0.75, 1.0), (2.2, 0.75, 1.6))]
    body = [{"class": "vehicle", "box": {"min": low, "max": high}} for low, high in boxes]
    sensors = [{"name": "VLS-128", "lidar": top}, {"name": "VLP-16", "lidar": side}]
    return json.dumps({"sightline": 1, "name": "lexus", "body": body, "sensors": sensors, "mounts": mounts,
                       "min_distance": 0.2})


@dataclass(frozen=True)
class Mount:
    """Bounds of six pose fields, and where the frame lies in which they count."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    #: Origin of the frame in the ego frame, metres, and its turn about z, radians.
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: float = 0.0

    @property
    def free(self) -> list[int]:
        """Fields that may vary."""
        return [k for k in range(6) if self.upper[k] > self.lower[k]]

    def pose(self, fields: list[float]) -> list[float]:
        """Pose in the ego frame of fields in the mount's."""
        if self.turn == 0.0 and self.origin == (0.0, 0.0, 0.0):
            return list(fields)
        x, y, z, roll, pitch, yaw = fields
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        ox, oy, oz = self.origin
        yaw = math.remainder(yaw + self.turn, math.tau)
        return [ox + cos * x - sin * y, oy + sin * x + cos * y, oz + z, roll, pitch, yaw]


def mount_of(description: dict[str, Any]) -> Mount:
    """Bounds of a mount as scene or vehicle files describe it: a box, or an upright rectangle."""
    refuse(description)
    angles = [description.get(name, [0.0, 0.0]) for name in FIELDS[3:]]
    low, high = ([float(angle[side]) for angle in angles] for side in (0, 1))
    if "polygon" not in description:
        return Mount((*description["min"], *low), (*description["max"], *high))
    corners = description["polygon"]
    origin = tuple(sum(corner[k] for corner in corners) / len(corners) for k in range(3))
    normal = newell(corners)
    if abs(normal[2]) > 1e-9 * math.hypot(*normal):
        raise ValueError("polygon: is not upright; this benchmark knows upright rectangles alone")
    turn = math.atan2(normal[1], normal[0])
    across = [(c[1] - origin[1]) * math.cos(turn) - (c[0] - origin[0]) * math.sin(turn) for c in corners]
    up = [c[2] - origin[2] for c in corners]
    edges = [(min(values), max(values)) for values in (across, up)]
    on_corner = all(min(abs(a - edges[0][0]), abs(a - edges[0][1])) < 1e-9
                    and min(abs(u - edges[1][0]), abs(u - edges[1][1])) < 1e-9
                    for a, u in zip(across, up))
    if len(corners) != 4 or not on_corner:
        raise ValueError("polygon: is no upright rectangle; this benchmark knows no other patch")
    near, far = description.get("offset", [0.0, 0.0])
    return Mount((near, edges[0][0], edges[1][0], *low), (far, edges[0][1], edges[1][1], *high),
                 origin, turn)


def newell(corners: list[list[float]]) -> list[float]:
    """Normal of a polygon, twice its area long, towards who sees the corners counter-clockwise."""
    normal = [0.0, 0.0, 0.0]
    for a, b in zip(corners, corners[1:] + corners[:1]):
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            normal[k] += a[i] * b[j] - a[j] * b[i]
    return normal


def refuse(description: dict[str, Any]) -> None:
    """ValueError for rules that the map does not keep."""
    for rule in UNKNOWN_RULES:
        if description.get(rule):
            raise ValueError(f"{rule}: is a rule that this benchmark does not know; leave it out")


def mirror(pose: list[float]) -> list[float]:
    """The pose mirrored at the plane y = 0."""
    return [-value if k in MIRRORED else value for k, value in enumerate(pose)]


@dataclass
class Space:
    """Feasible poses of a rig: a box of variables, a least distance, mirrored pairs."""

    mounts: list[Mount]
    min_distance: float = 0.0
    sensors: list[str] | None = None
    #: For each LiDAR of a symmetric rig: the earlier one that it mirrors, itself if it lies in the plane.
    partner: list[int | None] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.partner = self.partner or [None] * len(self.mounts)
        self.places: list[tuple[int, int]] = []
        for lidar, mount in enumerate(self.mounts):
            if self.partner[lidar] in (None, lidar):
                in_plane = self.partner[lidar] == lidar
                kept = [k for k in mount.free if not (in_plane and k in MIRRORED)]
                self.places += [(lidar, k) for k in kept]

    @property
    def variables(self) -> int:
        """How many variables in [0, 1] there are."""
        return len(self.places)

    def poses(self, shares: Any) -> list[list[float]]:
        """Poses in the ego frame, metres and radians, of variables in [0, 1]; others are clipped."""
        fields = [list(mount.lower) for mount in self.mounts]
        for (lidar, k), share in zip(self.places, shares, strict=True):
            mount, share = self.mounts[lidar], min(1.0, max(0.0, float(share)))
            value = mount.lower[k] + share * (mount.upper[k] - mount.lower[k])
            fields[lidar][k] = min(value, mount.upper[k])
        poses: list[list[float]] = []
        for lidar, mount in enumerate(self.mounts):
            other = self.partner[lidar]
            if other is not None and other != lidar:
                poses.append(mirror(poses[other]))
                continue
            pose = mount.pose(fields[lidar])
            if other == lidar:
                pose = [0.0 if k in MIRRORED else value for k, value in enumerate(pose)]
            poses.append(pose)
        return poses

    def shares(self, poses: list[list[float]]) -> list[float] | None:
        """Variables in [0, 1] of poses in boxes; None where they do not fit, or a mount is a patch or mirrored."""
        plain = all(mount.turn == 0.0 and mount.origin == (0.0, 0.0, 0.0) for mount in self.mounts)
        if not plain or len(poses) != len(self.mounts) or any(by is not None for by in self.partner):
            return None
        found = []
        for lidar, k in self.places:
            low, high = self.mounts[lidar].lower[k], self.mounts[lidar].upper[k]
            found.append(min(1.0, max(0.0, (poses[lidar][k] - low) / (high - low))))
        near = all(math.dist(a, b) < 1e-6 for a, b in zip(self.poses(found), poses))
        return found if near and self.missing(self.poses(found)) == 0.0 else None

    def missing(self, poses: list[list[float]]) -> float:
        """Distance that is missing between LiDARs, summed over pairs, in metres; 0 keeps the rule."""
        short = (self.min_distance - math.dist(a[:3], b[:3]) for a, b in combinations(poses, 2))
        return sum(by for by in short if by > 0.0)


def partners(lidars: list[dict[str, Any]]) -> list[int | None]:
    """For each LiDAR of a symmetric rig, the earlier one that it mirrors; itself where there is none."""
    poses = [[lidar.get(name, 0.0) for name in FIELDS] for lidar in lidars]
    found: list[int | None] = []
    taken: set[int] = set()
    for index, pose in enumerate(poses):
        earlier = (j for j in range(index) if j not in taken and math.dist(mirror(pose), poses[j]) < 1e-6
                   and lidars[j].get("sensor") == lidars[index].get("sensor"))
        other = next(earlier, None)
        if other is not None:
            taken |= {other, index}
        found.append(other)
    return [index if other is None and index not in taken else other
            for index, other in enumerate(found)]


def space_of(problem: Problem, lidars: list[dict[str, Any]], names: list[str] | None) -> Space:
    """Poses that the rules allow for the equipment of a placement found: its LiDARs, mounts by name."""
    if problem.vehicle is None:
        rules = json.loads(problem.scenes[0].read_text())["mount"]
        mounts = [mount_of(rules)] * int(rules["lidars"])
        sensors = None
    else:
        rules = json.loads(problem.vehicle.read_text())
        by_name = {mount["name"]: mount_of(mount) for mount in rules["mounts"]}
        mounts = [by_name[name] for name in names or []]
        sensors = [lidar["sensor"] for lidar in lidars]
        refuse(rules)
    paired = partners(lidars) if rules.get("symmetric") else []
    return Space(mounts, float(rules.get("min_distance", 0.0)), sensors, paired)
