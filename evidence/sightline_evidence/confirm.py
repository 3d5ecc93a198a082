"""Judges the finalists of a search by a learner: ``sightline optimize SCENE --out DIR``, then ``python -m sightline_evidence confirm DIR``.

A shared U-Net is trained on generated worlds with the scene's own LiDARs, mount and body, once for each seed. It is
kept in a folder of ``DIR/learner``. It then judges the best placements of the search, and the best baseline, in worlds
that it has not seen. The table and ``learned.json`` say which one to take.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import learned, plan, stage, truth, worlds
from ._types import F64
from .correlate import Interval
from .files import read_json, write_json
from .layouts import Layout
from .learners import judge, unet
from .worlds import World

#: Worlds to learn and to judge in: kinds and seeds.
TRAIN = tuple((kind, seed) for seed in (501, 502) for kind in ("street", "highway", "residential", "yard"))
TEST = tuple((kind, seed) for seed in (601, 602) for kind in ("street", "highway", "residential", "yard"))

#: Frames of each, and the nets: some five minutes on two quiet cores.
FRAMES, SETTINGS = 2, unet.Settings(steps=1000)

#: Finalists that are judged.
FINALISTS = 5

#: Metric that judges them.
METRIC = "birds_eye_miou"

#: Draws of the bootstrap over worlds and seeds.
DRAWS = 2000


@dataclass(frozen=True)
class Candidate:
    """A placement with the score that the search gave it."""

    name: str
    kind: str
    score: float | None
    poses: F64


def candidates(run: Path) -> tuple[str, list[Candidate]]:
    """The objective of a finished run, its five best placements, best first, and its best baseline."""
    result = read_json(run / "result.json")
    if result.get("settings", {}).get("vehicle"):
        raise ValueError(f"{run / 'result.json'}: is of a vehicle; learners know scenes with one `lidar` and one `mount` as yet")
    if not result.get("best"):
        raise ValueError(f"{run / 'result.json'}: the search found no placement; there is nothing to confirm")
    rest = [one for one in result.get("baselines", []) if one["objective"] is not None and not one["violations"]]
    known = [max(rest, key=lambda one: float(one["objective"]))] if rest else []
    baseline = [_candidate(one["placement"]["name"], one["placement"], one["objective"], "baseline") for one in known]
    found = [_candidate("best", result["best"]["placement"], result["best"]["objective"])]
    for one in _finalists(run):
        new = _candidate(f"finalist-{len(found) + 1}", one["placement"], (one.get("confirmed") or {}).get("value"))
        if len(found) < FINALISTS and not any(_same(new, old) for old in found + baseline):
            found.append(new)
    return result["objective"], found + baseline


def scene_of(run: Path) -> Path:
    """The first scene of a run, whose LiDAR, mount and body are taken."""
    inputs = read_json(run / "checkpoint.json")["inputs"]
    return next(Path(one["file"]) for one in inputs if one["file"].endswith(".json"))


def _finalists(run: Path) -> list[dict[str, Any]]:
    # A result names the best alone; the others stand in what a run goes on from.
    try:
        found: list[dict[str, Any]] = read_json(run / "checkpoint.json")["state"]["run"]["levels"]["finalists"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return sorted(found, key=lambda one: -((one.get("confirmed") or {}).get("value") or -np.inf))


def _candidate(name: str, placement: dict[str, Any], score: float | None, kind: str = "found") -> Candidate:
    keys = ("x", "y", "z", "roll", "pitch", "yaw")
    poses = np.array([[lidar.get(key, 0.0) for key in keys] for lidar in placement["lidars"]], dtype=np.float64)
    return Candidate(name, kind, score, poses)


def _same(a: Candidate, b: Candidate) -> bool:
    return a.poses.shape == b.poses.shape and bool(np.allclose(a.poses, b.poses, atol=1e-6))


def confirm(run: Path, learner: list[Path], jobs: int) -> dict[str, Any]:
    """Judges the candidates of a finished run; writes ``learned.json`` into its folder, and returns it."""
    objective, given = candidates(run)
    scene = scene_of(run)
    folder = run / "learner" / taught_with(scene)
    test = [_like(scene, kind, seed, "test", folder) for kind, seed in TEST]
    nets = learner or _taught(scene, test, folder, jobs)
    lidar = test[0].source().described["lidar"]
    tasks: list[stage.Task] = []
    for number, net in enumerate(nets, 1):
        tasks += [
            (folder / "units" / f"{one.name}-{number}.json", _judged, (test, one, lidar, net, number, folder)) for one in given
        ]
    for path, _, _ in tasks:
        # Another search may lie in this folder since: judging takes seconds, so it is done anew.
        path.unlink(missing_ok=True)
    stage.carry_out("confirming", tasks, jobs)
    # [candidates, seeds, worlds]
    metric = np.array(
        [[read_json(folder / "units" / f"{one.name}-{n}.json")[METRIC] for n in range(1, len(nets) + 1)] for one in given]
    )
    found = verdict(objective, given, metric)
    write_json(run / "learned.json", {**found, "worlds": [world.name for world in test], "learners": [str(n) for n in nets]})
    return found


def taught_with(scene: Path) -> str:
    """Name of the folder of worlds and nets: twelve digits of the SHA-256 of all that decides about them."""
    own = json.loads(scene.read_text(encoding="utf-8"))
    lidar = own.get("lidar", {})
    # A vendor's description of the LiDAR stands in a file of its own.
    file = (scene.parent / lidar["file"]).read_bytes() if "file" in lidar else b""
    of = {
        "scene": {key: own.get(key) for key in ("lidar", "mount")} | {"body": own.get("ego", {}).get("body")},
        "file": hashlib.sha256(file).hexdigest(),
        "worlds": [*TRAIN, *TEST],
        "frames": FRAMES,
        "settings": asdict(SETTINGS),
        "seeds": learned.SEEDS,
        "engine": plan.engine(),
    }
    return plan.digest(of)[:12]


def _like(scene: Path, kind: str, seed: int, role: str, folder: Path) -> World:
    """A generated world with the LiDAR, the mount and the body of a scene."""
    path = folder / "worlds" / f"{kind}-{seed}.json"
    if not path.is_file():
        worlds.generated(kind, seed, role, FRAMES, folder / "worlds")
    described, own = json.loads(path.read_text(encoding="utf-8")), json.loads(scene.read_text(encoding="utf-8"))
    if "vehicle" in own or "lidar" not in own:
        raise ValueError(f"{scene}: has a vehicle; learners know scenes with one `lidar` and one `mount` as yet")
    lidar = dict(own["lidar"])
    if "file" in lidar:
        lidar["file"] = str((scene.parent / lidar["file"]).resolve())
    changed = {**described, "lidar": lidar, "mount": own["mount"]}
    if own.get("ego", {}).get("body") and "shape" not in json.dumps(own["ego"]["body"]):
        changed["ego"] = {**described["ego"], "body": own["ego"]["body"]}
    if changed != described:
        write_json(path, changed)
    return worlds.world(path.stem, path, role, FRAMES)


def _taught(scene: Path, test: list[World], folder: Path, jobs: int) -> list[Path]:
    train = [_like(scene, kind, seed, "train", folder) for kind, seed in TRAIN]
    learned.prepare([*train, *test], folder, jobs)
    lidar = train[0].source().described["lidar"]
    tasks: list[stage.Task] = [
        (folder / f"seed-{s}.json", learned.teach, (train, test, folder, folder / "truth", s, SETTINGS, lidar)) for s in learned.SEEDS
    ]
    stage.carry_out("learning", tasks, jobs)
    return [folder / f"seed-{seed}.pt" for seed in learned.SEEDS]


def _judged(
    test: list[World], one: Candidate, lidar: dict[str, Any], net: Path, draw: int, folder: Path
) -> dict[str, list[float]]:
    unet.one_thread()
    taught, layout = unet.Unet.load(net), Layout(one.name, "found", one.poses, lidar)
    found: dict[str, list[float]] = {}
    for world in test:
        known = truth.cached(world.source(), world.sha256, world.frames, folder / "truth")
        for name, value in judge.judge(world, known, layout, draw, taught)["metrics"].items():
            found.setdefault(name, []).append(value)
    return found


def verdict(objective: str, given: list[Candidate], metric: F64) -> dict[str, Any]:
    """The table and what it says; ``metric`` is ``[candidates, seeds, worlds]``, the last candidate the baseline."""
    means = metric.mean(axis=(1, 2))
    best, first = int(means.argmax()), 0
    rows = [
        {"name": one.name, "kind": one.kind, "score": one.score, METRIC: asdict(_interval(metric[k])),
         "less_the_best_by_score": asdict(_interval(metric[k] - metric[first])), "poses": one.poses.tolist()}
        for k, one in enumerate(given)
    ]  # fmt: skip
    ahead = _interval(metric[best] - metric[first])
    if best == first:
        says = f"Take `{given[first].name}`: it is first by {objective} and by the learner."
    elif ahead.low > 0:
        says = (
            f"Take `{given[best].name}`: the learner gets {ahead.value:.3f} [{ahead.low:.3f} {ahead.high:.3f}] more from it "
            f"than from the placement that is first by {objective}."
        )
    else:
        says = (
            f"Take `{given[first].name}`, first by {objective}: that the learner gets {ahead.value:.3f} more from "
            f"`{given[best].name}` is within what worlds and seeds vary [{ahead.low:.3f} {ahead.high:.3f}]."
        )
    return {"objective": objective, "metric": METRIC, "candidates": rows, "says": says}


def _interval(values: F64) -> Interval:
    """Mean of ``[seeds, worlds]`` with its interval; both are drawn with replacement."""
    rng = np.random.default_rng(11)
    seeds, many = values.shape
    drawn = [
        values[rng.integers(0, seeds, seeds)][:, rng.integers(0, many, many)].mean() for _ in range(DRAWS)
    ]
    low, high = np.percentile(drawn, [2.5, 97.5])
    return Interval(float(values.mean()), float(low), float(high))


def table(found: dict[str, Any]) -> str:
    """Markdown, and the sentence."""
    lines = [f"| placement | {found['objective']} | map mIoU of the learner [95 %, worlds and seeds] | less the first |", "|---" * 4 + "|"]
    for row in found["candidates"]:
        name = row["name"] + (" (baseline)" if row["kind"] == "baseline" else "")
        score = "–" if row["score"] is None else f"{row['score']:.6g}"
        cells = [f"{v['value']:.3f} [{v['low']:.3f} {v['high']:.3f}]" for v in (row[found["metric"]], row["less_the_best_by_score"])]
        lines.append(f"| {name} | {score} | {' | '.join(cells)} |")
    return "\n".join([*lines, "", found["says"]])


def main(arguments: list[str]) -> int:
    """Runs the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m sightline_evidence confirm", description=__doc__)
    parser.add_argument("run", type=Path, help="folder of a finished `sightline optimize`")
    parser.add_argument("--learner", type=Path, action="append", default=[], help="trained network (.pt); without it two are trained")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes [all cores]")
    given = parser.parse_args(arguments)
    print(table(confirm(given.run.resolve(), given.learner, given.jobs)))
    print(f"wrote {given.run / 'learned.json'}")
    return 0
