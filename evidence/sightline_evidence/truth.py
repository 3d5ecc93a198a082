"""Targets of a frame that no placement moves: what a dense rig sees, cached by content."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

import sightline

from ._types import F64, I64, U8, Bools
from .grid import Grid, majority
from .groups import GROUPS, OBJECTS, groups_of

#: Counts up when the same inputs are to give other targets.
VERSION = 2

#: The dense sensor: half a degree by a quarter, further than the region reaches.
DENSE = {"channels": 180, "fov": [-60, 29.5], "azimuth_steps": 1440, "range": 100.0}

#: Height of the four dense sensors at the corners of the body, metres.
CORNER_HEIGHT = 1.0

#: Points of the dense rig from which a box is a target.
VISIBLE = 5


@dataclass(frozen=True)
class Truth:
    """Targets of one frame in its ego frame."""

    #: ``[V]``, rising numbers of the voxels that the dense rig hits.
    keys: I64
    #: ``[V]``, their groups, 1 and up.
    labels: U8
    #: ``[B, 3]`` metres, middles of the boxes of detectable kinds within the region in plan.
    centre: F64
    #: ``[B, 3]`` metres, length, width, height.
    size: F64
    #: ``[B]`` radians.
    yaw: F64
    #: ``[B]``, as in ``Scan.instance``.
    instance: I64
    #: ``[B]``, position in ``KINDS``.
    kind: I64
    #: ``[B]``, points of the dense rig on the object.
    points: I64
    #: ``[4]`` metres, outline of the own body in plan: x and y from, x and y to.
    body: F64


#: Objects by number, as in ``Truth.kind``.
KINDS = ("vehicle", "pedestrian", "cyclist")


@dataclass(frozen=True)
class Source:
    """A scene's file, read, so that it can be opened with any LiDAR."""

    path: Path
    described: dict[str, Any]

    @staticmethod
    def read(path: Path) -> Source:
        """Reads a scene file with geometry."""
        described = json.loads(path.read_text(encoding="utf-8"))
        return Source(path, described)

    @property
    def grid(self) -> Grid:
        """The scene's region."""
        return Grid.of(self.described["roi"])

    def open(
        self,
        frames: int | None = None,
        psog: sightline.Psog | None = None,
        **changed: Any,
    ) -> sightline.Scene:
        """The scene with other entries, as ``lidar=…``, scored over so many frames, with a P-SOG that is there."""
        described, folder = {**self.described, **changed}, self.path.parent
        return sightline.Scene.from_dict(
            described, folder=folder, psog=psog, backend="cpu", frames=frames
        )

    def digest(self) -> str:
        """SHA-256 of the scene file and the files that it names."""
        total = hashlib.sha256(self.path.read_bytes())
        for file in sorted(map(str, self.open().files)):
            if Path(file).resolve() != self.path.resolve():
                total.update(Path(file).read_bytes())
        return total.hexdigest()


def rig(mount: dict[str, Any], body: F64) -> F64:
    """Poses ``[6, 6]`` of the dense rig: two on top of the mount's box, four just outside the body's corners.

    The corners see the ground beside the vehicle that no roof sees, so that a low sensor's gain counts.
    """
    low, high = mount["min"], mount["max"]
    spots = [(low[0], low[1], high[2]), (high[0], high[1], high[2])]
    out = 0.1
    spots += [
        (x, y, CORNER_HEIGHT)
        for x in (body[0] - out, body[2] + out)
        for y in (body[1] - out, body[3] + out)
    ]
    return np.array([[*spot, 0.0, 0.0, 0.0] for spot in spots])


def body_of(scene: sightline.Scene) -> F64:
    """Outline ``[4]`` of the own body in plan; a point at the origin if there is none."""
    soup = scene.mesh(0, body=True)
    others = len(scene.mesh(0, body=False)["faces"])
    own = soup["vertices"][soup["faces"][others:].astype(np.int64).ravel(), :2].astype(np.float64)
    return np.concatenate([own.min(axis=0), own.max(axis=0)]) if len(own) else np.zeros(4)


def truth_of(source: Source, frames: list[int]) -> list[Truth]:
    """Targets of some frames, in order."""
    scene = source.open(lidar=DENSE)
    body = body_of(scene)
    poses = rig(source.described["mount"], body)
    scans = scene.scan(poses, ideal=True, frames=frames)
    return [_of_scan(scan, source.grid, body) for scan in scans]


def _of_scan(scan: sightline.Scan, grid: Grid, body: F64) -> Truth:
    # The own body is no target.
    seen = scan.instance != 65535
    labels = groups_of(scan.classes, scan.class_id[seen])
    keys, labels = majority(grid.keys(_behind(scan, seen)), labels, len(GROUPS))
    boxes = scan.boxes
    pose = boxes.ego_from_box
    reach = np.array(grid.low[:2]), np.array(grid.low[:2]) + np.array(grid.shape[:2]) * grid.voxel[:2]
    middle = pose[:, :3, 3].reshape(-1, 3)
    kept = np.array([kind in OBJECTS for kind in boxes.kinds], dtype=bool)
    kept &= np.all((middle[:, :2] >= reach[0]) & (middle[:, :2] < reach[1]), axis=1)
    kinds = [KINDS.index(OBJECTS[kind]) for kind, keep in zip(boxes.kinds, kept) if keep]
    return Truth(
        keys,
        labels,
        middle[kept],
        boxes.size[kept],
        np.arctan2(pose[kept, 1, 0], pose[kept, 0, 0]),
        boxes.instance[kept].astype(np.int64),
        np.array(kinds, np.int64),
        points_on(scan, boxes.instance[kept].astype(np.int64)),
        body,
    )


def points_on(scan: sightline.Scan, instances: I64) -> I64:
    """Points of a scan on each of some instances, ``[B]``.

    Told by what a beam met: ``Scan.boxes.points`` counts what lies within a box, as the devkit does, and of the points on
    a box's own faces rounding leaves out about half.
    """
    counts = np.bincount(scan.instance, minlength=int(instances.max(initial=0)) + 1)
    found: I64 = counts[instances].astype(np.int64)
    return found


def _behind(scan: sightline.Scan, kept: Bools) -> F64:
    # A hit's voxel is looked up a millimetre behind it, as the engine does.
    origins = np.array([lidar["ego_from_sensor"][:3, 3] for lidar in scan.lidars])
    xyz = scan.xyz[kept].astype(np.float64)
    along = xyz - origins[scan.lidar[kept]]
    behind: F64 = xyz + 1e-3 * along / np.linalg.norm(along, axis=1, keepdims=True)
    return behind


def cached(source: Source, sha256: str, frames: list[int], folder: Path) -> list[Truth]:
    """``truth_of``, kept in ``folder`` under the hash of all that it depends on; a broken file is made again.

    ``sha256`` is the source's ``digest``, which reads all of its meshes and so is not taken anew each time.
    """
    about = {"version": VERSION, "scene": sha256, "lidar": DENSE, "frames": frames, "groups": GROUPS}
    about["engine"] = sightline.__version__
    name = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()[:32]
    path = folder / f"{name}.npz"
    try:
        with np.load(path) as stored:
            return [
                Truth(**{field.name: stored[f"{n}.{field.name}"] for field in fields(Truth)})
                for n in range(len(frames))
            ]
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        found = truth_of(source, frames)
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {f"{n}.{field.name}": getattr(t, field.name) for n, t in enumerate(found) for field in fields(Truth)}
    beside = path.with_suffix(f".{os.getpid()}.tmp.npz")
    np.savez_compressed(beside, allow_pickle=False, **arrays)
    os.replace(beside, path)
    return found
