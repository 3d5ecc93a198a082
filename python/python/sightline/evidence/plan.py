"""What is to be done, written and hashed before anything is learnt."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import math
import os
import platform
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import sightline

from . import layouts, worlds
from .layouts import Layout
from .learners import trees
from .scores import SCORES
from .trial import METRICS
from .truth import DENSE, VERSION, VISIBLE, Source
from .worlds import LIDAR, World

#: Objectives whose optima are among the placements.
OBJECTIVES = ("information_gain", "m_sog_scaled")


@dataclass(frozen=True)
class Design:
    """How large a study is."""

    name: str
    #: Kinds and seeds of worlds.
    train: tuple[tuple[str, int], ...]
    test: tuple[tuple[str, int], ...]
    own: bool
    frames: int
    #: Random layouts in each of twelve strata.
    random: int
    #: Optima are searched on so many of the training worlds.
    searched: int
    evaluations: int
    seeds: tuple[int, ...]
    learner: trees.Settings


_KINDS = ("street", "highway", "residential", "yard", "town")

DESIGNS = {
    "quick": Design(
        name="quick",
        train=(*((kind, 1) for kind in _KINDS), ("street", 2)),
        test=(("street", 101), ("highway", 101), ("residential", 101), ("town", 101)),
        own=True,
        frames=2,
        random=1,
        searched=1,
        evaluations=60,
        seeds=(1, 2),
        learner=trees.Settings(),
    ),
    "standard": Design(
        name="standard",
        train=tuple((kind, seed) for seed in range(1, 5) for kind in _KINDS),
        test=tuple((kind, seed) for seed in range(101, 104) for kind in _KINDS[:4]),
        own=True,
        frames=2,
        random=4,
        searched=5,
        evaluations=120,
        seeds=(1, 2),
        learner=trees.Settings(points=120_000),
    ),
}


@dataclass(frozen=True)
class Plan:
    """A study, settled."""

    worlds: list[World]
    placements: list[Layout]
    seeds: list[int]
    learner: trees.Settings
    #: All of ``plan.json``.
    record: dict[str, Any]

    @property
    def sha256(self) -> str:
        """Of the canonical text of the record."""
        return digest(self.record)

    def of(self, role: str) -> list[World]:
        """Scenes to ``train`` or to ``test``."""
        return [world for world in self.worlds if world.role == role]


def digest(record: dict[str, Any]) -> str:
    """SHA-256 of a record's canonical JSON."""
    return hashlib.sha256(json.dumps(record, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def make(design: Design, out: Path, scenes: Path, say: Callable[[str], None]) -> Plan:
    """Makes worlds and layouts, searches optima on training worlds only, and writes ``plan.json``."""
    say("making worlds")
    made = out / "worlds"
    chosen = [worlds.generated(kind, seed, "train", design.frames, made) for kind, seed in design.train]
    chosen += [worlds.generated(kind, seed, "test", design.frames, made) for kind, seed in design.test]
    chosen += worlds.own(scenes, design.frames) if design.own else []
    train = [world for world in chosen if world.role == "train"]
    mount = train[0].source().described["mount"]
    placed = layouts.published() + layouts.staggered(LIDAR["azimuth_steps"])  # type: ignore[arg-type]
    placed += layouts.stratified(mount, design.random, seed=20)
    placed += layouts.mixed() + layouts.numbers() + layouts.gamed()
    for objective in OBJECTIVES:
        for world in train[: design.searched]:
            say(f"searching the optimum of {objective} in {world.name}")
            placed.append(_optimum(world, objective, design.evaluations))
    return settle(design, chosen, placed, out)


def settle(design: Design, chosen: list[World], placed: list[Layout], out: Path) -> Plan:
    """The plan of given scenes and layouts, written to ``out``."""
    names = [layout.name for layout in placed]
    if len(set(names)) < len(names):
        raise ValueError(f"placements: {', '.join(names)} hold a name twice")
    record = {
        "sightline_evidence": 1,
        "design": design.name,
        "versions": versions(),
        "scenes": [world.to_dict(out) for world in chosen],
        "lidar": LIDAR,
        "truth": {"version": VERSION, "lidar": DENSE, "visible_from_points": VISIBLE},
        "placements": [layout.to_dict() for layout in placed],
        "seeds": list(design.seeds),
        "learner": trees.describe(design.learner),
        "scores": list(SCORES),
        "metrics": list(METRICS),
    }
    record = json.loads(json.dumps(record))
    write_json(out / "plan.json", {"plan_sha256": digest(record), "plan": record})
    return Plan(chosen, placed, list(design.seeds), design.learner, record)


def read(design: Design, out: Path, scenes: Path) -> Plan:
    """The plan of an earlier run in ``out``; refuses what was changed since or made for something else."""
    path = out / "plan.json"
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        record = kept["plan"]
        is_whole = kept["plan_sha256"] == digest(record)
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: cannot be read ({error}); delete the folder or give another --out") from error
    if not is_whole:
        raise ValueError(f"{path}: was changed after it was hashed; delete the folder or give another --out")
    expected = {
        "design": design.name,
        "versions": versions(),
        "seeds": list(design.seeds),
        "learner": json.loads(json.dumps(trees.describe(design.learner))),
        "scores": list(SCORES),
        "metrics": list(METRICS),
    }
    for key, value in expected.items():
        if record[key] != value:
            raise ValueError(f"{path}: {key} is {record[key]}, now it is {value}; give another --out")
    chosen = [World.from_dict(world, out, scenes) for world in record["scenes"]]
    placed = [Layout.from_dict(layout) for layout in record["placements"]]
    return Plan(chosen, placed, record["seeds"], design.learner, record)


def versions() -> dict[str, str]:
    """Of what the numbers depend on."""
    packages = ("numpy", "scipy", "scikit-learn", "lightgbm")
    found = {name: importlib.metadata.version(name) for name in packages}
    return {"sightline": sightline.__version__, "python": platform.python_version(), **found}


def write_json(path: Path, value: Any) -> None:
    """Writes beside, then renames, so that a killed run leaves nothing half-written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    text = json.dumps(finite(value), indent=1, sort_keys=True, allow_nan=False)
    beside.write_text(text + "\n", encoding="utf-8")
    os.replace(beside, path)


def finite(value: Any) -> Any:
    """JSON has no ``NaN``: ``null`` in its place."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _optimum(world: World, objective: str, evaluations: int) -> Layout:
    scene = worlds.opened(Source.read(world.path), frames=2)
    found = sightline.optimize([scene], objective=objective, evaluations=evaluations, seed=1)
    if found.best is None:
        raise ValueError(f"{world.path}: the search for {objective} found no placement within the mount's rules")
    return Layout(f"best-{objective}-{world.name}", "box", found.best.poses)
