"""A search that maximizes a function of scores, which `optimize` takes as its objective."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._native import DoubtWarning, Placement, Scene, Search, Suite
from ._progress import Wanted, shown
from ._records import Result
from ._scores import Scores, missed_by_first

Numbers = npt.NDArray[np.float64]


def search(
    scenes: Sequence[Scene],
    objective: Callable[[Scores], Any],
    settings: tuple[int, int, int | None, list[Placement], float | None, float | None],
    callback: Callable[[dict[str, Any]], object] | None,
    progress: Wanted,
) -> Result:
    """Asks a `Search` generation by generation; placements that are not feasible rank behind those that are."""
    evaluations, seed, population, baselines, target, seconds = settings
    given = scenes[0] if len(scenes) == 1 else Suite(scenes)
    space, begun = scenes[0].space(), time.monotonic()
    asking = Search(space, seed=seed, population=population)
    history: list[dict[str, Any]] = []
    best: tuple[bool, float, Placement | None] = (False, -np.inf, None)
    scored, ended, signal = 0, "evaluations", None
    with shown(progress) as tell:
        while scored < evaluations and ended == "evaluations":
            try:
                placements = asking.ask_placements()
                scores = given.score(placements, tolerance=None, progress=False)
                values = _values(objective, scores)
                asking.tell(_below_feasible(values, scores))
                scored += len(placements)
                order = np.lexsort((np.nan_to_num(values, nan=-np.inf), scores.feasible))
                top = int(order[-1])
                if not np.isnan(values[top]):
                    ours = (bool(scores.feasible[top]), float(values[top]), placements[top])
                    best = max(best, ours, key=lambda one: one[:2])
                history.append(
                    {"generation": len(history) + 1, "evaluations": scored, "best": float(values[top]), "best_so_far": best[1]}
                )
                tell("placements", min(scored, evaluations), evaluations)
                if callback is not None:
                    callback({"event": "generation", **history[-1]})
            except StopIteration:
                ended = "callback"
            except BaseException as raised:
                ended, signal = "exception", raised
            if ended == "evaluations" and target is not None and best[0] and best[1] >= target:
                ended = "target"
            elif ended == "evaluations" and seconds is not None and time.monotonic() - begun >= seconds:
                ended = "seconds"
    found = [] if best[2] is None else [best[2]]
    record = {
        "objective": getattr(objective, "__name__", repr(objective)),
        "value": None if best[2] is None else best[1],
        "feasible": best[0],
        "seed": seed,
        "methods": [{"method": "cma-es", "evaluations": scored}],
        "seconds": time.monotonic() - begun,
        "ended": ended,
        # No bound is known on a function.
        "certificate": None,
    }
    compared = given.score([*found, *baselines] or space.random(0), progress=False)
    missed = [] if best[2] is None else missed_by_first(compared)
    result = Result(best[2], list(baselines), compared, history, record, _verdict(best, compared, missed))
    try:
        for words in missed:
            warnings.warn(words, DoubtWarning, stacklevel=2)
    except DoubtWarning as doubt:
        signal = signal or doubt
    if signal is not None:
        signal.result = result  # type: ignore[attr-defined]
        raise signal
    return result


def _verdict(best: tuple[bool, float, Placement | None], scores: Scores, missed: list[str]) -> str:
    """Sentences on a result: its value, and each rule, requirement and guard that it does not keep."""
    if best[2] is None:
        return "No placement kept the rules of the mount and had a value."
    broken, guards = scores.broken_rules[0], scores.guards[0]
    faults = [*missed, *(f"RULE BROKEN: {rule}" for rule in broken), *(f"Warning: {guard}" for guard in guards)]
    met = " It meets all requirements." if scores.requirements and not missed else ""
    return f"The placement found has the value {best[1]:.6g}.{met}" + "".join(f" {fault}." for fault in faults)


def _values(objective: Callable[[Scores], Any], scores: Scores) -> Numbers:
    values = np.asarray(objective(scores), dtype=np.float64)
    count = len(scores.names)
    if values.shape != (count,):
        raise ValueError(f"objective: gives the shape {values.shape} for {count} placements; give a number for each")
    return values


def _below_feasible(values: Numbers, scores: Scores) -> Numbers:
    """The values; where a placement is not feasible one below all others, the lower the more it misses."""
    missing = np.array([float(len(guards)) for guards in scores.guards])
    for rule in scores.requirements.values():
        missing += np.maximum(rule["required"] - rule["found"], 0)
    finite = values[np.isfinite(values)]
    low = finite.min() - 1 if len(finite) else 0.0
    return np.where(scores.feasible | np.isnan(values), values, low - missing)
