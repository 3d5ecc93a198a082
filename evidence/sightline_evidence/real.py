"""The trees between generated worlds and real scans: ``python -m sightline_evidence real --kitti DIR --out DIR``.

Learns the groups of points on scans of generated worlds, of one sensor like that of SemanticKITTI, and on the real
scans in ``DIR`` (``sequences/NN/velodyne/*.bin`` and ``labels/*.label``), and judges each on both. Real scans are never
judged by what was learnt in their own sequence. Writes ``plan.json`` first, ``real.json`` and ``real.md`` at the end. The sensor stands in one place, so
that this says whether generated geometry looks like the real one to the learner, not which placement is better.
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

from . import decide, plan, trial, worlds
from ._types import F32, I64, U8
from .designs import KINDS
from .files import is_whole, read_json, write_json
from .labels import COMMON, KITTI_CLASS, SEMANTICKITTI, common_of
from .layouts import Layout
from .learners import trees
from .metrics import segmentation
from .stage import Task, carry_out, say
from .tables import head, interval, number, row
from .trial import Frame

#: Like the HDL-64E of the real scans, and where it stands: 1.73 m over the ground.
LIDAR = {"channels": 64, "fov": [-24.8, 2.0], "azimuth_steps": 1800, "range": 120.0}
HEIGHT = 1.73

#: Metres in plan, the region in which scans are compared: what SemanticKITTI calls its own for scene completion.
REACH = 51.2

#: Seeds of the generated worlds to train and to test, two frames of each.
TRAIN, TEST, FRAMES = (1, 2), (101,), 2

#: Most scans of a real sequence, spread over it.
MOST = 5

#: Points that trees learn from.
LEARNER = trees.Settings(points=120_000)

#: Points of each scan that are judged, drawn at random: describing all would take minutes and tell no more.
JUDGED = 20_000


@dataclass(frozen=True)
class Described:
    """Points of one scan by their features ``[P, F]``, with their groups of ``COMMON`` ``[P]``."""

    #: Sequence or world: what must not be in training and test at once.
    place: str
    features: F32
    labels: U8


def sequences(folder: Path) -> list[tuple[str, Path, Path]]:
    """Sequence, points and labels of at most ``MOST`` labelled scans of each sequence."""
    found: list[tuple[str, Path, Path]] = []
    for sequence in sorted((folder / "sequences").glob("[0-9][0-9]")):
        scans = [path for path in sorted((sequence / "velodyne").glob("*.bin")) if _labels(path).is_file()]
        spread = np.linspace(0, len(scans) - 1, min(MOST, len(scans)))
        kept = sorted(set(spread.round().astype(int).tolist()))
        found += [(sequence.name, scans[k], _labels(scans[k])) for k in kept]
    if len({sequence for sequence, _, _ in found}) < 2:
        raise ValueError(
            f"{folder}: holds labelled scans of fewer than two sequences; give the folder that holds "
            "sequences/NN/velodyne/*.bin and sequences/NN/labels/*.label"
        )
    return found


def _labels(points: Path) -> Path:
    return points.parent.parent / "labels" / f"{points.stem}.label"


def read_scan(points: Path, labels: Path) -> Frame:
    """A real scan in the ego frame: origin on the ground beneath the sensor."""
    xyz = np.fromfile(points, "<f4")
    raw = np.fromfile(labels, "<u4")
    if xyz.size != 4 * raw.size:
        raise ValueError(f"{labels}: holds {raw.size} labels, {points.name} {xyz.size / 4:g} points; give files that belong together")
    classes = np.zeros(65536, np.uint8)
    for label, number in KITTI_CLASS.items():
        classes[label] = number
    moved = xyz.reshape(-1, 4)[:, :3].astype(np.float64) + [0, 0, HEIGHT]
    return within(Frame(moved, SEMANTICKITTI.groups(classes[raw & 0xFFFF]), {}))


def scans_of(world: worlds.World, layout: Layout, seed: int) -> list[Frame]:
    """Scans of a generated world, in the groups that real scans have."""
    return [within(Frame(f.xyz, common_of(f.labels), {})) for f in trial.frames_of(world, layout, seed)]


def within(scan: Frame) -> Frame:
    """The points within the region that is compared."""
    near = np.abs(scan.xyz[:, :2]).max(axis=1) < REACH
    return Frame(scan.xyz[near], scan.labels[near], {})


def describe(scan: Frame, place: str, seed: int) -> Described:
    """Features of ``JUDGED`` labelled points of a scan."""
    labelled = np.flatnonzero(scan.labels)
    kept = np.sort(np.random.default_rng([seed, 6]).permutation(labelled)[:JUDGED])
    return Described(place, trees.features(scan.xyz, kept), scan.labels[kept])


def learn(scans: list[Described], seed: int) -> trees.Trees:
    """Trees on as many points of every scan."""
    described = np.concatenate([scan.features for scan in scans])
    return trees.train(described, np.concatenate([scan.labels for scan in scans]), seed, LEARNER)


def counts(learner: trees.Trees, scan: Described) -> I64:
    """Confusion ``[truth, predicted]`` on a scan."""
    return segmentation.confusion(scan.labels, learner.predict(scan.features)[0], len(COMMON))


def summed(each: list[I64]) -> dict[str, Any]:
    """mIoU over all scans, with an interval over scans, and IoU by group; chance beside it."""
    total = np.sum(each, axis=0)
    found = segmentation.nuscenes(total)
    by_scan = decide.over_scenes(np.array([segmentation.nuscenes(one).mean for one in each]))
    return {
        "scans": len(each),
        "miou": found.mean,
        "mean_of_scans": asdict(by_scan),
        "chance": trial.chance(total),
        "iou": {name: float(iou) for name, iou in zip(COMMON, found.by_class) if np.isfinite(iou)},
    }


def store(folder: Path, scans: list[Described]) -> dict[str, int]:
    """Writes described scans to ``folder``; returns how many there are, by place."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, scan in enumerate(scans):
        np.savez(folder / f"{scan.place}-{number}.npz", features=scan.features, labels=scan.labels)
    return {scan.place: len(scans) for scan in scans}


def load(folder: Path, place: str) -> list[Described]:
    """Reads what ``store`` wrote of a place."""
    found = []
    for path in sorted(folder.glob(f"{place}-*.npz")):
        with np.load(path) as kept:
            found.append(Described(place, kept["features"], kept["labels"]))
    return found


def prepare_real(files: list[tuple[str, Path, Path]], folder: Path) -> dict[str, int]:
    """Describes the scans of one sequence."""
    return store(folder, [describe(read_scan(p, l), f"real-{sequence}", k) for k, (sequence, p, l) in enumerate(files)])


def prepare_world(kind: str, seed: int, folder: Path) -> dict[str, int]:
    """Makes and describes the scans of one generated world."""
    world = worlds.generated(kind, seed, "train", FRAMES, folder / "worlds")
    layout = Layout("hdl", "sensor", np.array([[0.0, 0, HEIGHT, 0, 0, 0]]), LIDAR)
    return store(folder, [describe(scan, world.name, k) for k, scan in enumerate(scans_of(world, layout, 1))])


def judged(real: list[list[Described]], train: list[Described], test: list[Described], seed: int) -> dict[str, Any]:
    """Learnt on generated and on real scans, judged on both; each real sequence by what the others taught."""
    ours = learn(train, seed)
    everywhere = [scan for sequence in real for scan in sequence]
    cells: dict[str, dict[str, Any]] = {"generated": {}, "real": {}}
    cells["generated"]["generated"] = summed([counts(ours, scan) for scan in test])
    cells["generated"]["real"] = summed([counts(ours, scan) for scan in everywhere])
    theirs: list[I64] = []
    for k, sequence in enumerate(real):
        others = [scan for j, one in enumerate(real) for scan in one if j != k]
        learner = learn(others, seed)
        theirs += [counts(learner, scan) for scan in sequence]
    cells["real"]["real"] = summed(theirs)
    from_real = learn(everywhere, seed)
    cells["real"]["generated"] = summed([counts(from_real, scan) for scan in test])
    rng = np.random.default_rng([seed, 8])
    shuffled = [Described(scan.place, scan.features, rng.permutation(scan.labels)) for scan in train]
    cells["shuffled"] = {"real": summed([counts(learn(shuffled, seed), scan) for scan in everywhere])}
    return cells


def settled(files: list[tuple[str, Path, Path]], out: Path) -> dict[str, Any]:
    """Writes to ``plan.json`` which scans are read and how, before any is; refuses a folder of other scans or versions."""
    path = out / "plan.json"
    wanted = {
        "scans": {f"{name}/{file.parent.name}/{file.name}": _sha256(file) for name, *both in files for file in both},
        "worlds": {"train": list(TRAIN), "test": list(TEST), "frames": FRAMES},
        "lidar": LIDAR,
        "height": HEIGHT,
        "reach": REACH,
        "judged_points": JUDGED,
        "learner": json.loads(json.dumps(trees.describe(LEARNER))),
        "versions": plan.versions(),
    }
    if is_whole(path):
        kept = read_json(path)
        for key, value in wanted.items():
            if kept.get(key) != value:
                raise ValueError(f"{path}: {key} are not those of this call; give another --out")
    elif (out / "scans").is_dir():
        raise ValueError(f"{out}: holds scans of which nothing was recorded; give another --out")
    else:
        write_json(path, wanted)
    return wanted


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def table(result: dict[str, Any]) -> str:
    """The cells as Markdown."""
    names = [name for name in COMMON if any(name in of["iou"] for cells in result["cells"].values() for of in cells.values())]
    text = "# Generated and real scans\n\nmIoU over points [mean of scans, 95 % over scans], IoU by group.\n\n"
    text += head(["learnt on", "judged on", "scans", "mIoU", "mean of scans", "chance", *names])
    for learnt, cells in result["cells"].items():
        for tested, of in cells.items():
            values = [number(of["miou"], 3), interval(of["mean_of_scans"], 3), number(of["chance"], 3)]
            text += row([learnt, tested, str(of["scans"]), *values, *(number(of["iou"].get(name), 2) for name in names)])
    return text


def main(words: list[str]) -> int:
    """Runs the command; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m sightline_evidence real", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, required=True, help="folder that holds sequences/")
    parser.add_argument("--out", type=Path, required=True, help="folder of the run; one that is there goes on")
    parser.add_argument("--seed", type=int, default=1, help="of the trees [1]")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes [all cores]")
    given = parser.parse_args(words)
    files = sequences(given.kitti)
    names = sorted({sequence for sequence, _, _ in files})
    folder, settings = given.out / "scans", settled(files, given.out)
    generated = [(kind, seed) for seed in (*TRAIN, *TEST) for kind in KINDS]
    tasks: list[Task] = [
        (folder / f"real-{name}.json", prepare_real, ([one for one in files if one[0] == name], folder)) for name in names
    ]
    tasks += [(folder / f"{kind}-{seed}.json", prepare_world, (kind, seed, folder)) for kind, seed in generated]
    carry_out("scans", tasks, given.jobs)
    real = [load(folder, f"real-{name}") for name in names]
    train, test = ([scan for seed in seeds for kind in KINDS for scan in load(folder, f"{kind}-{seed}")] for seeds in (TRAIN, TEST))
    say("learns")
    result = {
        "plan": settings,
        "scans": {name: read_json(folder / f"real-{name}.json") for name in names},
        "seed": given.seed,
        "cells": judged(real, train, test, given.seed),
    }
    write_json(given.out / "real.json", result)
    (given.out / "real.md").write_text(table(result), encoding="utf-8")
    print(table(result))
    return 0
