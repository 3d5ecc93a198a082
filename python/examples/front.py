"""The front of price and near gain of a vehicle, by `sightline.front` and by NSGA-II of pymoo: python front.py SCENE.json VEHICLE.json [GENERATIONS]"""

import json
import sys
from pathlib import Path

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.indicators.hv import Hypervolume
from pymoo.optimize import minimize

import sightline

POPULATION, FRAMES = 24, 1


class Rigs(Problem):
    """For each LiDAR that a mount may hold: which sensor stands there, if any, and the vector of its pose.

    All sensors of a mount must have as many free fields as its first.
    """

    def __init__(self, scene, vehicle):
        self.scene, self.prices = scene, {sensor["name"]: sensor["price"] for sensor in vehicle["sensors"]}
        self.places = [(mount["name"], [None, *mount["sensors"]]) for mount in vehicle["mounts"] for _ in range(mount["count"][1])]
        self.dims = [scene.space([(mount, sensors[1])]).dim for mount, sensors in self.places]
        self.scored = 0
        super().__init__(n_var=len(self.places) + sum(self.dims), n_obj=2, n_ieq_constr=1, xl=0, xu=1)

    def equipped(self, z):
        """Pairs of mount and sensor, and the vector of their space."""
        choices, vectors = z[: len(self.places)], np.split(z[len(self.places) :], np.cumsum(self.dims)[:-1])
        sensors = [names[min(int(share * len(names)), len(names) - 1)] for share, (_, names) in zip(choices, self.places)]
        taken = [k for k, sensor in enumerate(sensors) if sensor]
        return [(self.places[k][0], sensors[k]) for k in taken], np.concatenate([[], *(vectors[k] for k in taken)])

    def judged(self, z):
        """Price, near gain, and violation: 0 where the rig keeps the rules and meets all requirements."""
        equipment, vector = self.equipped(z)
        price = sum(self.prices[sensor] for _, sensor in equipment)
        if not equipment:
            return price, 0.0, 10.0
        space = self.scene.space(equipment)
        poses = space.poses(vector)
        broken = space.violations(poses).sum()
        if broken > 0:
            return price, 0.0, 5.0 + broken
        scores = self.scene.score(poses, sensors=space.sensors, self_hits=False)
        self.scored += 1
        missing = sum(max(0.0, rule["required"] - rule["found"][0]) for rule in scores.requirements.values())
        return price, scores["near_gain"][0], missing

    def _evaluate(self, z, out, *_, **__):
        price, gain, missing = np.array([self.judged(row) for row in z]).T
        out["F"], out["G"] = np.column_stack([price, -gain]), missing


def hypervolume(points, most):
    """Share of the rectangle from price 0 to `most` and gain 0 to 1 that the points dominate."""
    beaten = Hypervolume(ref_point=[1.0, 0.0])
    return beaten(np.array([[price / most, -gain] for price, gain in points]))


if __name__ == "__main__":
    scene = sightline.Scene.load(sys.argv[1], vehicle=sys.argv[2], frames=FRAMES, backend="cpu")
    vehicle = json.loads(Path(sys.argv[2]).read_text())
    rigs = Rigs(scene, vehicle)
    found = minimize(rigs, NSGA2(pop_size=POPULATION), ("n_gen", int(sys.argv[3]) if len(sys.argv) > 3 else 8), seed=1)
    theirs = [] if found.F is None else sorted({(price, -gain) for price, gain in found.F})
    front = sightline.front(scene, ["price", "near_gain"], evaluations=12)
    ours = [tuple(values) for values, meets in zip(front.values, front.meets) if meets]
    most = sum(max(rigs.prices[name] for name in names[1:]) for _, names in rigs.places)
    for name, points in (("sightline.front", ours), (f"NSGA-II, {rigs.scored} placements", theirs)):
        print(f"{name}: {hypervolume(points, most):.3f} of the rectangle; " + ", ".join(f"{price:.0f}: {gain:.3f}" for price, gain in points))
