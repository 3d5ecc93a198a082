"""The result of a study out of its units: correlations, ceilings, regrets, checks."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from . import correlate
from ._types import F64
from .plan import Plan
from .scores import SCORES
from .trial import METRICS

#: Pools of placements that are correlated apart, by the pools of ``Layout`` in them.
POOLS = {"four in the mount": ("box",), "all but the gamed": ("box", "mixed", "number"), "four in the mount or low": ("box", "mixed")}

#: Seed of all bootstraps.
SEED = 11


def of(plan: Plan, out: Path) -> dict[str, Any]:
    """All of ``result.json`` but for the time of this call; the same bytes for the same units."""
    scenes = [world.name for world in plan.of("test")]
    names = [layout.name for layout in plan.placements]
    units = {
        (name, seed): _read(out / "units" / f"{name}-{seed}.json") for name in names for seed in plan.seeds
    }
    # [seeds, placements, scenes] by metric; [placements, scenes] by score.
    metrics = {m: _table(units, plan, names, scenes, m) for m in METRICS}
    given = [_read(out / "scores" / f"{scene}.json") for scene in scenes]
    scores = {s: np.array([scene[s] for scene in given], dtype=np.float64).T for s in SCORES}
    pools = {}
    for pool, parts in POOLS.items():
        kept = np.array([layout.pool in parts for layout in plan.placements])
        if kept.sum() >= 4:
            pools[pool] = _pool(
                {s: scores[s][kept] for s in scores}, {m: metrics[m][:, kept] for m in metrics}
            )
    checks = {name: _read(out / "checks" / f"{name}.json") for name in ("shuffled-labels", "learning-curve")}
    return {
        "plan_sha256": plan.sha256,
        "plan": plan.record,
        "targets": {scene: _read(out / "truth" / f"{scene}.json") for scene in scenes},
        "placements": [_placement(plan, k, units, metrics, scores, scenes) for k in range(len(names))],
        "pools": pools,
        "checks": {
            **checks,
            "gamed_rank_last": gamed_last(plan, metrics),
            "one_more_lidar": _one_more(plan, metrics),
            "learnt": _learnt(units, plan),
        },
    }


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def _table(units: dict[Any, Any], plan: Plan, names: list[str], scenes: list[str], metric: str) -> F64:
    rows = [
        [[units[name, seed]["scenes"][scene]["metrics"][metric] for scene in scenes] for name in names]
        for seed in plan.seeds
    ]
    return np.array(rows, dtype=np.float64)


def _pool(scores: dict[str, F64], metrics: dict[str, F64]) -> dict[str, Any]:
    count, scenes = next(iter(scores.values())).shape
    drawn = correlate.Drawn.of(np.random.default_rng(SEED), count, scenes)
    height, hits = scores["mean_height"].mean(axis=1), scores["hits"].mean(axis=1)
    table: dict[str, Any] = {}
    for metric, by_seed in metrics.items():
        mean = by_seed.mean(axis=0)
        over = np.nanmean(mean, axis=1)
        table[metric] = {
            "noise_ceiling": correlate.noise_ceiling(np.nanmean(by_seed, axis=2)),
            "spread": [float(np.nanmin(over)), float(np.nanmean(over)), float(np.nanmax(over))],
            "scores": {
                score: {
                    "spearman": asdict(correlate.spearman_interval(values, mean, drawn)),
                    "pearson": correlate.pearson(values.mean(axis=1), over),
                    "partial_given_height": correlate.partial(values.mean(axis=1), over, height),
                    "partial_given_hits": correlate.partial(values.mean(axis=1), over, hits),
                    "regret": asdict(correlate.regret_interval(values, mean, drawn)),
                }
                for score, values in scores.items()
            },
        }
    return {"placements": count, "metrics": table}


def _placement(
    plan: Plan, k: int, units: dict[Any, Any], metrics: dict[str, F64], scores: dict[str, F64], scenes: list[str]
) -> dict[str, Any]:
    layout = plan.placements[k]
    each = [units[layout.name, seed] for seed in plan.seeds]
    return {
        "name": layout.name,
        "pool": layout.pool,
        "metrics": {m: _mean(v[:, k]) for m, v in metrics.items()},
        "by_seed_and_scene": {m: v[:, k].tolist() for m, v in metrics.items()},
        "scores": {s: v[k].tolist() for s, v in scores.items()},
        "detail": {scene: [unit["scenes"][scene]["detail"] for unit in each] for scene in scenes},
        "curve": [unit["curve"][-1:] for unit in each],
    }


def gamed_last(plan: Plan, metrics: dict[str, F64]) -> dict[str, bool]:
    """Of each metric on fixed targets, whether all gamed placements are below all others of four LiDARs."""
    gamed = np.array([layout.pool == "gamed" for layout in plan.placements])
    four = np.array([layout.pool in ("box", "mixed") for layout in plan.placements])
    if not gamed.any() or not four.any():
        return {}
    mean = {m: np.nanmean(metrics[m].mean(axis=0), axis=1) for m in ("voxel_miou", "voxel_1m_miou", "birds_eye_miou")}
    return {m: bool(v[gamed].max() < v[four].min()) for m, v in mean.items()}


def _one_more(plan: Plan, metrics: dict[str, F64]) -> dict[str, list[float]]:
    """Means of the placements of one, two, … LiDARs, each with all of the one before."""
    line = [k for k, layout in enumerate(plan.placements) if layout.name.startswith("count-")]
    line.sort(key=lambda k: len(plan.placements[k].poses))
    return {m: [_mean(v[:, k]) for k in line] for m, v in metrics.items()} if line else {}


def _learnt(units: dict[Any, Any], plan: Plan) -> dict[str, Any]:
    """Placements whose learner is, on their own points, no better than the commonest group; only gamed ones may be."""
    failed = []
    for (name, seed), unit in units.items():
        own = [scene["metrics"]["own_miou"] for scene in unit["scenes"].values()]
        chance = [scene["detail"]["chance_miou"] for scene in unit["scenes"].values()]
        if not np.mean(np.array(own, float)) > np.mean(np.array(chance, float)) + 0.05:
            failed.append(f"{name}, seed {seed}")
    return {"units": len(units), "not_learnt": failed}


def _mean(values: F64) -> float:
    """Of what is finite; ``NaN`` of nothing, without a warning."""
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else float("nan")
