"""Whether two learners of different families order placements alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from . import correlate
from ._types import F64
from .correlate import Drawn, Interval
from .files import is_whole, read_json
from .gathered import POOLS
from .plan import Plan

#: Folders of the learners within a run, and what they are called.
LEARNERS = {"units": "trees", "learned/units": "U-Net, shared", "learned/anew": "U-Net, anew"}

#: Metrics that are compared: pairs of learner and metric.
PAIRS = (
    ("units", "birds_eye_miou", "learned/units", "birds_eye_miou"),
    ("units", "voxel_1m_miou", "learned/units", "birds_eye_miou"),
    ("units", "objects_5", "learned/units", "centre_recall"),
    ("learned/units", "birds_eye_miou", "learned/anew", "birds_eye_miou"),
    ("units", "birds_eye_miou", "learned/anew", "birds_eye_miou"),
)


def agreement(ours: F64, theirs: F64, seed: int = 11) -> Interval:
    """Spearman of two learners' metrics, both ``[placements, scenes]``, with its interval over placements and scenes.

    A placement that one of the two has no value for is left out.
    """
    both = np.isfinite(ours).any(axis=1) & np.isfinite(theirs).any(axis=1)
    drawn = Drawn.of(np.random.default_rng(seed), max(int(both.sum()), 1), ours.shape[1])
    return correlate.spearman_interval(ours[both], theirs[both], drawn) if both.sum() > 2 else Interval(*[np.nan] * 3)


def metric_of(plan: Plan, folder: Path, metric: str) -> F64:
    """``[placements, scenes]`` of a learner's folder, a mean over its seeds; ``NaN`` where it has no unit."""
    scenes = [world.name for world in plan.of("test")]
    rows = []
    for layout in plan.placements:
        units = [read_json(file) for file in files_of(folder, layout.name)]
        found = [[_value(unit, scene, metric) for scene in scenes] for unit in units]
        rows.append(np.mean(np.array(found, dtype=np.float64), axis=0) if found else np.full(len(scenes), np.nan))
    return np.array(rows, dtype=np.float64)


def files_of(folder: Path, name: str) -> list[Path]:
    """Whole units of a placement, seed by seed; "count-1-2.json" is seed 2 of "count-1"."""
    found = sorted(folder.glob(f"{name}-[0-9]*.json"))
    return [file for file in found if file.stem.rpartition("-")[0] == name and is_whole(file)]


def _value(unit: dict[str, Any], scene: str, metric: str) -> float:
    found = unit["scenes"][scene]["metrics"].get(metric)
    return float("nan") if found is None else float(found)


def table(plan: Plan, out: Path) -> str:
    """Markdown: Spearman of learners, by pool; and placements that have a net of their own."""
    lines = ["| learner | with | " + " | ".join(POOLS) + " |", "|---" * (2 + len(POOLS)) + "|"]
    for a, metric_a, b, metric_b in PAIRS:
        ours, theirs = metric_of(plan, out / a, metric_a), metric_of(plan, out / b, metric_b)
        cells = []
        for parts in POOLS.values():
            kept = np.array([layout.pool in parts for layout in plan.placements])
            count = int((np.isfinite(ours[kept]).any(axis=1) & np.isfinite(theirs[kept]).any(axis=1)).sum())
            cells.append(f"{shown(agreement(ours[kept], theirs[kept]))}, n = {count}" if count > 2 else "–")
        if any(cell != "–" for cell in cells):
            lines.append(f"| {LEARNERS[a]} `{metric_a}` | {LEARNERS[b]} `{metric_b}` | {' | '.join(cells)} |")
    lines += ["", *_anew(plan, out)]
    return "\n".join(lines)


def _anew(plan: Plan, out: Path) -> list[str]:
    names = [layout.name for layout in plan.placements if files_of(out / "learned" / "anew", layout.name)]
    if not names:
        return []
    lines = ["| bird's-eye mIoU | " + " | ".join(names) + " |", "|---" * (1 + len(names)) + "|"]
    for folder, learner in LEARNERS.items():
        found = metric_of(plan, out / folder, "birds_eye_miou")
        values = {layout.name: np.nanmean(row) if np.isfinite(row).any() else np.nan for layout, row in zip(plan.placements, found)}
        lines.append(f"| {learner} | " + " | ".join(f"{values[name]:.3f}" for name in names) + " |")
    return lines


def shown(interval: Interval) -> str:
    """``.81 [.49 .93]``."""
    number = [f"{value:.2f}".replace("0.", ".", 1) for value in (interval.value, interval.low, interval.high)]
    return f"{number[0]} [{number[1]} {number[2]}]"
