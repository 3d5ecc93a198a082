"""Optimizers of others on the space of a mount: python optimizers.py botorch|optuna|pymoo|pycma|search SCENE.json"""

import sys

import numpy as np

import sightline

EVALUATIONS = 60


def with_optuna(scene, space):
    """Ask and tell; what breaks a rule is pruned and not scored."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=1))
    for _ in range(EVALUATIONS):
        trial = study.ask()
        poses = space.poses([trial.suggest_float(f"z{k}", 0, 1) for k in range(space.dim)])
        if space.violations(poses).any():
            study.tell(trial, state=optuna.trial.TrialState.PRUNED)
        else:
            study.tell(trial, scene.score(poses, sensors=space.sensors)["near_gain"][0])
    return space.poses([study.best_params[f"z{k}"] for k in range(space.dim)])


def with_botorch(scene, space):
    """A Gaussian process, and where it expects most improvement among draws that keep the rules."""
    import torch
    from botorch.acquisition import LogExpectedImprovement
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from gpytorch.mlls import ExactMarginalLogLikelihood

    def drawn(count):
        poses = space.random(count, rng)
        return torch.tensor(space.vector(poses), dtype=torch.float64), poses

    torch.manual_seed(1)
    rng = np.random.default_rng(1)
    z, poses = drawn(20)
    value = torch.tensor(scene.score(poses, sensors=space.sensors)["near_gain"])[:, None]
    while len(z) < EVALUATIONS:
        model = SingleTaskGP(z, value)
        fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
        others, at = drawn(512)
        expected = LogExpectedImprovement(model, best_f=value.max())(others[:, None])
        chosen = expected.topk(20).indices
        z, poses = torch.cat([z, others[chosen]]), np.concatenate([poses, at[chosen]])
        found = scene.score(at[chosen], sensors=space.sensors)["near_gain"]
        value = torch.cat([value, torch.tensor(found)[:, None]])
    return poses[value.argmax()]


def with_pycma(scene, space):
    """Ask and tell; broken rules cost more than any score."""
    import cma

    search = cma.CMAEvolutionStrategy(space.dim * [0.5], 0.3, {"bounds": [0, 1], "seed": 1, "verbose": -9})
    best = (np.inf, None)
    while search.result.evaluations < EVALUATIONS:
        z = np.array(search.ask())
        poses = space.poses(z)
        broken = space.violations(poses).sum(axis=1)
        cost = np.where(broken > 0, 1 + broken, -scene.score(poses, sensors=space.sensors)["near_gain"])
        search.tell(z, cost)
        best = min(best, (cost.min(), poses[cost.argmin()]), key=lambda one: one[0])
    return best[1]


def with_pymoo(scene, space):
    """Two objectives, near gain and information, with the rules as constraints; the knee of the front.

    `sightline.front` is the search for a front where a vehicle has sensors to choose from.
    """
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    class Placements(Problem):
        def __init__(self):
            super().__init__(n_var=space.dim, n_obj=2, n_ieq_constr=len(space.rules), xl=0, xu=1)

        def _evaluate(self, z, out, *_, **__):
            poses = space.poses(z)
            scores = scene.score(poses, sensors=space.sensors)
            out["F"] = -np.column_stack([scores["near_gain"], scores["information_gain_share"]])
            out["G"] = space.violations(poses)

    found = minimize(Placements(), NSGA2(pop_size=20), ("n_gen", EVALUATIONS // 20), seed=1)
    return space.poses(np.atleast_2d(found.X))[found.F.sum(axis=1).argmin()]


def with_search(scene, space):
    """The CMA-ES of `sightline optimize`, for an objective of one's own: the worse of two scores."""
    search = sightline.Search(space, seed=1)
    while search.told < EVALUATIONS:
        scores = scene.score(search.ask(), sensors=space.sensors)
        search.tell(np.minimum(scores["near_gain"], scores["information_gain_share"]))
    best, _ = search.result()
    return best.poses


if __name__ == "__main__":
    name, path = sys.argv[1:]
    scene = sightline.Scene.load(path, frames=2, backend="cpu")
    space = scene.space()
    poses = {"botorch": with_botorch, "optuna": with_optuna, "pymoo": with_pymoo, "pycma": with_pycma, "search": with_search}[name](scene, space)
    scores = scene.score(poses, sensors=space.sensors)
    assert (space.violations(poses) == 0).all()
    print(f"{name}: near_gain {scores['near_gain'][0]:.4f}")
