"""A study, unit by unit on all cores; killed at any time, it goes on where it was."""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

import sightline

from . import plan as plans
from . import scores, summary, trial, truth
from .groups import GROUPS
from .layouts import Layout
from .learners import trees
from .metrics import segmentation
from .plan import Design, Plan

#: The placement that the checks of the learner are made with.
ANCHOR = "Center"

#: What is left to be done: the file that it writes, and the function that makes it.
Task = tuple[Path, Callable[..., Any], tuple[Any, ...]]


def run(design: Design, out: Path, scenes: Path, jobs: int) -> dict[str, Any]:
    """All of a study; writes ``plan.json`` before anything is learnt and ``result.json`` at the end, and returns it."""
    began = time.monotonic()
    if (out / "plan.json").exists():
        plan = plans.read(design, out, scenes)
        say(f"goes on with the plan {plan.sha256[:12]} of {out}")
    else:
        plan = plans.make(design, out, scenes, say)
    return carry_out(plan, out, jobs, began)


def carry_out(plan: Plan, out: Path, jobs: int, began: float) -> dict[str, Any]:
    """Whatever of a plan is not in ``out`` yet, and the result."""
    train, test = plan.of("train"), plan.of("test")
    _stage("truth", [(out / "truth" / f"{w.name}.json", make_truth, (w, out)) for w in test], jobs)
    tasks: list[Task] = [
        (out / "scores" / f"{w.name}.json", scores.of_world, (w, plan.placements)) for w in test
    ]
    _stage("scores", tasks, jobs)
    (anchor,) = [layout for layout in plan.placements if layout.name == ANCHOR] or plan.placements[:1]
    tasks = [
        (out / "checks" / "shuffled-labels.json", check_shuffled, (plan, anchor)),
        (out / "checks" / "learning-curve.json", check_curve, (plan, anchor)),
    ]
    tasks += [
        (out / "units" / f"{layout.name}-{seed}.json", unit, (plan, layout, seed, out))
        for seed in plan.seeds
        for layout in plan.placements
    ]
    say(f"{len(train)} scenes to train, {len(test)} to test, {len(plan.placements)} placements, plan {plan.sha256[:12]}")
    _stage("units", tasks, jobs)
    result = summary.of(plan, out)
    result["times"] = {"seconds_of_this_call": round(time.monotonic() - began, 1), "jobs": jobs}
    plans.write_json(out / "result.json", result)
    return result


def say(sentence: str) -> None:
    """Progress, to stderr."""
    print(f"evidence: {sentence}", file=sys.stderr, flush=True)


def make_truth(world: Any, out: Path) -> dict[str, Any]:
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
    described, labels = trial.gathered(seen)
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
        found["own_miou"].append(_quality(*trial.gathered(seen), unseen, plan)[0])
    return found


def _quality(described: Any, labels: Any, unseen: list[trial.Frame], plan: Plan) -> tuple[float, Any]:
    learner = trees.train(described, labels, plan.seeds[0], plan.learner)
    features, truths = trial.gathered(unseen)
    counts = segmentation.confusion(truths, learner.predict(features)[0], len(GROUPS))
    return segmentation.nuscenes(counts).mean, counts


def _stage(name: str, tasks: list[Task], jobs: int) -> None:
    left = [task for task in tasks if not is_whole(task[0])]
    if not left:
        return
    for path, _, _ in left:
        path.parent.mkdir(parents=True, exist_ok=True)
        for torn in path.parent.glob("*.tmp*"):
            torn.unlink(missing_ok=True)
    # Libraries of the workers shall not each take all cores.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    began = time.monotonic()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(left)), mp_context=context, initializer=_begin) as pool:
        pending = {pool.submit(_do, *task): task[0] for task in left}
        try:
            for done, future in enumerate(as_completed(pending), 1):
                future.result()
                rest = (time.monotonic() - began) / done * (len(left) - done)
                say(f"{name} {done}/{len(left)} {pending[future].stem}, {in_words(rest)} left")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def is_whole(path: Path) -> bool:
    """Whether a task's file is there and can be read."""
    try:
        json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return True


def in_words(seconds: float) -> str:
    """A duration as one reads it."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _do(path: Path, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    plans.write_json(path, work(*arguments))


def _begin() -> None:
    sightline.set_threads(1)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def follow() -> None:
        # A parent that is killed cannot tell its workers to end.
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
