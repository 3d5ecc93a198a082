"""The second learner of a study: ``python -m sightline_evidence learned --out DIR``, after ``quick`` or ``standard``.

A bird's-eye U-Net is trained on the study's training worlds, once for each seed, and judges all placements of the plan
in its test scenes; ``--anew NAME …`` also trains one for a placement alone. Everything lies in ``DIR/learned``, whose
``plan.json`` says what is learnt by which settings and versions.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import os
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from . import agreement, stage, truth, worlds
from . import plan as plans
from .files import is_whole, read_json, write_json
from .layouts import Layout
from .learners import judge, shared, unet
from .plan import Plan
from .worlds import World

#: Frames of each training world; more than trees have, which learn from points.
FRAMES = 3

#: Seeds of the trainings.
SEEDS = (1, 2)

#: Size of the nets.
SETTINGS = unet.Settings()

#: Share of the steps of a net that is trained for a placement alone, and of the one with shuffled labels.
PART = 2

#: Frames that are looked at while a net learns.
LOOKED = 8


def settled(plan: Plan, folder: Path, settings: unet.Settings) -> None:
    """Writes what is to be learnt, and by what, to ``plan.json`` of the stage; refuses a folder of anything else.

    Before anything is learnt, as the study's own plan.
    """
    path = folder / "plan.json"
    wanted = {
        "study": plan.sha256,
        "settings": asdict(settings),
        "frames": FRAMES,
        "seeds": list(SEEDS),
        "torch": importlib.metadata.version("torch"),
        "engine": plans.engine(),
    }
    if is_whole(path):
        kept = read_json(path)
        for key, value in wanted.items():
            if kept.get(key) != value:
                raise ValueError(f"{path}: {key} is {kept.get(key)}, now it is {value}; delete {folder} to learn anew")
    elif any(folder.glob("seed-*")):
        raise ValueError(f"{folder}: holds nets whose settings were not recorded; delete it to learn anew, or read it with tables")
    else:
        write_json(path, wanted)


def carry_out(plan: Plan, out: Path, anew: list[str], settings: unet.Settings, jobs: int) -> None:
    """Whatever of the stage is not in ``out/learned`` yet."""
    layouts = {layout.name: layout for layout in plan.placements}
    for name in anew:
        if name not in layouts:
            raise ValueError(f"--anew: the plan has no placement {name}; it has {', '.join(layouts)}")
    folder = out / "learned"
    settled(plan, folder, settings)
    train = [worlds.world(world.name, world.path, "train", FRAMES) for world in plan.of("train")]
    test = plan.of("test")
    prepare(train, folder, jobs)
    tasks: list[stage.Task] = [
        (folder / f"seed-{seed}.json", teach, (train, test, folder, out / "truth", seed, settings)) for seed in SEEDS
    ]
    stage.carry_out("U-Net, training", tasks, jobs)
    tasks = [
        (folder / "units" / f"{layout.name}-{seed}.json", unit, (test, layout, seed, folder / f"seed-{seed}.pt", out / "truth"))
        for seed in SEEDS
        for layout in plan.placements
    ]
    stage.carry_out("U-Net, placements", tasks, jobs)
    tasks = [(folder / "shuffled-labels.json", check, (train, test, folder, out / "truth", settings))]
    tasks += [
        (folder / "anew" / f"{name}-1.json", teach_anew, (train, test, layouts[name], folder, out / "truth", settings))
        for name in anew
    ]
    stage.carry_out("U-Net, checks and anew", tasks, jobs)


def prepare(train: list[World], folder: Path, jobs: int) -> None:
    """Targets of the training worlds."""
    tasks: list[stage.Task] = [(folder / "truth" / f"{w.name}.json", _targets, (w, folder)) for w in train]
    stage.carry_out("U-Net, targets", tasks, jobs)


def _targets(world: World, folder: Path) -> dict[str, Any]:
    found = truth.cached(world.source(), world.sha256, world.frames, folder / "truth")
    return {"objects": [int((t.points >= truth.VISIBLE).sum()) for t in found]}


def lessons_of(given: list[World], folder: Path, cell: int, lidar: dict[str, Any] | None = None) -> list[shared.Lesson]:
    """Frames with targets, which are kept in ``folder``."""
    known = [(world, truth.cached(world.source(), world.sha256, world.frames, folder)) for world in given]
    return shared.lessons(known, cell, lidar)


def teach(
    train: list[World], test: list[World], folder: Path, truths: Path, seed: int, settings: unet.Settings,
    lidar: dict[str, Any] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Trains the shared net with a seed into ``seed-N.pt``; its curve, and how well it does while it learns.

    The frames that are looked at are of test scenes, seen by random rigs; nothing is chosen by them.
    """
    unet.one_thread()
    began, spent = time.monotonic(), time.process_time()
    at = shared.lesson_at(lessons_of(train, folder / "truth", settings.cell, lidar), seed)
    unseen = shared.lesson_at(lessons_of(test, truths, settings.cell, lidar), 1000 + seed)
    held = [unseen(step) for step in range(LOOKED)]
    looks: dict[str, list[float]] = {"step": [], "birds_eye_miou": [], "chance": []}

    def look(step: int, net: unet.Unet) -> None:
        found, chance = shared.quality(net, held)
        for name, value in zip(looks, (float(step), found, chance)):
            looks[name].append(value)
        rest = (time.monotonic() - began) / step * (settings.steps - step)
        stage.say(f"U-Net, seed {seed}: step {step} of {settings.steps}, map {found:.3f}, {stage.in_words(rest)} left")

    net = unet.train(at, seed, settings, folder / f"seed-{seed}.pt", look)
    return {
        "seed": seed,
        "frames": sum(len(world.frames) for world in train),
        "curve": [sum(part) / len(part) for part in _parts(net.curve, 30)],
        "looks": looks,
        "cpu_seconds": round(time.process_time() - spent, 1),
        "steps": settings.steps,
    }


def _parts(curve: list[float], count: int) -> list[list[float]]:
    edges = [len(curve) * k // count for k in range(count + 1)]
    return [curve[a:b] for a, b in zip(edges, edges[1:]) if b > a]


def check(train: list[World], test: list[World], folder: Path, truths: Path, settings: unet.Settings) -> dict[str, float]:
    """mIoU of the maps of a net that was fed shuffled labels, of one with the right ones and as many steps, and chance."""
    unet.one_thread()
    at = shared.lesson_at(lessons_of(train, folder / "truth", settings.cell), SEEDS[0])
    unseen = shared.lesson_at(lessons_of(test, truths, settings.cell), 1000 + SEEDS[0])
    held, short = [unseen(step) for step in range(2 * LOOKED)], shortened(settings, 3 * PART)
    found = {}
    for name, source in (("right", at), ("shuffled", shared.shuffled(at, SEEDS[0]))):
        found[name], found["chance"] = shared.quality(unet.train(source, SEEDS[0], short), held)
    return found


def shortened(settings: unet.Settings, part: int) -> unet.Settings:
    """Settings with one of ``part`` steps."""
    return unet.Settings(max(settings.steps // part, 1), settings.width, settings.rate, settings.cell)


def unit(test: list[World], layout: Layout, seed: int, file: Path, truths: Path) -> dict[str, Any]:
    """A placement judged in all test scenes by the net of a seed."""
    unet.one_thread()
    spent = time.process_time()
    net = unet.Unet.load(file)
    found = _judged(test, layout, seed, net, truths)
    return {**found, "curve": net.curve[-1:], "cpu_seconds": round(time.process_time() - spent, 2)}


def _judged(test: list[World], layout: Layout, seed: int, net: unet.Unet, truths: Path) -> dict[str, Any]:
    scenes = {}
    for world in test:
        targets = truth.cached(world.source(), world.sha256, world.frames, truths)
        scenes[world.name] = judge.judge(world, targets, layout, seed, net)
    return {"placement": layout.name, "seed": seed, "scenes": scenes}


def teach_anew(
    train: list[World], test: list[World], layout: Layout, folder: Path, truths: Path, settings: unet.Settings
) -> dict[str, Any]:
    """A placement trained and judged with a net of its own, of part of the steps of the shared one."""
    unet.one_thread()
    spent, seed = time.process_time(), SEEDS[0]
    at = shared.lesson_at(lessons_of(train, folder / "truth", settings.cell), seed, only=layout)
    net = unet.train(at, seed, shortened(settings, PART))
    found = _judged(test, layout, seed, net, truths)
    return {**found, "curve": net.curve[-1:], "cpu_seconds": round(time.process_time() - spent, 2)}


def main(arguments: list[str]) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m sightline_evidence learned", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder of a run that has its plan")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of the own four scenes [scenes]")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes [all cores]")
    parser.add_argument("--steps", type=int, default=SETTINGS.steps, help=f"of a training [{SETTINGS.steps}]")
    parser.add_argument("--anew", nargs="+", default=[], metavar="NAME", help="placements with a net of their own")
    given = parser.parse_args(arguments)
    if min(given.jobs, given.steps) < 1:
        parser.error("--jobs, --steps: give 1 or more")
    out = given.out.resolve()
    plan = plans.of_run(out, given.scenes.resolve())
    settings = unet.Settings(given.steps, SETTINGS.width, SETTINGS.rate, SETTINGS.cell)
    carry_out(plan, out, given.anew, settings, given.jobs)
    print(agreement.table(plan, out))
    return 0
