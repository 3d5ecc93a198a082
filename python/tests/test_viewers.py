"""Scans in files and viewers of others, read again by readers of others; plots."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sightline

from .conftest import POSE, SMALL

#: Columns of a file beside x, y, z.
COLUMNS = ["range", "intensity", "time_offset", "incidence", "lidar", "ring", "column", "class_id",
           "clean_class_id", "instance", "status"]  # fmt: skip
PLACEMENTS = [sightline.Placement(POSE, name="low"), sightline.Placement(POSE + [0, 0, 0.3, 0, 0.1, 0.4], name="high")]


@pytest.fixture
def moving() -> sightline.Scene:
    """The small scene with a vehicle that turns and climbs."""
    poses = [{"x": 1, "y": 2, "z": 0, "yaw": 0.5}, {"x": 2, "y": 3, "z": 0.5, "yaw": 2.5, "roll": 0.2, "pitch": -0.3}]
    return sightline.Scene.from_dict(SMALL | {"ego": {"poses": poses}}, backend="cpu")


def first(scene: sightline.Scene) -> sightline.Scan:
    scan = next(scene.scan(PLACEMENTS[0], frames=[0]))
    assert len(scan) > 10 and len(set(scan.class_id)) == 2
    return scan


def read_ply(file: Path) -> dict[str, np.ndarray]:
    """By the definition of the format."""
    header, _, body = file.read_bytes().partition(b"end_header\n")
    lines = header.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    kinds = {"float": "<f4", "int": "<i4", "uchar": "u1"}
    types = [(words[2], kinds[words[1]]) for words in map(str.split, lines) if words[0] == "property"]
    rows = np.frombuffer(body, np.dtype(types))
    assert lines[2] == f"element vertex {len(rows)}"
    return {name: rows[name] for name, _ in types}


def same_columns(scan: sightline.Scan, found: Any, *, widened: bool = False) -> None:
    for name in COLUMNS:
        own = getattr(scan, name)
        theirs = np.asarray(found[name])
        assert np.array_equal(theirs.reshape(-1), own), name
        assert theirs.dtype == (np.int32 if widened and own.dtype in (np.uint16, np.uint32) else own.dtype), name


def test_ply_has_every_column(small: sightline.Scene, tmp_path: Path) -> None:
    scan = first(small)
    scan.save(tmp_path / "scan.ply")
    found = read_ply(tmp_path / "scan.ply")
    assert np.array_equal(np.column_stack([found[axis] for axis in "xyz"]), scan.xyz)
    same_columns(scan, found, widened=True)
    with pytest.raises(ValueError, match="give .ply or .pcd"):
        scan.save(tmp_path / "scan.las")
    with pytest.raises(FileNotFoundError):
        scan.save(tmp_path / "missing" / "scan.ply")
    assert [file.name for file in tmp_path.iterdir()] == ["scan.ply"]


@pytest.mark.parametrize("ending", ["ply", "pcd"])
def test_open3d_reads_the_files(small: sightline.Scene, tmp_path: Path, ending: str) -> None:
    open3d = pytest.importorskip("open3d")
    scan = first(small)
    scan.save(str(tmp_path / f"scan.{ending}"))
    cloud = open3d.t.io.read_point_cloud(str(tmp_path / f"scan.{ending}"))
    assert np.array_equal(cloud.point.positions.numpy(), scan.xyz)
    for name in COLUMNS:
        assert np.array_equal(cloud.point[name].numpy().reshape(-1), getattr(scan, name)), name


def test_objects_of_open3d_and_pyvista_have_every_column(small: sightline.Scene) -> None:
    scan = first(small)
    if importlib.util.find_spec("open3d"):
        cloud = scan.to_open3d()
        assert np.array_equal(cloud.point.positions.numpy(), scan.xyz)
        same_columns(scan, {name: cloud.point[name].numpy() for name in COLUMNS})
    pytest.importorskip("pyvista")
    mesh = scan.to_pyvista()
    assert np.array_equal(mesh.points, scan.xyz)
    same_columns(scan, mesh.point_data)


def test_mcap_is_read_again_by_rosbags(moving: sightline.Scene, tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    rosbags = pytest.importorskip("rosbags.highlevel")
    from rosbags.typesys import Stores, get_typestore

    moving.to_mcap(PLACEMENTS, tmp_path / "scans.mcap", seed=3)
    own = {(p.name, scan.frame): scan for p in PLACEMENTS for scan in moving.scan(p, seed=3)}
    clouds, edges, views = {}, {}, {}
    with rosbags.AnyReader([tmp_path / "scans.mcap"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic.endswith("/points"):
                clouds[connection.topic.split("/")[1], round(time * 5 / 1e9)] = message
            elif connection.topic.endswith("/fields_of_view"):
                views |= {marker.header.frame_id: marker for marker in message.markers}
            else:
                for edge in message.transforms:
                    key = edge.header.frame_id, edge.child_frame_id, round(time * 5 / 1e9)
                    assert key not in edges, "tf2 warns of transforms that come twice"
                    edges[key] = edge
    assert clouds.keys() == own.keys()
    kinds = {2: "u1", 4: "<u2", 6: "<u4", 7: "<f4"}
    for key, cloud in clouds.items():
        layout = {
            "names": [f.name for f in cloud.fields],
            "formats": [kinds[f.datatype] for f in cloud.fields],
            "offsets": [f.offset for f in cloud.fields],
            "itemsize": cloud.point_step,
        }
        rows, scan = np.frombuffer(cloud.data.tobytes(), np.dtype(layout)), own[key]
        assert cloud.header.frame_id == "base_link" and cloud.width == len(scan)
        assert cloud.header.stamp.sec + cloud.header.stamp.nanosec / 1e9 == pytest.approx(scan.time)
        assert np.array_equal(np.column_stack([rows[axis] for axis in "xyz"]), scan.xyz)
        same_columns(scan, rows)
        assert np.allclose(matrix(edges["map", "base_link", key[1]].transform), scan.world_from_ego, atol=1e-12)
        static = edges["base_link", f"{key[0]}/lidar_0", 0].transform
        assert np.allclose(matrix(static), scan.lidars[0]["ego_from_sensor"], atol=1e-12)
        drawn = np.array([[point.x, point.y, point.z] for point in views[f"{key[0]}/lidar_0"].points])
        goes_round(drawn, moving.sensors[scan.lidars[0]["model"]].directions)


def goes_round(points: np.ndarray, directions: np.ndarray) -> None:
    """Points of an outline lie on beams, 3 m away or in the sensor, the lowest and the highest beam among them."""
    away = points[np.linalg.norm(points, axis=1) > 0] / 3
    assert 0 < len(away) < len(points) and (away @ directions.T).max(axis=1) == pytest.approx(1, abs=1e-6)
    assert [away[:, 2].min(), away[:, 2].max()] == pytest.approx([directions[:, 2].min(), directions[:, 2].max()])


def matrix(transform: Any) -> np.ndarray:
    """Homogeneous matrix of a ROS transform, by the formula for unit quaternions."""
    x, y, z, w = (getattr(transform.rotation, axis) for axis in "xyzw")
    found = np.eye(4)
    found[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    found[:3, 3] = [getattr(transform.translation, axis) for axis in "xyz"]
    return found


def test_recordings_need_names_and_leave_no_half_file(small: sightline.Scene, tmp_path: Path) -> None:
    for package, write in [("mcap_ros2", small.to_mcap), ("rerun", small.to_rerun)]:
        pytest.importorskip(package)
        for wrong in ([], [PLACEMENTS[0], PLACEMENTS[0]]):
            with pytest.raises(ValueError, match="name"):
                write(wrong, tmp_path / "scans")
        with pytest.raises(ValueError, match="frames"):
            write(PLACEMENTS, tmp_path / "scans", frames=[9])
        assert not list(tmp_path.iterdir())


def test_rerun_recordings_hold_points_boxes_and_poses(moving: sightline.Scene, tmp_path: Path) -> None:
    rerun = pytest.importorskip("rerun.chunk")
    moving.to_rerun(PLACEMENTS, tmp_path / "scans.rrd", frames=[1, 0], seed=3)
    points, poses, boxes, views = {}, {}, {}, {}
    for chunk in rerun.RrdReader(tmp_path / "scans.rrd").stream():
        entity, rows = chunk.entity_path, chunk.to_record_batch().to_pydict()
        frames = rows.get("frame", [None])
        for k, frame in enumerate(frames):
            row = {name: values[k] for name, values in rows.items()}
            if entity.endswith("/points"):
                points[entity.split("/")[3], frame] = row
            elif entity.endswith("/boxes"):
                boxes[frame] = row
            elif entity.endswith("/field_of_view"):
                views[entity.split("/")[3], entity.split("/")[4]] = np.concatenate(row["LineStrips3D:strips"])
            else:
                poses[entity, frame] = row
    own = {(p.name, scan.frame): scan for p in PLACEMENTS for scan in moving.scan(p, seed=3)}
    assert points.keys() == own.keys() and boxes.keys() == {0, 1}
    for key, scan in own.items():
        row = points[key]
        assert np.array_equal(row["Points3D:positions"], scan.xyz)
        assert np.array_equal(row["Points3D:class_ids"], scan.class_id)
        ego = poses["/world/ego", key[1]]
        assert np.allclose(ego["Transform3D:translation"], scan.world_from_ego[:3, 3])
        assert np.allclose(np.reshape(ego["Transform3D:mat3x3"], (3, 3)).T, scan.world_from_ego[:3, :3])
        lidar = poses[f"/world/ego/{key[0]}/lidar_0", None]
        assert np.allclose(lidar["Transform3D:translation"], scan.lidars[0]["ego_from_sensor"][:3, 3])
        goes_round(views[key[0], "lidar_0"], moving.sensors[scan.lidars[0]["model"]].directions)
        assert np.allclose(boxes[key[1]]["Boxes3D:centers"], scan.boxes.ego_from_box[:, :3, 3])
        assert np.allclose(boxes[key[1]]["Boxes3D:half_sizes"], scan.boxes.size / 2)


def test_plots_show_what_the_results_say(scene: sightline.Scene, placements: list[sightline.Placement]) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from sightline import plot

    scores = scene.score(placements[:3], near_field=True)
    bars = [bar.get_width() for bar in plot.near_field(scores).patches]
    assert np.allclose(bars, 100 * np.concatenate([scores["near_ring"], scores["near_field"]]))
    card = scene.range_card(placements[0])
    card["targets"][0]["bearings"][3]["met"] = []
    axes = plot.range_card(card)
    assert [line.get_label() for line in axes.lines] == ["car", "adult", "tyre"]
    for line, target in zip(axes.lines, card["targets"]):
        farthest = [at["met"][-1][1] if at["met"] else 0 for at in target["bearings"]]
        assert line.get_ydata().tolist() == [*farthest, farthest[0]] and max(farthest) > 0
        assert np.allclose(np.degrees(line.get_xdata()[:-1]), [at["bearing"] for at in target["bearings"]])
    result = sightline.optimize(scene, evaluations=24, method="cma", frames=1, tolerance=None)
    drawn = plot.convergence(result).lines[0]
    assert drawn.get_ydata().tolist() == [record["best_so_far"] for record in result.history]
    assert drawn.get_xdata()[-1] == result.history[-1]["evaluations"]
    values = [[0.5, 3.0], [0.4, 2.0]]
    front = sightline.Front(["near_gain", "price"], placements[:2], values, [3, 2], [True, True], {"knee": 1}, scores, {})
    axes = plot.front(front)
    assert axes.lines[0].get_xydata().tolist() == values and axes.texts[0].get_text() == "knee"
    assert list(axes.texts[0].xy) == [0.4, 2.0] and axes.get_xlabel() == "near_gain"


@pytest.mark.parametrize(("call", "package", "extra"), [
    (lambda scan: scan.to_open3d(), "open3d", "open3d"),
    (lambda scan: scan.to_pyvista(), "pyvista", "pyvista"),
    (lambda scan: sightline.plot.convergence(None), "matplotlib.pyplot", "plot"),
])  # fmt: skip
def test_what_is_missing_names_the_extra(
    small: sightline.Scene, monkeypatch: pytest.MonkeyPatch, call: Any, package: str, extra: str
) -> None:
    importlib.import_module("sightline.plot")
    monkeypatch.setitem(__import__("sys").modules, package, None)
    with pytest.raises(ImportError, match=rf"{package}.*sightline-lidar\[{extra}\]"):
        call(first(small))


def test_examples_are_the_projects_scenes() -> None:
    scenes = Path("scenes")
    own = sorted(str(file.relative_to(scenes).with_suffix("")) for file in scenes.rglob("*.json"))
    assert sightline.examples.names() == own
    for name in sightline.examples.names():
        assert sightline.examples.path(name).read_bytes() == (scenes / f"{name}.json").read_bytes()
    assert sightline.Scene.load(sightline.examples.path("urban-crossing"), backend="cpu").name == "urban-crossing"
    with pytest.raises(ValueError, match="urban-crossing"):
        sightline.examples.path("urban")
