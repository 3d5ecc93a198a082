"""Throughput of one process and of actors, and what clusters would make of it: python beyond_one_machine.py SCENE.json…

Prints a table: seconds to build a scene's engine, placements a second of one thread and of two actors of one thread
each, and bytes of a placement's scores. From them it projects how long a million placements in a hundred scenes take on
clusters of some nodes. The projection assumes that speed grows in proportion to threads and nodes.
"""

import argparse
import pickle
import time

import ray

import sightline
from sightline import distributed


def measured(work) -> tuple[float, object]:
    start = time.perf_counter()
    value = work()
    return time.perf_counter() - start, value


def main() -> None:
    arguments = argparse.ArgumentParser()
    arguments.add_argument("scenes", nargs="+")
    arguments.add_argument("--placements", type=int, default=600)
    arguments.add_argument("--frames", type=int, default=4)
    arguments.add_argument("--nodes", type=int, nargs="+", default=[1, 8, 64])
    arguments.add_argument("--cores", type=int, default=16, help="of each node")
    given = arguments.parse_args()
    sightline.set_threads(1)
    load = [sightline.Scene.load(path, frames=given.frames, backend="cpu") for path in given.scenes]
    poses = load[0].random_poses(given.placements, seed=1)
    build, _ = measured(lambda: [scene.score(poses[:1]) for scene in load])
    one, scores = measured(lambda: [scene.score(poses) for scene in load])
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False)
    rates = []
    for actors in (1, 2):
        told: list[distributed.Progress] = []
        spread = distributed.score(load, poses, actors=actors, threads=1, progress=told.append)
        assert spread == scores, "actors gave other bits"
        # From the first quarter on: engines are built before.
        last = told[-1]
        first = next(event for event in told if event.done >= last.done / 4)
        rates.append((last.done - first.done) / max(last.seconds - first.seconds, 1e-9))
    ray.shutdown()
    work = given.placements * len(load)
    chunk = len(pickle.dumps(scores[0])) / given.placements
    print(f"placements x scenes {work}, {given.frames} frames each")
    print(f"engine of a scene, s              {build / len(load):.2f}")
    print(f"one process, one thread, /s       {work / one:.1f}")
    print(f"one actor of one thread, /s       {rates[0]:.1f}")
    print(f"two actors of one thread, /s      {rates[1]:.1f} = {rates[1] / rates[0] / 2:.2f} of twice one")
    print(f"bytes of a placement's scores     {chunk:.0f}")
    print(f"10^6 placements x 100 scenes, {1e8 * chunk / 1e9:.0f} GB of scores, on nodes of {given.cores} cores:")
    for nodes in given.nodes:
        rate = rates[0] * nodes * given.cores
        hours = (1e8 / rate + 100 / nodes * build / len(load)) / 3600
        sent = f"{rate * chunk / 1e6:.2f} MB/s and {nodes / distributed.CHUNK_SECONDS:.1f} chunks/s to the driver"
        print(f"{nodes:4} nodes {rate:8.0f}/s {hours:7.2f} h, {sent}")


if __name__ == "__main__":
    main()
