"""Parts of a metric: by class, by distance, overhead, by kind of object; and how sure the learner rightly is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from . import decide
from ._types import F64
from .gathered import Gathered, mean
from .groups import GROUPS
from .metrics.targets import RINGS
from .truth import KINDS

#: Objectives of the engine whose optima are shown; the first is the default.
SEARCHED = ("near_gain", "information_gain", "m_sog_scaled")

#: A quantity out of the ``detail`` of a placement in a scene; ``None``: it is not there.
_Read = Callable[[dict[str, Any]], float | None]


def of(given: Gathered) -> dict[str, Any]:
    """Each quantity of the published optimum, and what the ``columns`` have more: means over scenes with intervals."""
    ours, columns = given.number(decide.PUBLISHED), _columns(given)
    if ours is None:
        return {}
    found: dict[str, Any] = {}
    for what, rows in _quantities().items():
        found[what] = {}
        for name, read in rows.items():
            table = _table(given, read)
            if np.isfinite(table[ours]).any():
                less = {column: mean(table[numbers], 0) - table[ours] for column, numbers in columns.items()}
                found[what][name] = {decide.PUBLISHED: asdict(decide.over_scenes(table[ours]))} | {
                    column: asdict(decide.over_scenes(values)) for column, values in less.items()
                }
    return {"placements": {c: [given.layouts[k].name for k in numbers] for c, numbers in columns.items()}, "parts": found}


def _columns(given: Gathered) -> dict[str, list[int]]:
    """Which placements ``[…]`` are shown together, as a mean."""

    def those(begin: str) -> list[int]:
        return [k for k, one in enumerate(given.layouts) if one.pool == "box" and one.name.startswith(begin)]

    columns = {f"optima of {score}": those(f"best-{score}-") for score in SEARCHED}
    columns |= {"Center": [k for k in those("Center") if given.layouts[k].name == "Center"], "random": those("random-")}
    return {name: numbers for name, numbers in columns.items() if numbers}


def _quantities() -> dict[str, dict[str, _Read]]:
    classes = {name: _within("iou_by_class_1m", name) for name in GROUPS[1:]}
    rings = {f"{near:g} to {far:g} m": _within("miou_by_ring_1m", k) for k, (near, far) in enumerate(zip(RINGS, RINGS[1:]))}
    high: dict[str, _Read] = {"overhead": lambda detail: detail["miou_overhead_1m"]}
    sure: dict[str, _Read] = {"ECE": lambda detail: detail["ece_15_bins"]}
    kinds = {name: _share(f"{name}_5") for name in KINDS}
    return {
        "IoU within 1 m": classes,
        "mIoU within 1 m, ring": rings | high,
        "own points": sure,
        "objects ≥ 5 points": kinds,
    }


def _within(key: str, name: str | int) -> _Read:
    def read(detail: dict[str, Any]) -> float | None:
        among = detail[key]
        value: float | None = among.get(name) if isinstance(among, dict) else among[name]
        return value

    return read


def _share(key: str) -> _Read:
    def read(detail: dict[str, Any]) -> float | None:
        seen, there = detail["objects"][key]
        return seen / there if there else None

    return read


def _table(given: Gathered, read: _Read) -> F64:
    """``[placements, scenes]``, a mean over seeds; ``NaN`` where a scene has nothing of it."""

    def value(name: str, seed: int, scene: str) -> float:
        unit = given.units.get((name, seed))
        # A restored run has none.
        detail = unit["scenes"][scene]["detail"] if unit else None
        found = read(detail) if detail else None
        return np.nan if found is None else float(found)

    every = [[[value(one.name, s, scene) for scene in given.scenes] for one in given.layouts] for s in given.seeds]
    return mean(np.array(every, dtype=np.float64), 0)
