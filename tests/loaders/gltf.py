"""Opens a glTF of `sightline cast` with trimesh: triangles, hits and LiDARs as the command says.

    gltf.py FILE.glb SUMMARY.json PLACEMENTS.json

SUMMARY.json is what `cast --gltf FILE.glb --format json` printed.
"""

import json
import logging
import sys
import warnings

import numpy as np
import trimesh


class Refuse(logging.Handler):
    """Makes an error of every warning that is logged."""

    def emit(self, record):
        raise AssertionError(record.getMessage())


def rotation(roll, pitch, yaw):
    """Rz(yaw) Ry(pitch) Rx(roll)."""
    cx, sx, cy, sy, cz, sz = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return z @ y @ x


def main(file, summary, placements):
    warnings.simplefilter("error")
    logging.getLogger("trimesh").addHandler(Refuse(logging.WARNING))
    with open(summary) as f:
        told = json.load(f)
    with open(placements) as f:
        placements = json.load(f)["placements"]
    scene = trimesh.load(file)
    triangles = points = 0
    for node in scene.graph.nodes_geometry:
        geometry = scene.geometry[scene.graph[node][1]]
        if isinstance(geometry, trimesh.Trimesh):
            triangles += len(geometry.faces)
        elif isinstance(geometry, trimesh.PointCloud):
            points += len(geometry.vertices)
    assert triangles == told["triangles"], (triangles, told["triangles"])
    assert points == told["hits"], (points, told["hits"])
    # glTF has left, up, forward.
    iso_from_gltf = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    lidars = worst = 0
    for placement in placements:
        for number, lidar in enumerate(placement["lidars"]):
            matrix, _ = scene.graph[f"{placement['name']} lidar {number}"]
            found = iso_from_gltf @ matrix[:3]
            at = [lidar[key] for key in "xyz"]
            turn = rotation(*(lidar.get(key, 0.0) for key in ("roll", "pitch", "yaw")))
            worst = max(worst, abs(found[:, 3] - at).max(), abs(found[:, :3] - turn).max())
            lidars += 1
    assert lidars and worst < 1e-6, (lidars, worst)
    print(f"{told['scene']}: {triangles} triangles, {points} hits, {lidars} LiDARs within {worst:.0e}")


if __name__ == "__main__":
    main(*sys.argv[1:])
