"""Redundancy and overlap against counts in NumPy, and those of the program."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sightline
from sightline import Scene

YARD = "scenes/industrial-yard.json"
RIG = "Pyramid-roll"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene.load(YARD, backend="cpu", frames=1)


def row(kind: str, tmp_path: Path, *more: str) -> Any:
    """The row that the program prints for the rig."""
    placements = json.loads(Path("scenes/placements.json").read_text())["placements"]
    file = tmp_path / "rig.json"
    file.write_text(json.dumps({"placements": [p for p in placements if p["name"] == RIG]}))
    done = subprocess.run(
        [sys.executable, "-m", "sightline", "study", kind, YARD, str(file), "--frames", "1", "--backend", "cpu",
         "--format", "json", *more],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["rows"][0]


def test_voxels_by_the_number_of_lidars(scene: Scene, rig: sightline.Placement, tmp_path: Path) -> None:
    found = scene.redundancy(rig)
    shape = np.array(scene.psog.shape)
    seers = np.zeros(shape.prod(), np.int64)
    for pose in rig.poses:
        seers[scene.covered(pose[None])] += 1
    for key, of in [("voxels", seers), ("occupied", seers[scene.psog.index])]:
        by = np.bincount(np.minimum(of, 3), minlength=4)
        assert found[key]["by"] == by.tolist() and by.min() > 100
        assert found[key]["share"] == pytest.approx(by / len(of), abs=1e-12)
    assert found == row("redundancy", tmp_path)
    one = scene.redundancy(rig, targets=["pole"])
    assert [of["target"] for of in one["targets"]] == ["pole"]
    with pytest.raises(ValueError, match="did you mean `child`"):
        scene.redundancy(rig, targets=["chidl"])
    with pytest.raises(ValueError, match=r"^targets: is 'car'; give a list of texts"):
        scene.redundancy(rig, targets="car")


def test_cones_by_technology(tmp_path: Path) -> None:
    """Ground within a camera's sector of an empty plane, on a rig whose LiDAR looks up."""
    camera = {"name": "eye", "technology": "camera", "x": 1.1, "y": 0, "z": 1, "yaw": 0.3, "fov": [90, 180], "range": 40}
    vehicle = {
        "body": [{"class": "vehicle", "box": {"min": [-1, -1, 0.2], "max": [1, 1, 1.5]}}],
        "sensors": [{"name": "up", "lidar": {"channels": 2, "fov": [30, 40], "azimuth_steps": 4, "range": 30}}],
        "mounts": [{"name": "top", "min": [-1, -1, 1], "max": [1, 1, 3], "count": 1}],
        "other_sensors": [camera],
    }
    description = {
        "sightline": 1, "name": "plane", "frames": 1, "coverage": "first-hit", "classes": ["road", "vehicle"],
        "vehicle": vehicle, "psog": {"scan": {"window": 2, "stride": 1}},
        "roi": {"min": [-12, -12, -0.5], "max": [12, 12, 2.5], "voxel": [1, 1, 1]},
        "static": [{"class": "road", "plane": {"min": [-50, -50], "max": [50, 50], "z": 0}}],
    }  # fmt: skip
    file = tmp_path / "plane.json"
    file.write_text(json.dumps(description))
    found = Scene.load(file, backend="cpu").redundancy(np.array([[0, 0, 2, 0, 0, 0]]), targets=["car"])
    x, y = np.meshgrid(np.arange(-48, 48) * 0.25 + 0.125, np.arange(-48, 48) * 0.25 + 0.125)
    distance = np.hypot(np.maximum(np.abs(x) - 1, 0), np.maximum(np.abs(y) - 1, 0))
    near = (distance > 0) & (distance <= 10)
    # 45° to either side of 0.3 rad: the body ends behind the camera.
    sector = np.abs(np.degrees(np.arctan2(y, x - 1.1) - 0.3)) <= 45
    seen = float((near & sector).sum())
    ground = found["technologies"]["ground_10m"]
    assert ground["by"] == [near.sum() - seen, seen, 0, 0] and seen > 500
    assert [(of["technology"], of["count"]) for of in ground["each"]] == [("lidar", 0), ("camera", seen)]
    assert [of["target"] for of in found["technologies"]["targets"]] == ["car"]


def test_shared_surfaces_and_directions(scene: Scene, rig: sightline.Placement, tmp_path: Path) -> None:
    found = scene.overlap(rig, least_shared=200)
    hits = scene.cast(rig)
    is_hit = np.isfinite(hits["t_hit"]) & (hits["primitive_ids"] < len(scene.mesh(body=False)["faces"]))
    distance = hits["t_hit"][is_hit, None].astype(float) + 1e-3
    points = hits["origin"][is_hit] + hits["direction"][is_hit].astype(float) * distance
    voxels = np.floor((points - scene.psog.roi_min) / scene.psog.voxel)
    count = len(rig.poses)
    surfaces = []
    for lidar in range(count):
        own = voxels[hits["lidar"][is_hit] == lidar]
        inside = ((own >= 0) & (own < scene.psog.shape)).all(1)
        surfaces.append({tuple(voxel) for voxel in own[inside].tolist()})
    wanted = np.array([[len(a & b) for b in surfaces] for a in surfaces])
    # Hits on the face between two voxels are rounded to either side.
    assert np.abs(found["shared_voxels"] - wanted).max() <= 0.01 * wanted.max() and wanted.min() > 200
    # Directions at random, turned into each sensor's frame: within the elevations of its channels.
    random = np.random.default_rng(1).normal(size=(200_000, 3))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    held = []
    for lidar in range(count):
        roll, pitch, yaw = rig.poses[lidar, 3:]
        [sr, sp, sy], [cr, cp, cy] = np.sin([roll, pitch, yaw]), np.cos([roll, pitch, yaw])
        up = [cr * sp * cy + sr * sy, cr * sp * sy - sr * cy, cr * cp]
        elevation = np.degrees(np.arcsin(random @ up))
        held.append((elevation >= -24.8) & (elevation <= 2.0))
    shares = np.array([[(a & b).mean() for b in held] for a in held])
    assert np.abs(found["shared_directions"] - shares).max() < 5e-3
    assert found["connected"] and found["connected_up_to"] >= 200 and found["cut_off"] == []
    assert found == row("overlap", tmp_path, "--least-shared", "200")
    assert not scene.overlap(rig, least_shared=10**9)["connected"]
    with pytest.raises(ValueError, match="has 1 LiDAR.*; add a second LiDAR"):
        scene.overlap(rig.poses[:1])
    with pytest.raises(ValueError, match="least_shared: is 0; give"):
        scene.overlap(rig, least_shared=0)
