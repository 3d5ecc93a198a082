"""Times a peer's closest hits on the rays that speed.rs hands over.

    python peer.py open3d|trimesh INPUT THREADS

INPUT as in embree.c. For each line on stdin one pass over all rays; prints "seconds hits" for it, or
in words why there is none. Rays are built before, as the peer takes them.
"""

import sys
import time

SENSORS_AT_A_TIME = 64


def read(path):
    """Vertices, faces, a block of rays a group of sensors, and how far they go."""
    with open(path, "rb") as file:
        vertices, faces, sensors, directions = np.fromfile(file, np.uint32, 4)
        reach = np.fromfile(file, np.float32, 1)[0]
        take = lambda kind, *shape: np.fromfile(file, kind, np.prod(shape)).reshape(shape)
        vertices, faces = take(np.float32, vertices, 3), take(np.uint32, faces, 3)
        rows, directions = take(np.float32, sensors, 3, 4), take(np.float32, directions, 3)
    blocks = []
    for first in range(0, sensors, SENSORS_AT_A_TIME):
        part = rows[first : first + SENSORS_AT_A_TIME]
        rays = np.empty((len(part), len(directions), 6), np.float32)
        rays[..., :3] = part[:, None, :, 3]
        for k in range(3):
            x, y, z = (part[:, None, k, i] * directions[None, :, i] for i in range(3))
            rays[..., 3 + k] = x + y + z
        blocks.append(rays.reshape(-1, 6))
    return vertices, faces, blocks, reach


def open3d(vertices, faces, blocks, reach, threads):
    import open3d

    scene = open3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(open3d.core.Tensor(vertices), open3d.core.Tensor(faces))
    blocks = [open3d.core.Tensor(block) for block in blocks]

    def cast(block):
        distances = scene.cast_rays(block, nthreads=threads)["t_hit"].numpy()
        return lambda: np.count_nonzero(distances <= reach)

    return blocks, cast


def trimesh(vertices, faces, blocks, _reach, _threads):
    import trimesh

    if not trimesh.ray.has_embree:
        raise ImportError("trimesh has no embreex: pip install embreex")
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    blocks = [(block[:, :3].copy(), block[:, 3:].copy()) for block in blocks]

    def cast(block):
        triangles = mesh.ray.intersects_first(*block)
        return lambda: np.count_nonzero(triangles >= 0)

    return blocks, cast


try:
    import numpy as np

    peer = {"open3d": open3d, "trimesh": trimesh}[sys.argv[1]]
    blocks, cast = peer(*read(sys.argv[2]), int(sys.argv[3]))
except ImportError as why:
    print(why, flush=True)
    sys.exit()
for _ in sys.stdin:
    seconds, hits = 0.0, 0
    for block in blocks:
        start = time.perf_counter()
        count = cast(block)
        seconds += time.perf_counter() - start
        hits += count()
    print(seconds, hits, flush=True)
