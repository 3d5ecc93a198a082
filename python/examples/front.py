"""The front of price and near gain of a vehicle, by `sightline.front` and by NSGA-II of pymoo at as many casts: python front.py SCENE.json VEHICLE.json [CASTS]

One cast is one LiDAR in one frame. Ours casts each pose of the coarse grid once and each LiDAR of a scored placement; poses are
not searched further. CASTS gives NSGA-II another number. Vehicles whose requirements no point meets cost ours more, which is not counted.
"""

import json
import sys
from pathlib import Path

import moocore
import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.core.termination import Termination
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
        self.casts = 0
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
        self.casts += len(equipment) * FRAMES
        missing = sum(max(0.0, rule["required"] - rule["found"][0]) for rule in scores.requirements.values())
        return price, scores["near_gain"][0], missing

    def _evaluate(self, z, out, *_, **__):
        price, gain, missing = np.array([self.judged(row) for row in z]).T
        out["F"], out["G"] = np.column_stack([price, -gain]), missing


class Casts(Termination):
    """The end of a search after so many casts."""

    def __init__(self, rigs, most):
        super().__init__()
        self.rigs, self.most = rigs, most

    def _update(self, algorithm):
        return self.rigs.casts / self.most


def hypervolumes(points, most):
    """Share of the rectangle from price 0 to `most` and gain 0 to 1 that the points dominate, by pymoo and by moocore."""
    if not points:
        return 0.0, 0.0
    costs = np.array([[price / most, -gain] for price, gain in points])
    return Hypervolume(ref_point=[1.0, 0.0])(costs), moocore.hypervolume(costs, ref=[1.0, 0.0])


if __name__ == "__main__":
    scene = sightline.Scene.load(sys.argv[1], vehicle=sys.argv[2], frames=FRAMES, backend="cpu")
    vehicle = json.loads(Path(sys.argv[2]).read_text())
    rigs = Rigs(scene, vehicle)
    events = []
    front = sightline.front(scene, ["price", "near_gain"], evaluations=0, callback=events.append)
    poses = max(event["total"] for event in events if event.get("work") == "poses for the choice of sensors")
    ours = [tuple(values) for values, meets in zip(front.values, front.meets) if meets]
    casts = (poses + front.record["scored"] * len(rigs.places)) * FRAMES
    end = Casts(rigs, int(sys.argv[3]) if len(sys.argv) > 3 else casts)
    found = minimize(rigs, NSGA2(pop_size=POPULATION), end, seed=1, copy_termination=False)
    theirs = [] if found.F is None else sorted({(price, -gain) for price, gain in found.F})
    most = sum(max(rigs.prices[name] for name in names[1:]) for _, names in rigs.places)
    for name, points in ((f"sightline.front, at most {casts} casts", ours), (f"NSGA-II, {rigs.casts} casts", theirs)):
        share, again = hypervolumes(points, most)
        told = ", ".join(f"{price:.0f}: {gain:.3f}" for price, gain in points)
        print(f"{name}: {share:.3f} of the rectangle by pymoo, {again:.3f} by moocore; {told}")
