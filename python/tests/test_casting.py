"""Casts and scans against arithmetic and against Open3D."""

from __future__ import annotations

import numpy as np
import pytest

import sightline
from sightline import Scene, Status

POSE = [[0.0, 0.0, 1.5, 0.0, 0.0, 0.0]]


def test_rays_meet_what_stands_there(small) -> None:
    rays = np.array(
        [[0, 0, 1, 1, 0, 0], [0, 0, 1, 2, 0, 0], [0, 0, 1, 0, 0, -1], [0, 0, 1, -1, 0, 0], [0, 0, 1, 0, 0, 0]]
    )
    first = small.cast_rays(rays, frame=0)
    np.testing.assert_allclose(first["t_hit"], [4.5, 2.25, 1, np.inf, np.inf], atol=1e-5)
    assert [small.classes[k] if k >= 0 else None for k in first["class_ids"]] == [
        "vehicle", "vehicle", "ground", None, None,
    ]  # fmt: skip
    assert first["primitive_ids"][3] == -1 and first["primitive_ids"].dtype == first["class_ids"].dtype == np.int64
    assert small.cast_rays(rays, frame=1)["t_hit"][0] == pytest.approx(6.5)
    assert first["t_hit"].dtype == np.float32


def test_beams_are_the_rays_of_their_directions(scene, placements) -> None:
    hits = scene.cast(placements[:2], frame=3)
    assert len(hits["t_hit"]) == 2 * 4 * 4000
    assert np.unique(hits["placement"]).tolist() == [0, 1]
    assert np.unique(hits["lidar"]).tolist() == [0, 1, 2, 3]
    rays = np.hstack([hits["origin"], hits["direction"]])
    again = scene.cast_rays(rays, frame=3)
    near = hits["t_hit"] < 100
    assert 0.3 < near.mean() < 1
    np.testing.assert_allclose(again["t_hit"][near], hits["t_hit"][near], atol=2e-3)


def test_open3d_meets_the_same(scene) -> None:
    open3d = pytest.importorskip("open3d")
    mesh = scene.mesh(3)
    other = open3d.t.geometry.RaycastingScene()
    other.add_triangles(open3d.core.Tensor(mesh["vertices"]), open3d.core.Tensor(mesh["faces"]))
    rng = np.random.default_rng(7)
    rays = np.empty((100_000, 6), np.float32)
    rays[:, :3] = rng.uniform([-20, -20, 0.5], [20, 20, 4], (len(rays), 3))
    rays[:, 3:] = rng.normal(size=(len(rays), 3))
    ours, theirs = scene.cast_rays(rays, frame=3), other.cast_rays(open3d.core.Tensor(rays))
    theirs = {name: value.numpy() for name, value in theirs.items()}
    hit = np.isfinite(theirs["t_hit"])
    assert hit.mean() > 0.4
    # Where only one meets something, the ray passes within rounding of an edge of the mesh's rim.
    assert np.count_nonzero(hit != np.isfinite(ours["t_hit"])) <= 5
    both = hit & np.isfinite(ours["t_hit"])
    metres = {name: cast["t_hit"][both] * np.linalg.norm(rays[both, 3:], axis=1) for name, cast in
              (("ours", ours), ("theirs", theirs))}  # fmt: skip
    away = np.abs(metres["ours"] - metres["theirs"])
    # f32 at 120 m, and slopes of nearly grazing rays, leave a few above.
    assert np.count_nonzero(away > 1e-4 + 2e-6 * metres["theirs"]) <= 20
    # Another face is one that lies in the first or shares an edge with it: the distance is the same.
    other_face = ours["primitive_ids"][both] != theirs["primitive_ids"][both].astype(np.int64)
    assert away[other_face].max(initial=0) < 1e-3


def test_scans_yield_frames(small) -> None:
    scans = list(small.scan(POSE, ideal=True))
    assert [scan.frame for scan in scans] == [0, 1]
    first = scans[0]
    assert first.classes == small.classes
    assert len(first) > 20 and first.xyz.dtype == np.float32
    vehicle = small.classes.index("vehicle")
    on_crate = first.xyz[first.class_id == vehicle]
    np.testing.assert_allclose(on_crate[:, 0], 4.5, atol=1e-4)
    assert first.boxes.points[0] >= len(on_crate) > 0
    np.testing.assert_allclose(first.boxes.ego_from_box[0, :3, 3], [5, 0, 1], atol=1e-9)
    np.testing.assert_allclose(first.boxes.velocity[0], [10, 0, 0], atol=1e-6)
    assert first.lidars[0]["channels"] == 3
    everything = next(small.scan(POSE, ideal=True, misses=True))
    assert len(everything) == 96
    assert np.isnan(everything.xyz[everything.status == Status.MISS]).all()


def test_scans_are_the_same_whoever_asks(scene, placements) -> None:
    pair = placements[4]
    whole = [scan for scan in scene.scan(pair, conditions=["snow:rate=2"], seed=4)][5]
    alone = next(scene.scan(pair, conditions=["snow:rate=2"], seed=4, frames=[5]))
    assert alone.xyz.tobytes() == whole.xyz.tobytes()
    assert np.count_nonzero(alone.status == Status.SNOW) > 0
    other = next(scene.scan(pair, conditions=["snow:rate=2"], seed=5, frames=[5]))
    assert other.xyz.tobytes() != whole.xyz.tobytes()


def test_a_device_scans_to_the_same_bytes(scene, placements) -> None:
    by_device = Scene.load("scenes/industrial-yard.json", backend="gpu")
    for whole, device in zip(*(of.scan(placements[4], frames=[5]) for of in (scene, by_device)), strict=True):
        assert whole.xyz.tobytes() == device.xyz.tobytes()
        assert whole.intensity.tobytes() == device.intensity.tobytes()
    nowhere = Scene.load("scenes/industrial-yard.json", adapter="abacus")
    with pytest.raises(OSError, match="no Vulkan device named `abacus`"):
        next(nowhere.scan(placements[4]))


def test_an_iterator_may_be_left(scene, placements) -> None:
    for _ in range(20):
        next(scene.scan(placements[0]))


def test_psogs_from_points(small) -> None:
    scans = list(small.scan(POSE, ideal=True))
    psog = sightline.Psog.from_scans(
        [scan.xyz for scan in scans],
        [scan.class_id for scan in scans],
        [scan.world_from_ego for scan in scans],
        classes=small.classes,
        roi=[[-10, -10, -0.5], [10, 10, 3.5]],
        voxel=[0.5, 0.5, 0.5],
        moving=["vehicle"],
    )
    assert psog.frames == 2 and psog.shape == (40, 40, 8)
    counts = dict(zip(psog.classes, psog.counts.sum(axis=0)))
    # The crate's near face is 2 m wide, and stands once at 4.5 and once at 6.5 m.
    assert counts["vehicle"] > 0 and counts["ground"] % 2 == 0
    assert psog.entropy().max() == pytest.approx(np.log(2), abs=1e-6)


def test_sensors_from_files_and_words() -> None:
    spinning = sightline.Sensor.from_dict(
        {"channels": 2, "fov": [-10, 10], "azimuth_steps": 4, "range": 50}
    )
    up = np.sin(np.radians([-10, -10, -10, -10, 10, 10, 10, 10]))
    np.testing.assert_allclose(spinning.directions[:, 2], up, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(spinning.directions, axis=1), 1, atol=1e-6)
    assert spinning.range == 50
    with pytest.raises(ValueError, match="lidar: `fov` is missing"):
        sightline.Sensor.from_dict({"channels": 2, "azimuth_steps": 4, "range": 50})


def test_meshes_have_the_triangles_of_the_casts(scene: Scene, placements) -> None:
    mesh, hits = scene.mesh(3), scene.cast(placements[0], frame=3)
    hit = np.isfinite(hits["t_hit"])
    assert hits["primitive_ids"][hit].max() < len(mesh["faces"]) and hits["primitive_ids"].min() == -1
    faces = mesh["vertices"][mesh["faces"][hits["primitive_ids"][hit]]].astype(float)
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    point = hits["origin"][hit] + hits["t_hit"][hit, None] * hits["direction"][hit].astype(float)
    away = np.abs(np.einsum("nk,nk->n", point - faces[:, 0], normal))
    assert np.quantile(away, 0.999) < 1e-3
    assert np.array_equal(mesh["class_ids"][hits["primitive_ids"][hit]], hits["class_ids"][hit])
