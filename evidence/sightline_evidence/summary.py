"""The result of a study out of its units: correlations, ceilings, regrets, the rule, checks."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from . import correlate, decide, effects, parts
from ._types import F64, Bools
from .decide import SEED
from .designs import DESIGNS
from .files import is_whole, read_json
from .gathered import POOLS, Gathered, mean
from .plan import Plan

#: Metrics by which a gamed placement must lose.
HARD = ("voxel_miou", "voxel_1m_miou", "birds_eye_miou")


def of(plan: Plan, out: Path) -> dict[str, Any]:
    """All of ``result.json`` but for the time of this call; the same bytes for the same units, however many are there."""
    given = Gathered.of(plan, out)
    pools = {}
    for pool, among in POOLS.items():
        kept = given.pool(*among)
        if kept.sum() >= 4:
            pools[pool] = {**_pool(given, kept), "regret": decide.of(given, kept)}
    checks = {
        name: read_json(path)
        for name in ("shuffled-labels", "learning-curve")
        if is_whole(path := out / "checks" / f"{name}.json")
    }
    return {
        "plan_sha256": plan.sha256,
        "plan": plan.record,
        "made_by": _made_by(plan),
        "missing_units": given.missing,
        "targets": {scene: read_json(out / "truth" / f"{scene}.json") for scene in given.scenes},
        "placements": [_placement(given, k) for k in range(len(given.layouts))],
        "pools": pools,
        "effects": effects.of(given),
        "parts": parts.of(given),
        "agreement": effects.agreement(given),
        "checks": {
            **checks,
            "gamed_rank_last": gamed_last(given),
            "shuffled_is_random": {pool: _holds_1(of["regret"]["scores"]["shuffled"]["mean"]) for pool, of in pools.items()},
            "one_more_lidar": _one_more(given),
            "learnt": _learnt(given),
            "second_learner": _second(out),
        },
    }


def _made_by(plan: Plan) -> dict[str, Any]:
    """How scenes, searches and pools of the plan were asked for: with this they are made again."""
    design = DESIGNS.get(plan.record["design"])
    return {key: value for key, value in asdict(design).items() if value and key != "name"} if design else {}


def _pool(given: Gathered, kept: Bools) -> dict[str, Any]:
    table: dict[str, Any] = {}
    # Most metrics know the same placements, in whose draws scores are the same.
    known: dict[bytes, tuple[correlate.Drawn, dict[str, correlate.Means]]] = {}
    for metric, every in given.metrics.items():
        # Another learner may have judged some of them so far.
        judged = kept & np.isfinite(given.mean(metric)).any(axis=1)
        if judged.sum() < 4:
            continue
        by_seed, by_scene = every[:, judged], given.mean(metric)[judged]
        if judged.tobytes() not in known:
            drawn = correlate.Drawn.of(np.random.default_rng(SEED), *by_scene.shape)
            means = {s: correlate.Means.of(values[judged], drawn) for s, values in given.scores.items()}
            known[judged.tobytes()] = drawn, means
        drawn, scores = known[judged.tobytes()]
        of, over = correlate.Means.of(by_scene, drawn), mean(by_scene, 1)
        whole = np.isfinite(by_seed).any(axis=2).all(axis=0)
        table[metric] = {
            "placements": len(over),
            "noise_ceiling": correlate.noise_ceiling(mean(by_seed[:, whole], 2)),
            "noise_ceiling_of": int(whole.sum()),
            "spread": [float(np.nanmin(over)), float(np.nanmean(over)), float(np.nanmax(over))],
            "scores": {
                score: {
                    "spearman": asdict(correlate.spearman_of(one, of)),
                    "pearson": asdict(correlate.pearson_of(one, of)),
                    "partial_given_height": asdict(correlate.partial_of(one, of, scores["mean_height"])),
                    "partial_given_hits": asdict(correlate.partial_of(one, of, scores["hits"])),
                }
                for score, one in scores.items()
            },
        }
    return {"placements": int(kept.sum()), "metrics": table}


def _placement(given: Gathered, k: int) -> dict[str, Any]:
    layout = given.layouts[k]
    each = [given.units[layout.name, seed] for seed in given.seeds if (layout.name, seed) in given.units]
    return {
        "name": layout.name,
        "pool": layout.pool,
        "seeds": [unit["seed"] for unit in each],
        "metrics": {m: _mean(v[:, k]) for m, v in given.metrics.items()},
        "by_seed_and_scene": {m: v[:, k].tolist() for m, v in given.metrics.items()},
        "scores": {s: v[k].tolist() for s, v in given.scores.items()},
        "detail": {scene: [unit["scenes"][scene]["detail"] for unit in each] for scene in given.scenes},
        "curve": [unit["curve"][-1:] for unit in each],
    }


def gamed_last(given: Gathered) -> dict[str, bool]:
    """Whether all gamed placements are below all others of four LiDARs, by each metric on fixed targets."""
    gamed, four = given.pool("gamed"), given.pool("box", "mixed")
    if not gamed.any() or not four.any():
        return {}
    found = {m: mean(given.mean(m), 1) for m in HARD}
    return {m: bool(v[gamed].max() < v[four].min()) for m, v in found.items()}


def _holds_1(regret: dict[str, float]) -> bool:
    """Whether an interval holds the regret of a random placement."""
    return regret["low"] <= 1 <= regret["high"]


def _one_more(given: Gathered) -> dict[str, Any]:
    """Placements of one, two, … LiDARs, each with all of the one before: means, and each step paired over scenes."""
    line = [layout for layout in given.layouts if layout.name.startswith("count-")]
    line.sort(key=lambda layout: len(layout.poses))
    return {
        m: {
            "means": [_mean(given.metrics[m][:, given.number(layout.name)]) for layout in line],
            "steps": [asdict(decide.paired(given, m, b.name, a.name)) for a, b in zip(line, line[1:])],
        }
        for m in (given.metrics if line else ())
    }


def _learnt(given: Gathered) -> dict[str, Any]:
    """Placements whose learner is, on their own points, no better than the commonest group; only gamed ones may be."""
    failed = []
    for (name, seed), unit in given.units.items():
        own = [scene["metrics"]["own_miou"] for scene in unit["scenes"].values()]
        chance = [scene["detail"]["chance_miou"] for scene in unit["scenes"].values() if scene["detail"]]
        if chance and not np.mean(np.array(own, float)) > np.mean(np.array(chance, float)) + 0.05:
            failed.append(f"{name}, seed {seed}")
    return {"units": len(given.units), "not_learnt": failed}


def _second(out: Path) -> dict[str, Any] | str | None:
    """Plan of the second learner, if there is one; earlier programs did not write it down."""
    folder = out / "learned"
    if is_whole(folder / "plan.json"):
        found: dict[str, Any] = read_json(folder / "plan.json")
        return found
    return "settings not recorded" if (folder / "units").is_dir() else None


def _mean(values: F64) -> float:
    there = values[np.isfinite(values)]
    return float(there.mean()) if there.size else float("nan")
