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
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "sensor_msgs/CompressedImage": f"{_HEADER}string format\nuint8[] data",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data",
    "visualization_msgs/Marker": f"{_HEADER}string ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\nbool frame_locked\n\
geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\nsensor_msgs/CompressedImage texture\n\
visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\nvisualization_msgs/MeshFile mesh_file\n\
bool mesh_use_embedded_materials",
}
#: Columns of an outline of a field of view, and metres at which it ends.
_COLUMNS, _FAR = 36, 3.0
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
                lines = _outline(scene.sensors[lidar["model"]].directions)
                recording.log(f"{home}/lidar_{k}/field_of_view", rr.LineStrips3D(lines), static=True)
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
        markers = writer.register_msgdef("visualization_msgs/msg/MarkerArray", _definition("visualization_msgs/Marker[] markers"))
        tree = writer.register_msgdef("tf2_msgs/msg/TFMessage", _definition("geometry_msgs/TransformStamped[] transforms"))
        stamped = set()
        for name, is_first, scan in _scans(scene, placements, options):
            time = round(scan.time * 1e9)
            if is_first:
                poses = enumerate(lidar["ego_from_sensor"] for lidar in scan.lidars)
                frames = [_edge(0, "base_link", f"{name}/lidar_{k}", pose) for k, pose in poses]
                writer.write_message("/tf_static", tree, {"transforms": frames}, log_time=0)
                views = [_marker(scene, name, k, lidar["model"]) for k, lidar in enumerate(scan.lidars)]
                writer.write_message(f"/{name}/fields_of_view", markers, {"markers": views}, log_time=0)
            if time not in stamped:
                stamped.add(time)
                edge = _edge(time, "map", "base_link", scan.world_from_ego)
                writer.write_message("/tf", tree, {"transforms": [edge]}, log_time=time)
            writer.write_message(f"/{name}/points", cloud, _cloud(time, scan), log_time=time)
        writer.finish()


def _outline(directions: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
    """Lines `[points, 3]` round a field of view in the sensor's frame: its lower and upper edge, and what joins the sensor to
    them."""
    column = np.floor((np.arctan2(directions[:, 1], directions[:, 0]) / (2 * np.pi) + 0.5) * _COLUMNS).astype(int) % _COLUMNS
    seen = np.unique(column)
    # From the first column behind the widest gap on: a field of view may look to the rear.
    gaps = np.diff(seen, prepend=seen[-1] - _COLUMNS)
    is_round = len(seen) == _COLUMNS
    seen = seen if is_round else np.roll(seen, -int(gaps.argmax()))
    below, above = [], []
    for one in seen:
        beams = directions[column == one]
        below.append(_FAR * beams[beams[:, 2].argmin()])
        above.append(_FAR * beams[beams[:, 2].argmax()])
    joined = range(0, len(seen), _COLUMNS // 4) if is_round else (0, len(seen) - 1)
    spokes = [np.array([below[k], np.zeros(3), above[k]]) for k in joined]
    closed = [0] if is_round else []
    return [np.array([edge[k] for k in [*range(len(seen)), *closed]]) for edge in (below, above)] + spokes


def _marker(scene: Scene, name: str, lidar: int, model: str) -> dict[str, Any]:
    """The outline of a field of view as pairs of points, a `LINE_LIST`."""
    lines = _outline(scene.sensors[model].directions)
    pairs = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines]).reshape(-1, 3)
    place, turn = dict.fromkeys("xyz", 0.0), dict.fromkeys("xyz", 0.0) | {"w": 1.0}
    nothing = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    return {
        "header": _header(0, f"{name}/lidar_{lidar}"), "ns": name, "id": lidar, "type": 5, "action": 0,
        "pose": {"position": place, "orientation": turn}, "scale": {"x": 0.02, "y": 0.0, "z": 0.0},
        "color": {"r": 0.18, "g": 0.49, "b": 0.74, "a": 1.0}, "lifetime": {"sec": 0, "nanosec": 0}, "frame_locked": True,
        "points": [dict(zip("xyz", point)) for point in pairs.tolist()], "colors": [], "texture_resource": "",
        "texture": {"header": nothing, "format": "", "data": b""}, "uv_coordinates": [], "text": "", "mesh_resource": "",
        "mesh_file": {"filename": "", "data": b""}, "mesh_use_embedded_materials": False,
    }  # fmt: skip


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
