"""Evaluations that pycma needs on cma_problems.json, as that file's `settings.pycma` describe.

pip install cma==4.5.0 numpy==2.4.6
python pycma.py ../shared/golden/cma_problems.json pycma.json [ID_PREFIX ...]

Results join those already in the output, problem by problem. rastrigin_ipop_n32 is left out, as in
the file.
"""

import json
import os
import sys
import warnings

warnings.filterwarnings("ignore")
import cma
import numpy as np

DATA = json.load(open(sys.argv[1]))


def cost_of(problem):
    n, func, params = problem["n"], problem["func"], problem["params"]
    common = DATA["common"][str(n)]
    x_opt, grid = np.array(common["x_opt"]), np.array(common["x_opt_grid"])
    rotation = np.array(DATA["rotations"][str(n)])
    e = np.arange(n) / (n - 1)
    cond = params.get("cond", 1.0) ** e
    delta = params.get("delta", 1.0)
    even = np.arange(n) % 2 == 0
    centre = np.where(even, 7.0, x_opt)

    def cost(x):
        z, zg = x - x_opt, x - grid
        if func in ("sphere", "noisy_sphere_mult", "noisy_sphere_add"):
            return (z**2).sum(1)
        if func == "ellipsoid":
            return (cond * z**2).sum(1)
        if func == "ellipsoid_rot":
            return (cond * (z @ rotation.T) ** 2).sum(1)
        if func == "rosenbrock":
            return (100 * (x[:, :-1] ** 2 - x[:, 1:]) ** 2 + (1 - x[:, :-1]) ** 2).sum(1)
        if func == "rastrigin":
            return 10 * n + (z**2 - 10 * np.cos(2 * np.pi * z)).sum(1)
        if func == "linear_box":
            return (10**e * (x + 5)).sum(1)
        if func == "sphere_box":
            return ((x - centre) ** 2).sum(1) - 4 * np.ceil(n / 2)
        if func == "step_sphere":
            return ((delta * np.floor(zg / delta + 0.5)) ** 2).sum(1)
        if func == "step_ellipsoid_rot":
            return (cond * (delta * np.floor(zg @ rotation.T / delta + 0.5)) ** 2).sum(1)
        if func == "floor_sphere":
            return params["q"] * np.floor((z**2).sum(1) / params["q"])
        raise ValueError(func)

    return cost


def run(problem, index):
    n, target, cost = problem["n"], problem["target"], cost_of(problem)
    common = DATA["common"][str(n)]
    rng = np.random.default_rng(index + 1)
    observe = {
        "noisy_sphere_mult": lambda f: f * (1 + problem["params"]["noise"] * rng.normal(size=f.shape)),
        "noisy_sphere_add": lambda f: f + problem["params"]["noise"] * rng.normal(size=f.shape),
    }.get(problem["func"], lambda f: f)
    start = np.array(common["x0"][index]) * problem["x0_scale"]
    popsize, restart, evaluations, infeasible = problem["popsize"], 0, 0, 0
    while True:
        options = {"seed": index + 1 + 10007 * restart, "verbose": -9, "verb_log": 0}
        if problem["lower"] is not None:
            options["bounds"] = [problem["lower"], problem["upper"]]
        if popsize is not None:
            options["popsize"] = popsize
        es = cma.CMAEvolutionStrategy(start, problem["sigma0"], options)
        while evaluations < problem["budget"] and not es.stop():
            points = es.ask()
            x = np.array(points)
            if problem["lower"] is not None:
                outside = (x < problem["lower"] - 1e-12) | (x > problem["upper"] + 1e-12)
                infeasible += int(outside.any(1).sum())
            f = cost(x)
            es.tell(points, list(observe(f)))
            if problem["indicator"] == "sample":
                hits = np.flatnonzero(f <= target)
                if len(hits):
                    return evaluations + int(hits[0]) + 1, infeasible, "target"
            evaluations += len(points)
            if problem["indicator"] == "mean" and cost(np.array([es.mean]))[0] <= target:
                return evaluations, infeasible, "target"
        if evaluations >= problem["budget"]:
            return None, infeasible, "budget"
        if problem["restart"] != "ipop":
            return None, infeasible, ",".join(es.stop())
        popsize, restart = 2 * es.popsize, restart + 1
        start = rng.uniform(-4, 4, n) * problem["x0_scale"]


def main():
    path, prefixes = sys.argv[2], tuple(sys.argv[3:]) or ("",)
    out = json.load(open(path)) if os.path.exists(path) else {}
    for problem in DATA["problems"]:
        name = problem["id"]
        if name in out or name == "rastrigin_ipop_n32" or not name.startswith(prefixes):
            continue
        runs = [run(problem, index) for index in range(DATA["settings"]["runs_per_problem"])]
        out[name] = {
            "evaluations": [r[0] for r in runs],
            "infeasible": sum(r[1] for r in runs),
            "stops": [r[2] for r in runs],
        }
        print(name, sum(r[0] is not None for r in runs), sorted(r[0] or 10**9 for r in runs)[12], flush=True)
        lines = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in out.items()]
        open(path, "w").write("{\n" + ",\n".join(lines) + "\n}\n")


main()
