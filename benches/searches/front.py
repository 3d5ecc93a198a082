"""The front of price and near gain: `optimize --front` beside NSGA-II of pymoo.

pip install ./python pymoo moocore; python3 -m benches.searches.front [--seeds 3] [--program FILE] [--out DIR]

The problem is the car on urban-crossing, with its requirement. NSGA-II gets the CPU seconds that ours took. Its
variables are, for each place of a mount, which sensor stands there, if any, and the pose; it searches over
--peer-frames and its last front is scored over all frames. A placement that breaks a rule, a guard or a
requirement is infeasible by what is missing. Hypervolume (moocore): price from the fullest equipment's downwards,
near gain from 0 upwards, as a share of that rectangle.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import resource
import sys
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

from .ours import called, doubts
from .problems import ROOT, Mount, mount_of
from .scoring import processor

SCENE, VEHICLE = ROOT / "scenes/urban-crossing.json", ROOT / "scenes/vehicles/car.json"
TOGETHER = 64


@dataclass(frozen=True)
class Place:
    """Room for one LiDAR on a mount: the sensors that may stand there, and poses."""

    sensors: tuple[str, ...]
    mount: Mount
    name: str


def places_of(vehicle: dict[str, Any]) -> list[Place]:
    """A place for each LiDAR that a mount may hold. ValueError for a mount that must hold one."""
    if any(mount["count"][0] for mount in vehicle["mounts"]):
        raise ValueError("mounts: one must hold a LiDAR, which this benchmark does not know")
    return [Place(tuple(mount["sensors"]), mount_of(mount), mount["name"])
            for mount in vehicle["mounts"] for _ in range(mount["count"][1])]


def equipped(places: list[Place], shares: Any) -> list[tuple[str, list[float]]]:
    """Sensors and poses of variables in [0, 1]: for each place first which sensor, then the free fields."""
    found, at = [], 0
    for place in places:
        options = (None, *place.sensors)
        sensor = options[min(int(shares[at] * len(options)), len(options) - 1)]
        lower, upper, free = place.mount.lower, place.mount.upper, place.mount.free
        fields = list(lower)
        for k, share in zip(free, shares[at + 1 : at + 1 + len(free)], strict=True):
            fields[k] = lower[k] + float(share) * (upper[k] - lower[k])
        at += 1 + len(free)
        if sensor is not None:
            found.append((sensor, place.mount.pose(fields)))
    return found


def variables(places: list[Place]) -> int:
    """Variables that `equipped` reads."""
    return sum(1 + len(place.mount.free) for place in places)


class Scored:
    """Price, near gain and what is missing of placements, and how many were cast."""

    def __init__(self, scene: Any, vehicle: dict[str, Any], frames: int) -> None:
        self.scene, self.frames, self.cast = scene, frames, 0
        self.prices = {sensor["name"]: sensor["price"] for sensor in vehicle["sensors"]}
        self.least = vehicle["min_distance"]
        self.shares = {rule["name"]: rule["share"] for rule in vehicle["require"]}

    def all(self, rigs: list[list[tuple[str, list[float]]]]) -> list[tuple[float, float, float]]:
        """(price, near gain, missing) of each; missing is above zero for what is not kept."""
        found = [(0.0, 0.0, 10.0)] * len(rigs)
        groups: dict[tuple[str, ...], list[int]] = {}
        for index, rig in enumerate(rigs):
            short = sum(max(0.0, self.least - math.dist(a[1][:3], b[1][:3])) for a, b in combinations(rig, 2))
            if rig and short == 0.0:
                groups.setdefault(tuple(sensor for sensor, _ in rig), []).append(index)
            else:
                found[index] = (self.price(rig), 0.0, 10.0 + short)
        for sensors, indices in groups.items():
            for start in range(0, len(indices), TOGETHER):
                some = indices[start : start + TOGETHER]
                scores = self.scene.score([[pose for _, pose in rigs[k]] for k in some], sensors=list(sensors))
                self.cast += len(some)
                for row, k in enumerate(some):
                    missing = sum(max(0.0, share - float(scores[f"seen.{name}"][row]))
                                  for name, share in self.shares.items())
                    missing += len(doubts(scores.guards[row]))
                    found[k] = (self.price(rigs[k]), float(scores["near_gain"][row]), missing)
        return found

    def price(self, rig: list[tuple[str, list[float]]]) -> float:
        """Price of a rig."""
        return float(sum(self.prices[sensor] for sensor, _ in rig))


class Spent(Exception):
    """The time is over."""


def nsga2(scored: Scored, places: list[Place], seed: int, seconds: float) -> list[list[tuple[str, list[float]]]]:
    """The last population's feasible front, of NSGA-II with pymoo's defaults (100 placements)."""
    numpy = importlib.import_module("numpy")
    algorithm = importlib.import_module("pymoo.algorithms.moo.nsga2").NSGA2(pop_size=100)
    base = importlib.import_module("pymoo.core.problem").Problem
    sorting = importlib.import_module("moocore").is_nondominated

    begun = processor()

    class Rigs(base):  # type: ignore[misc, valid-type]
        def __init__(self) -> None:
            super().__init__(n_var=variables(places), n_obj=2, n_ieq_constr=1, xl=0.0, xu=1.0)

        def _evaluate(self, shares: Any, out: Any, *_: Any, **__: Any) -> None:
            if processor() - begun >= seconds:
                raise Spent
            table = numpy.array(scored.all([equipped(places, row) for row in shares]))
            out["F"], out["G"] = table[:, :2] * [1.0, -1.0], table[:, 2:]

    algorithm.setup(Rigs(), termination=("n_gen", 10**6), seed=seed)
    try:
        while True:
            algorithm.next()
    except Spent:
        pass
    last = algorithm.pop
    feasible = last[last.get("G")[:, 0] <= 0.0]
    if not len(feasible):
        return []
    front = feasible[sorting(feasible.get("F"))]
    return [equipped(places, row) for row in front.get("X")]


def volume(points: list[tuple[float, float]], most: float) -> float:
    """Share of the rectangle from (most price, 0) to (0, 1) that (price, near gain) points beat."""
    if not points:
        return 0.0
    hypervolume = importlib.import_module("moocore").hypervolume
    return float(hypervolume([[price / most, 1.0 - gain] for price, gain in points], ref=[1.0, 1.0]))


def ours(program: Path, seed: int, out: Path) -> tuple[list[tuple[float, float]], float]:
    """Front of `optimize --front price,near_gain`, and its CPU seconds. A run that is there is not repeated."""
    folder, kept = out / f"front-{seed}", out / f"front-{seed}.json"
    if not kept.exists():
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        called(program, ["optimize", str(SCENE), "--vehicle", str(VEHICLE), "--front", "price,near_gain", "--seed",
                         str(seed), "--backend", "cpu", "--force", "--out", str(folder)], (0, 1))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        front = json.loads((folder / "result.json").read_text())["front"]
        points = [(point["price"], point["objectives"]["near_gain"]) for point in front if point["requirements_met"]]
        kept.write_text(json.dumps({"points": points, "cpu_seconds": seconds}))
    result = json.loads(kept.read_text())
    return [tuple(point) for point in result["points"]], result["cpu_seconds"]


def main(arguments: list[str] | None = None) -> int:
    """Prints a row for each seed."""
    parser = argparse.ArgumentParser(prog="benches.searches.front", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=3, help="seeds 1 to this [3]")
    parser.add_argument("--program", type=Path, default=ROOT / "target/release/sightline", help="the program")
    parser.add_argument("--out", type=Path, default=Path("runs/fronts"), help="folder of our runs [runs/fronts]")
    parser.add_argument("--peer-frames", type=int, default=4, help="frames that NSGA-II searches over [4]")
    args = parser.parse_args(arguments)
    args.out.mkdir(parents=True, exist_ok=True)
    sightline = importlib.import_module("sightline")
    vehicle = json.loads(VEHICLE.read_text())
    places = places_of(vehicle)
    most = sum(max(next(s["price"] for s in vehicle["sensors"] if s["name"] == name) for name in place.sensors)
               for place in places)
    whole = sightline.Scene.load(SCENE, vehicle=VEHICLE, backend="cpu")
    few = sightline.Scene.load(SCENE, vehicle=VEHICLE, frames=args.peer_frames, psog=whole.psog, backend="cpu")
    print("| seed | hypervolume of ours, % | of NSGA-II, % | points of ours | of NSGA-II | it cast | CPU s each |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for seed in range(1, args.seeds + 1):
        points, seconds = ours(args.program, seed, args.out)
        search = Scored(few, vehicle, args.peer_frames)
        front = nsga2(search, places, seed, seconds)
        table = Scored(whole, vehicle, whole.frames).all(front)
        peers = [(price, gain) for price, gain, missing in table if missing <= 0.0]
        print(f"| {seed} | {100 * volume(points, most):.2f} | {100 * volume(peers, most):.2f} | {len(points)} | "
              f"{len(peers)} | {search.cast} | {seconds:.0f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
