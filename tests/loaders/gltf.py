"""Opens a glTF of `sightline cast`, `scan` or `optimize` with trimesh: triangles, hits and LiDARs as the command says.

    gltf.py FILE.glb SUMMARY.json PLACEMENTS.json [NAME]

SUMMARY.json is what `cast --gltf FILE.glb --format json` or `scene info --format json` printed. NAME: the file shows this
one of the placements; PLACEMENTS.json may also be the `result.json` of a run, whose best one is shown.
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


def main(file, summary, placements, name=None):
    warnings.simplefilter("error")
    logging.getLogger("trimesh").addHandler(Refuse(logging.WARNING))
    with open(summary) as f:
        told = json.load(f)
    told = told[0] if isinstance(told, list) else told
    with open(placements) as f:
        given = json.load(f)
    placements = [given["best"]["placement"]] if "best" in given else given["placements"]
    placements = [one for one in placements if name in (None, one["name"])]
    scene = trimesh.load(file)
    triangles = points = 0
    frusta = set()
    for node in scene.graph.nodes_geometry:
        geometry = scene.geometry[scene.graph[node][1]]
        if isinstance(geometry, trimesh.Trimesh):
            triangles += len(geometry.faces)
        elif isinstance(geometry, trimesh.PointCloud):
            points += len(geometry.vertices)
        elif isinstance(geometry, trimesh.path.Path3D):
            assert len(geometry.entities) > 0, node
            frusta.add(node)
    assert triangles == told["triangles"], (triangles, told["triangles"])
    assert points == told.get("hits", points), (points, told["hits"])
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
    wanted = {f"{p['name']} lidar {number} frustum" for p in placements for number in range(len(p["lidars"]))}
    assert frusta == wanted, frusta ^ wanted
    scene = told.get("scene", told.get("name"))
    print(f"{scene}: {triangles} triangles, {points} hits, {lidars} LiDARs with frusta within {worst:.0e}")


if __name__ == "__main__":
    main(*sys.argv[1:])
