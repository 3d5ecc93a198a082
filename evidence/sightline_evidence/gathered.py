"""Whole files of a study, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ._types import F64, Bools
from .files import is_whole, read_json
from .layouts import Layout
from .plan import Plan
from .scores import SCORES
from .trial import METRICS

#: Pools of placements that are looked at apart, by the pools of ``Layout`` in them.
POOLS = {
    "four in the mount": ("box",),
    "four in the mount or low": ("box", "mixed"),
    "all but the gamed": ("box", "mixed", "number", "sensor"),
}

#: Units of other learners than the trees: folder within a run, and what their metrics are called after.
OTHERS = {"learned": "unet"}

#: Metrics that such a learner has.
LEARNT = ("birds_eye_miou", "centre_recall", "centre_ap")


@dataclass(frozen=True)
class Gathered:
    """Measurements of the placements that have a unit of at least one seed."""

    plan: Plan
    layouts: list[Layout]
    scenes: list[str]
    seeds: list[int]
    #: ``[seeds, placements, scenes]``; ``NaN`` where a unit is missing.
    metrics: dict[str, F64]
    #: ``[placements, scenes]``.
    scores: dict[str, F64]
    #: By name and seed.
    units: dict[tuple[str, int], dict[str, Any]]
    #: Names of the units that the plan has and the folder has not.
    missing: list[str]

    @staticmethod
    def of(plan: Plan, out: Path) -> Gathered:
        """From the files of a run that may be under way."""
        scenes = [world.name for world in plan.of("test")]
        every = [(layout.name, seed) for layout, seed in plan.units()]
        files = {key: out / "units" / f"{key[0]}-{key[1]}.json" for key in every}
        units = {key: read_json(path) for key, path in files.items() if is_whole(path)}
        missing = [path.stem for key, path in files.items() if key not in units]
        have = {name for name, _ in units}
        there = np.array([layout.name in have for layout in plan.placements], dtype=bool)
        layouts = [layout for layout in plan.placements if layout.name in have]
        seeds = [seed for seed in plan.seeds if any(seed == s for _, s in units)]
        if not layouts:
            raise ValueError(f"{out}: has no unit yet; run the study first")
        metrics = {m: _table([[units.get((x.name, s)) for x in layouts] for s in seeds], scenes, m) for m in METRICS}
        metrics |= _of_others(out, layouts, scenes)
        given = [read_json(out / "scores" / f"{scene}.json") for scene in scenes]
        scores = {s: np.array([scene[s] for scene in given], dtype=np.float64).T[there] for s in SCORES}
        return Gathered(plan, layouts, scenes, seeds, metrics, scores, units, missing)

    def mean(self, metric: str) -> F64:
        """``[placements, scenes]``, over the seeds that are there."""
        return mean(self.metrics[metric], 0)

    def pool(self, *parts: str) -> Bools:
        """Which placements ``[placements]`` are of these pools."""
        kept: Bools = np.array([layout.pool in parts for layout in self.layouts], dtype=bool)
        return kept

    def number(self, name: str) -> int | None:
        """Where a placement stands; ``None`` if it is missing."""
        names = [layout.name for layout in self.layouts]
        return names.index(name) if name in names else None

    def place(self, name: str) -> int:
        """Where a placement stands that must be there."""
        found = self.number(name)
        if found is None:
            raise ValueError(f"{name}: has no unit")
        return found


def mean(values: F64, axis: int) -> F64:
    """Mean of the finite values along an axis; ``NaN`` where there are none, without a warning."""
    there = np.isfinite(values)
    count = there.sum(axis=axis)
    found: F64 = np.where(count > 0, np.where(there, values, 0.0).sum(axis=axis) / np.maximum(count, 1), np.nan)
    return found


def _table(units: list[list[dict[str, Any] | None]], scenes: list[str], metric: str) -> F64:
    def value(unit: dict[str, Any] | None, scene: str) -> float:
        found = unit["scenes"].get(scene, {}).get("metrics", {}).get(metric) if unit else None
        return np.nan if found is None else float(found)

    return np.array([[[value(unit, scene) for scene in scenes] for unit in row] for row in units], dtype=np.float64)


def _of_others(out: Path, layouts: list[Layout], scenes: list[str]) -> dict[str, F64]:
    """Metrics of other learners by the name of the learner and the metric, of the seeds that they have."""
    found: dict[str, F64] = {}
    for folder, learner in OTHERS.items():
        files = [sorted((out / folder / "units").glob(f"{layout.name}-[0-9]*.json")) for layout in layouts]
        # "count-1-2.json" is seed 2 of "count-1"; "best-…-1" has a number of its own.
        of = [[f for f in some if f.stem.rpartition("-")[0] == x.name and is_whole(f)] for some, x in zip(files, layouts)]
        most = max((len(some) for some in of), default=0)
        rows = [[read_json(some[k]) if k < len(some) else None for some in of] for k in range(most)]
        for metric in LEARNT if most else ():
            table = _table(rows, scenes, metric)
            # Fewer say nothing.
            if np.isfinite(table).any(axis=(0, 2)).sum() >= 4:
                found[f"{learner}_{metric}"] = table
    return found
