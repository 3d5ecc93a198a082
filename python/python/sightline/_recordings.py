"""Scans of placements over time as recordings of Rerun and of ROS 2."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import Placement, Scan, Scene
from ._clouds import table, whole
from ._extra import load
from ._progress import shown

if TYPE_CHECKING:
    Given = Placement | list[Placement] | tuple[Placement, ...]

#: ``datatype`` of ``sensor_msgs/PointField`` by NumPy's type.
_FIELD = {"u1": 2, "u2": 4, "u4": 6, "f4": 7}
_HEADER = "std_msgs/Header header\n"
_DEFINITIONS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "sensor_msgs/PointField": "string name\nuint32 offset\nuint8 datatype\nuint32 count",
    "geometry_msgs/TransformStamped": f"{_HEADER}string child_frame_id\ngeometry_msgs/Transform transform",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
}
_CLOUD = f"{_HEADER}uint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n\
uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense"


def _scans(scene: Scene, placements: Given, options: dict[str, Any]) -> Iterator[tuple[str, bool, Scan]]:
    """Each scan with the name of its placement and whether it is the first of it."""
    placements = [placements] if isinstance(placements, Placement) else list(placements)
    names = [placement.name for placement in placements]
    if not names or len(set(names)) < len(names):
        raise ValueError(f"placements: have the names {names}; give one or several, each of a name of its own")
    options = dict(options)
    with shown(options.pop("progress", None)) as step:
        total, done = len(placements) * _count(scene, options.get("frames")), 0
        for placement in placements:
            for k, scan in enumerate(scene.scan(placement, **options)):
                step("scans", done, total)
                yield placement.name, k == 0, scan
                done += 1
        step("scans", done, total)


def _count(scene: Scene, frames: Any) -> int:
    """Frames that a scan with this argument has; 0 where the scan will refuse it."""
    if frames is None:
        return scene.frames
    try:
        return len(frames)
    except TypeError:
        return min(int(frames), scene.frames) if isinstance(frames, (int, float)) else 0


def to_rerun(scene: Scene, placements: Given, path: str | os.PathLike[str], options: dict[str, Any]) -> None:
    """See :meth:`Scene.to_rerun`."""
    rr = load("rerun", "rerun")
    named = [rr.AnnotationInfo(k, name) for k, name in enumerate(scene.classes)]
    with whole(Path(path)) as part, rr.RecordingStream("sightline") as recording:
        recording.save(part)
        recording.log("/", rr.AnnotationContext(named), static=True)
        for name, is_first, scan in _scans(scene, placements, options):
            recording.set_time("frame", sequence=scan.frame)
            recording.set_time("time", duration=scan.time)
            recording.log("world/ego", _transform(rr, scan.world_from_ego))
            home, poses = f"world/ego/{name}", scan.boxes.ego_from_box
            for k, lidar in enumerate(scan.lidars if is_first else []):
                recording.log(f"{home}/lidar_{k}", _transform(rr, lidar["ego_from_sensor"]), static=True)
            recording.log(f"{home}/points", rr.Points3D(scan.xyz, class_ids=scan.class_id))
            turns = [_quaternion(pose) for pose in poses]
            boxes = rr.Boxes3D(sizes=scan.boxes.size, centers=poses[:, :3, 3], quaternions=turns, labels=scan.boxes.names)
            recording.log("world/ego/boxes", boxes)
        recording.disconnect()


def to_mcap(scene: Scene, placements: Given, path: str | os.PathLike[str], options: dict[str, Any]) -> None:
    """See :meth:`Scene.to_mcap`."""
    ros = load("mcap_ros2.writer", "mcap")
    with whole(Path(path)) as part, open(part, "wb") as file:
        writer = ros.Writer(file)
        cloud = writer.register_msgdef("sensor_msgs/msg/PointCloud2", _definition(_CLOUD))
        tree = writer.register_msgdef("tf2_msgs/msg/TFMessage", _definition("geometry_msgs/TransformStamped[] transforms"))
        stamped = set()
        for name, is_first, scan in _scans(scene, placements, options):
            time = round(scan.time * 1e9)
            if is_first:
                poses = enumerate(lidar["ego_from_sensor"] for lidar in scan.lidars)
                frames = [_edge(0, "base_link", f"{name}/lidar_{k}", pose) for k, pose in poses]
                writer.write_message("/tf_static", tree, {"transforms": frames}, log_time=0)
            if time not in stamped:
                stamped.add(time)
                edge = _edge(time, "map", "base_link", scan.world_from_ego)
                writer.write_message("/tf", tree, {"transforms": [edge]}, log_time=time)
            writer.write_message(f"/{name}/points", cloud, _cloud(time, scan), log_time=time)
        writer.finish()


def _definition(text: str) -> str:
    """A message definition with all that it may name behind it."""
    return "".join([text, *(f"\n{'=' * 80}\nMSG: {name}\n{its}" for name, its in _DEFINITIONS.items())])


def _header(time: int, frame: str) -> dict[str, Any]:
    return {"stamp": dict(zip(("sec", "nanosec"), divmod(time, 10**9))), "frame_id": frame}


def _edge(time: int, parent: str, child: str, pose: npt.NDArray[Any]) -> dict[str, Any]:
    transform = {"translation": dict(zip("xyz", pose[:3, 3].tolist())), "rotation": dict(zip("xyzw", _quaternion(pose)))}
    return {"header": _header(time, parent), "child_frame_id": child, "transform": transform}


def _cloud(time: int, scan: Scan) -> dict[str, Any]:
    rows = table(scan)
    fields = [
        {"name": name, "offset": field[1], "datatype": _FIELD[field[0].str[1:]], "count": 1}
        for name, field in (rows.dtype.fields or {}).items()
    ]
    shape = {"height": 1, "width": len(rows), "point_step": rows.itemsize, "row_step": rows.nbytes}
    rest = {"is_bigendian": False, "is_dense": True, "data": rows.tobytes()}
    return {"header": _header(time, "base_link"), "fields": fields} | shape | rest


def _transform(rr: Any, pose: npt.NDArray[Any]) -> Any:
    return rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])


def _quaternion(pose: npt.NDArray[Any]) -> list[float]:
    """``x, y, z, w`` of a pose's rotation: the eigenvector of Bar-Itzhack's matrix."""
    m = pose[:3, :3]
    k = np.empty((4, 4))
    k[:3, :3] = m + m.T - np.trace(m) * np.eye(3)
    k[:3, 3] = k[3, :3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    k[3, 3] = np.trace(m)
    found: list[float] = np.linalg.eigh(k)[1][:, -1].tolist()
    return found
