"""The peers: optimizers of other projects, and random search, on variables in [0, 1].

A search takes `costs` (a batch of variables to their costs), the number of variables, a seed and the number
of placements that it may cast; `pycma` also where to start. It goes on until `costs` raises `Spent`.
"""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from typing import Any

from .scoring import Spent

Costs = Callable[[Any], list[float]]
#: First step size of searches that have one, as a share of the range of a variable.
STEP_SIZE = 0.3
RANDOM_AT_ONCE = 64


def random(costs: Costs, variables: int, seed: int, budget: int, first: Any = None) -> None:
    """Uniform draws; those that break a rule are not cast."""
    numpy = importlib.import_module("numpy")
    source = numpy.random.default_rng(seed)
    while True:
        costs(source.random((RANDOM_AT_ONCE, variables)))


def pycma(costs: Costs, variables: int, seed: int, budget: int, first: Any = None) -> None:
    """BIPOP-CMA-ES: the first run from `first` or else the middle, restarts from uniform draws."""
    numpy, cma = (importlib.import_module(name) for name in ("numpy", "cma"))
    source, runs = numpy.random.default_rng(seed), []

    def start() -> Any:
        runs.append(1)
        if len(runs) > 1:
            return source.random(variables)
        return numpy.full(variables, 0.5) if first is None else numpy.array(first)

    def each(point: Any) -> float:
        return costs([point])[0]

    while True:
        options = {"bounds": [0, 1], "seed": int(source.integers(1, 2**31)), "verbose": -9}
        cma.fmin2(each, start, STEP_SIZE, options, restarts=9, bipop=True,
                  parallel_objective=lambda points, *_: costs(points))


def optuna_with(sampler: Callable[[Any, int], Any]) -> Callable[..., None]:
    """Optuna with a sampler, one trial after another."""

    def search(costs: Costs, variables: int, seed: int, budget: int, first: Any = None) -> None:
        optuna = importlib.import_module("optuna")
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        study = optuna.create_study(sampler=sampler(optuna, seed))
        while True:
            trial = study.ask()
            point = [trial.suggest_float(f"v{k}", 0.0, 1.0) for k in range(variables)]
            study.tell(trial, costs([point])[0])

    return search


def nevergrad(costs: Costs, variables: int, seed: int, budget: int, first: Any = None) -> None:
    """Differential evolution with nevergrad's defaults."""
    numpy, ng = (importlib.import_module(name) for name in ("numpy", "nevergrad"))
    space = ng.p.Array(init=numpy.full(variables, 0.5)).set_bounds(0.0, 1.0)
    space.random_state.seed(seed)
    search = ng.optimizers.registry["DE"](parametrization=space, budget=budget)
    while True:
        candidate = search.ask()
        search.tell(candidate, costs([candidate.value])[0])


#: Generations that the genetic algorithm gets at least, of pymoo's 100 placements or fewer.
LEAST_GENERATIONS = 10


def pymoo(costs: Costs, variables: int, seed: int, budget: int, first: Any = None) -> None:
    """pymoo's genetic algorithm; its population fits LEAST_GENERATIONS into the budget."""
    numpy = importlib.import_module("numpy")
    ga = importlib.import_module("pymoo.algorithms.soo.nonconvex.ga").GA
    minimize = importlib.import_module("pymoo.optimize").minimize
    base = importlib.import_module("pymoo.core.problem").Problem

    class Placements(base):  # type: ignore[misc, valid-type]
        def __init__(self) -> None:
            super().__init__(n_var=variables, n_obj=1, xl=numpy.zeros(variables), xu=numpy.ones(variables))

        def _evaluate(self, x: Any, out: Any, *args: Any, **kwargs: Any) -> None:
            out["F"] = numpy.array(costs(x))[:, None]

    size = min(100, max(10, budget // LEAST_GENERATIONS))
    generation = 0
    while True:
        minimize(Placements(), ga(pop_size=size), ("n_gen", 10**6), seed=seed + 1000 * generation, verbose=False)
        generation += 1


#: Search, modules that it needs, and what installs them.
PEERS: dict[str, tuple[Callable[..., None], tuple[str, ...], str]] = {
    "random": (random, ("numpy",), "numpy"),
    "pycma": (pycma, ("cma",), "cma"),
    "pycma-start": (pycma, ("cma",), "cma"),
    "tpe": (optuna_with(lambda optuna, seed: optuna.samplers.TPESampler(seed=seed)), ("optuna",), "optuna"),
    "optuna-cma": (
        optuna_with(lambda optuna, seed: optuna.samplers.CmaEsSampler(seed=seed)),
        ("optuna", "cmaes"),
        "optuna cmaes",
    ),
    "de": (nevergrad, ("nevergrad",), "nevergrad"),
    "ga": (pymoo, ("pymoo",), "pymoo"),
}
#: Peers that start from the best baseline of ours, as ours does.
STARTED = ("pycma-start",)
#: Names to read.
TITLES = {
    "random": "random search by the rules",
    "pycma": "pycma, BIPOP",
    "pycma-start": "pycma, BIPOP, from the best baseline",
    "tpe": "Optuna, TPE",
    "optuna-cma": "Optuna, CMA-ES",
    "de": "nevergrad, DE",
    "ga": "pymoo, GA",
}


def lacking(method: str) -> str | None:
    """A sentence on what to install for a peer; None where all of it is there."""
    _, modules, packages = PEERS[method]
    for name in ("sightline", *modules):
        try:
            importlib.import_module(name)
        except ImportError as error:
            install = "./python (the module of this repository)" if name == "sightline" else packages
            return f"{TITLES[method]} is left out: {error}; pip install {install}"
    return None


def searched(method: str, costs: Costs, variables: int, seed: int, budget: int, first: Any = None) -> None:
    """Runs a peer until its budget is spent."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            PEERS[method][0](costs, variables, seed, budget, first)
        except Spent:
            return
