"""A study, unit by unit on all cores; killed at any time, it goes on where it was."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from . import plan as plans
from . import scores, stage, summary, trial, truth
from .designs import DESIGNS
from .files import write_json
from .groups import GROUPS
from .layouts import Layout
from .learners import trees
from .metrics import segmentation
from .plan import Plan
from .stage import Task, say
from .tables import missing
from .worlds import World

#: The placement that the checks of the learner are made with.
ANCHOR = "Center"


def run(name: str, out: Path, scenes: Path, xodr: Path | None, jobs: int) -> dict[str, Any]:
    """All of a study; writes ``plan.json`` before anything is learnt and ``result.json`` at the end, and returns it."""
    began, design = time.monotonic(), DESIGNS[name]
    if (out / "plan.json").exists():
        plan = plans.read(design, out, scenes)
        say(f"goes on with the plan {plan.sha256[:12]} of {out}")
    else:
        plan = plans.make(design, out, scenes, xodr, jobs)
    return carry_out(plan, out, jobs, began)


def so_far(out: Path) -> dict[str, Any]:
    """The result of the units that a run has, written to ``result.json``; says how many are missing."""
    result = summary.of(plans.of_run(out, None), out)
    say(missing(result["missing_units"]))
    write_json(out / "result.json", result)
    return result


def carry_out(plan: Plan, out: Path, jobs: int, began: float) -> dict[str, Any]:
    """Whatever of a plan is not in ``out`` yet, and the result."""
    train, test = plan.of("train"), plan.of("test")
    stage.carry_out("truth", [(out / "truth" / f"{w.name}.json", make_truth, (w, out)) for w in test], jobs)
    tasks: list[Task] = [
        (out / "scores" / f"{w.name}.json", scores.of_world, (w, plan.placements)) for w in test
    ]
    stage.carry_out("scores", tasks, jobs)
    (anchor,) = [layout for layout in plan.placements if layout.name == ANCHOR] or plan.placements[:1]
    tasks = [
        (out / "checks" / "shuffled-labels.json", check_shuffled, (plan, anchor)),
        (out / "checks" / "learning-curve.json", check_curve, (plan, anchor)),
    ]
    tasks += [
        (out / "units" / f"{layout.name}-{seed}.json", unit, (plan, layout, seed, out))
        for layout, seed in plan.units()
    ]
    say(f"{len(train)} scenes to train, {len(test)} to test, {len(plan.placements)} placements, plan {plan.sha256[:12]}")
    stage.carry_out("units", tasks, jobs)
    result = summary.of(plan, out)
    result["times"] = {"seconds_of_this_call": round(time.monotonic() - began, 1), "jobs": jobs}
    write_json(out / "result.json", result)
    return result


def make_truth(world: World, out: Path) -> dict[str, Any]:
    """Makes a scene's targets; returns what stands in them."""
    found = truth.cached(world.source(), world.sha256, world.frames, out / "truth")
    voxels = np.sum([np.bincount(t.labels, minlength=len(GROUPS)) for t in found], axis=0)
    return {
        "voxels": {name: int(n) for name, n in zip(GROUPS, voxels) if n},
        "objects": int(sum((t.points >= truth.VISIBLE).sum() for t in found)),
    }


def unit(plan: Plan, layout: Layout, seed: int, out: Path) -> dict[str, Any]:
    """A placement, trained and judged with one seed."""
    began = time.monotonic()
    seen = [scan for world in plan.of("train") for scan in trial.frames_of(world, layout, seed)]
    learner = trial.learn(seen, seed, plan.learner)
    judged = {}
    for world in plan.of("test"):
        targets = truth.cached(world.source(), world.sha256, world.frames, out / "truth")
        judged[world.name] = trial.judge(world, targets, trial.frames_of(world, layout, seed), learner)
    return {
        "placement": layout.name,
        "seed": seed,
        "training_points": int(sum((scan.labels > 0).sum() for scan in seen)),
        "curve": learner.curve if learner else [],
        "scenes": judged,
        "seconds": round(time.monotonic() - began, 2),
    }


def check_shuffled(plan: Plan, layout: Layout) -> dict[str, float]:
    """mIoU of trees that were fed shuffled labels, beside that of the same trees with the right ones, and chance."""
    seen = [scan for world in plan.of("train") for scan in trial.frames_of(world, layout, plan.seeds[0])]
    unseen = [scan for world in plan.of("test") for scan in trial.frames_of(world, layout, plan.seeds[0])]
    described, labels = trial.sampled(seen, plan.learner.points, plan.seeds[0])
    wrong = np.random.default_rng(plan.seeds[0]).permutation(labels)
    right = {name: _quality(described, given, unseen, plan) for name, given in (("right", labels), ("shuffled", wrong))}
    counts = right["right"][1]
    return {"right": right["right"][0], "shuffled": right["shuffled"][0], "chance": trial.chance(counts)}


def check_curve(plan: Plan, layout: Layout) -> dict[str, list[float]]:
    """mIoU on the placement's own points in the test scenes, against the share of training scenes."""
    train = plan.of("train")
    unseen = [scan for world in plan.of("test") for scan in trial.frames_of(world, layout, plan.seeds[0])]
    counts = sorted({max(1, len(train) // 4), max(1, len(train) // 2), len(train)})
    found: dict[str, list[float]] = {"scenes": [], "own_miou": []}
    for count in counts:
        seen = [scan for world in train[:count] for scan in trial.frames_of(world, layout, plan.seeds[0])]
        found["scenes"].append(count)
        found["own_miou"].append(_quality(*trial.sampled(seen, plan.learner.points, plan.seeds[0]), unseen, plan)[0])
    return found


def _quality(described: Any, labels: Any, unseen: list[trial.Frame], plan: Plan) -> tuple[float, Any]:
    learner = trial.OnPoints(trees.train(described, labels, plan.seeds[0], plan.learner))
    counts = np.zeros((len(GROUPS), len(GROUPS)), np.int64)
    for scan in unseen:
        counts += segmentation.confusion(scan.labels, learner.predict(scan)[0], len(GROUPS))
    return segmentation.nuscenes(counts).mean, counts
