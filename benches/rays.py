"""Rays of one's own beside Open3D and trimesh with embreex: CPU time of both over ours, so above 1 ours is faster.

    pip install ./python open3d trimesh embreex
    sightline scene new --kind town --seed 1 --out town.json
    python benches/rays.py THREADS scenes/urban-crossing.json town.json

A million rays a mesh. "random": from a sphere around the mesh to points of its box; "scan": 64 rings from one place. The
least of six turns of each, interleaved. Meshes: two spheres, a torus knot, and frame 0 of each scene given.
"""

import sys
import time
from functools import partial

import numpy as np
import open3d
import sightline
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector

RAYS = 1_000_000
TURNS = 6
RINGS = 64
# Box around the vehicle of a scene at which rays are aimed, metres.
AIMED_AT = np.array([[-60, -60, 0], [60, 60, 15]])


def directions(rng, count):
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def random_rays(low, high):
    rng = np.random.default_rng(1)
    radius = 0.6 * np.linalg.norm(high - low)
    origins = (low + high) / 2 + radius * directions(rng, RAYS)
    towards = low + (high - low) * rng.random((RAYS, 3)) - origins
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    return np.hstack([origins, towards]).astype(np.float32)


def scan_rays(origin):
    elevation = np.radians(np.linspace(-25, 15, RINGS))[:, None]
    azimuth = np.linspace(0, 2 * np.pi, RAYS // RINGS, endpoint=False)[None]
    parts = np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation) + 0 * azimuth
    towards = np.stack(parts, -1).reshape(-1, 3)
    return np.hstack([np.broadcast_to(origin, towards.shape), towards]).astype(np.float32)


def torus_knot(along=1600, around=160):
    """A tube of radius 0.4 along the (2, 3) torus knot."""
    u = np.linspace(0, 2 * np.pi, along, endpoint=False)
    wide = 2 + np.cos(3 * u)
    middle = np.stack([wide * np.cos(2 * u), wide * np.sin(2 * u), -np.sin(3 * u)], 1)
    forward = np.roll(middle, -1, 0) - np.roll(middle, 1, 0)
    across = np.cross(forward, [0, 0, 1.0])
    up = np.cross(forward, across)
    across, up = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (across, up))
    turn = np.linspace(0, 2 * np.pi, around, endpoint=False)[None, :, None]
    vertices = middle[:, None] + 0.4 * (np.cos(turn) * across[:, None] + np.sin(turn) * up[:, None])
    i, j = np.arange(along)[:, None], np.arange(around)[None]
    number = lambda i, j: (i % along) * around + j % around
    a, b, c, d = number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)
    faces = [np.stack(corners, -1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))]
    return vertices.reshape(-1, 3), np.concatenate(faces)


def meshes(scenes):
    """Name, vertices, faces, caster of ours, lowest and highest point aimed at, and where scans begin."""
    spheres = [trimesh.creation.icosphere(subdivisions) for subdivisions in (3, 8)]
    plain = [("icosphere", sphere.vertices, sphere.faces) for sphere in spheres] + [("torus knot", *torus_knot())]
    for name, vertices, faces in plain:
        vertices, faces = np.asarray(vertices, np.float32), np.asarray(faces, np.uint32)
        caster = sightline.Raycaster(vertices, faces)
        yield name, vertices, faces, caster, vertices.min(0), vertices.max(0), [0, 0, 0]
    for path in scenes:
        scene = sightline.Scene.load(path, frames=1)
        mesh = scene.mesh(0)
        vertices, faces = (np.asarray(mesh[key]) for key in ("vertices", "faces"))
        low, high = np.maximum(vertices.min(0), AIMED_AT[0]), np.minimum(vertices.max(0), AIMED_AT[1])
        yield path, vertices, faces, scene, low, high, [0, 0, 2]


def cpu_seconds(call):
    begin = time.process_time()
    call()
    return time.process_time() - begin


def main(threads, scenes):
    sightline.set_threads(threads)
    for name, vertices, faces, ours, low, high, origin in meshes(scenes):
        rival = open3d.t.geometry.RaycastingScene(nthreads=threads)
        rival.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(faces))
        embree = RayMeshIntersector(trimesh.Trimesh(vertices, faces, process=False))
        for kind, rays in (("random", random_rays(low, high)), ("scan", scan_rays(origin))):
            tensor = open3d.core.Tensor(rays)
            origins, towards = rays[:, :3].astype(float), rays[:, 3:].astype(float)
            calls = [
                partial(ours.cast_rays, rays),
                partial(rival.cast_rays, tensor, nthreads=threads),
                partial(embree.intersects_first, origins, towards),
            ]
            turns = [[cpu_seconds(call) for call in calls] for _ in range(TURNS)]
            own, of_open3d, of_embree = np.min(turns, axis=0)
            print(
                f"{name}, {len(faces)} triangles, {kind}: {1e9 * own / len(rays):.0f} ns a ray, "
                f"Open3D {of_open3d / own:.2f}, embreex {of_embree / own:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
