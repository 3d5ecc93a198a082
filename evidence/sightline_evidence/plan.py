"""Plan of a study, written and hashed before anything is learnt."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import sightline
from sightline import _native

from . import layouts, pool, stage, worlds
from .candidates import CANDIDATES
from .designs import DESIGNS, Design
from .files import read_json, write_json
from .layouts import Layout
from .learners import trees
from .scores import SCORES
from .trial import METRICS
from .truth import DENSE, VERSION, VISIBLE, Source
from .worlds import LIDAR, World

#: Scores that the engine maximizes: their optima are among the placements, and one of these is the default whatever comes out.
OBJECTIVES = ("near_gain", "information_gain", "m_sog_scaled", "m_sog_scaled_nonzero")

#: Candidates whose optima over a pool of poses are, of four in the mount and of two there and two low round the body.
#: Left to themselves all of these chose four in the mount, in the pool of the standard run.
IN_THE_MOUNT = ("gain", *(name for name in CANDIDATES if name not in ("gain", "actors_20", "gain_low")))
WITH_LOW = ("gain", "covered_occupied", "distinct_voxels", "actors_5", "blend", "near_and_ground")

#: Scenes that tell a difference of .01 apart with 80 % power, by the spread over scenes of the third standard run.
SCENES_NEEDED = {"birds_eye_miou": 28, "voxel_1m_miou": 29, "ground_seen_10m": 12, "objects_5": 280}

#: Compact record of the standard run, from the folder of the project: ``towns`` takes placements of it.
STANDARD = Path("evidence/runs/standard.json.gz")

#: Placements that have their second seed first.
ANCHORS = ("Center", "Line", "Square", "Pyramid", "Ours-seg", "Ours-det", "Center-staggered", "count-1", "count-6", "sky")


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
        """Hash of the record's canonical text."""
        return digest(self.record)

    def of(self, role: str) -> list[World]:
        """Scenes to ``train`` or to ``test``."""
        return [world for world in self.worlds if world.role == role]

    def units(self) -> list[tuple[Layout, int]]:
        """Placements and seeds in the order of their doing, such that a run that is cut short has some of everything.

        First seed: published ones and optima, one random one of each stratum, the rest. Then further seeds, of anchors
        and optima first.
        """
        first = sorted(self.placements, key=_turn)
        more = [(layout, seed) for seed in self.seeds[1:] for layout in first]
        more.sort(key=lambda unit: unit[0].name not in ANCHORS and not unit[0].name.startswith("best-"))
        return [(layout, self.seeds[0]) for layout in first] + more


def _turn(layout: Layout) -> int:
    if layout.name.startswith("random-"):
        return 1 if layout.name.endswith("-0") else 3
    return 0 if layout.pool == "box" else 2


def digest(record: dict[str, Any]) -> str:
    """SHA-256 of a record's canonical JSON."""
    return hashlib.sha256(json.dumps(record, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def make(design: Design, out: Path, scenes: Path, xodr: Path | None, jobs: int) -> Plan:
    """Makes worlds and layouts, searches optima on training worlds only, and writes ``plan.json``.

    Without a folder of OpenDRIVE maps the towns made on them are left out.
    """
    chosen = worlds_of(design, out, scenes, xodr)
    placed = _PLACED[design.placements](design, chosen, out / "pool", jobs)
    return settle(design, chosen, layouts.out_of_step(placed), out)


def worlds_of(design: Design, out: Path, scenes: Path, xodr: Path | None) -> list[World]:
    """The scenes of a study; those that are not in ``out`` yet are made there."""
    stage.say("making worlds")
    made = out / "worlds"
    chosen = [worlds.generated(kind, seed, "train", design.frames, made) for kind, seed in design.train]
    chosen += [worlds.generated(kind, seed, "test", design.frames, made) for kind, seed in design.test]
    for role, towns in (("train", design.train_towns), ("test", design.test_towns)):
        if xodr is None and towns:
            stage.say(f"without --xodr: {', '.join(dict(towns))} to {role} are left out")
        elif xodr is not None:
            # Several towns on a map are told apart by their seeds.
            count = Counter(name for name, _ in towns)
            called = [f"{name}-{seed}" if count[name] > 1 else name for name, seed in towns]
            chosen += [worlds.imported(xodr, *town, role, design.frames, made, c) for town, c in zip(towns, called)]
    return chosen + (worlds.own(scenes, design.frames) if design.own else [])


def _study(design: Design, chosen: list[World], folder: Path, jobs: int) -> list[Layout]:
    train = [world for world in chosen if world.role == "train"]
    mount = train[0].source().described["mount"]
    placed = layouts.published() + _optima(design, train, mount, folder, jobs)
    placed += layouts.in_step_and_staggered()
    placed += layouts.mixed() + layouts.numbers() + layouts.gamed() + layouts.sensors()
    return placed + layouts.stratified(mount, design.random, seed=20)


def _first_of_stratum(name: str) -> bool:
    """True for the first random placement of a stratum, and for every placement that is not random."""
    return not name.startswith("random-") or name.endswith("-0")


def _towns() -> list[Layout]:
    """Four in the mount of the standard run, of random ones one of each stratum, all in the phases of then."""
    return [one for one in map(Layout.from_dict, read_json(STANDARD)["plan"]["placements"]) if one.pool == "box" and _first_of_stratum(one.name)]


#: Placements of each sort of design.
_PLACED: dict[str, Callable[[Design, list[World], Path, int], list[Layout]]] = {
    "study": _study,
    "towns": lambda design, chosen, folder, jobs: _towns(),
}


def _optima(design: Design, train: list[World], mount: dict[str, Any], folder: Path, jobs: int) -> list[Layout]:
    """Optima of the engine's objectives, then of the candidates; searched in training worlds alone."""
    tasks: list[stage.Task] = []
    for number in range(design.searches):
        # Worlds of all kinds, other ones in each search.
        group = [train[(number + k * design.searches) % len(train)] for k in range(design.searched)]
        tasks += [
            (folder / f"best-{name}-{number + 1}.json", _optimum, (group, name, design.evaluations, number + 1))
            for name in OBJECTIVES
        ]
    poses, kinds = pool.drawn(mount, *design.poses, seed=1)
    casts: list[stage.Task] = [(folder / f"{w.name}.json", pool.cast, (w, poses, folder)) for w in train]
    stage.carry_out("pool", casts if len(poses) else [], jobs)
    names, inside = [world.name for world in train], kinds == pool.INSIDE
    apart = float(mount.get("min_distance", 0.0))
    for group_name, allowed, among in (
        ("box", [inside] * 4, IN_THE_MOUNT),
        ("low", [inside, inside, ~inside, ~inside], WITH_LOW),
    ):
        tasks += [
            (folder / f"pool-{name}-{group_name}.json", pool.optimum, (name, names, folder, poses, allowed, apart))
            for name in among
            if len(poses)
        ]
    stage.carry_out("optima", tasks, jobs)
    found = []
    for path, _, _ in tasks:
        kind = "mixed" if path.stem.endswith("-low") else "box"
        found.append(Layout(f"best-{path.stem.removeprefix('best-')}", kind, np.array(read_json(path)["poses"])))
    return found


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
        "candidates": CANDIDATES,
        "metrics": list(METRICS),
        "scenes_needed_for_a_hundredth": SCENES_NEEDED,
    }
    record = json.loads(json.dumps(record))
    write_json(out / "plan.json", {"plan_sha256": digest(record), "plan": record})
    return Plan(chosen, placed, list(design.seeds), design.learner, record)


def of_run(out: Path, scenes: Path | None) -> Plan:
    """``read`` of a folder whose design is not known before."""
    path = out / "plan.json"
    if not path.is_file():
        raise ValueError(f"{path}: is not there; run a study, as quick or standard, with this --out first")
    name = _record(path).get("design")
    if name not in DESIGNS:
        raise ValueError(f"{path}: the design {name} is none of {', '.join(DESIGNS)}")
    return read(DESIGNS[name], out, scenes)


def read(design: Design, out: Path, scenes: Path | None) -> Plan:
    """The plan of an earlier run in ``out``; refuses what was changed since or made for something else.

    Without ``scenes`` their files are not looked at, which is enough to sum up what was measured.
    """
    path = out / "plan.json"
    record = _record(path)
    expected = {
        "design": design.name,
        "versions": versions(),
        "seeds": list(design.seeds),
        "learner": json.loads(json.dumps(trees.describe(design.learner))),
        "scores": list(SCORES),
        "metrics": list(METRICS),
    }
    for key, value in expected.items():
        if record.get(key) != value:
            raise ValueError(f"{path}: {key} is {record.get(key)}, now it is {value}; give another --out")
    chosen = [World.from_dict(world, out, scenes) for world in record["scenes"]]
    placed = [Layout.from_dict(layout) for layout in record["placements"]]
    return Plan(chosen, placed, record["seeds"], design.learner, record)


def _record(path: Path) -> dict[str, Any]:
    """The plan in a file, if it is as it was hashed."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        record: dict[str, Any] = kept["plan"]
        is_whole = isinstance(record, dict) and kept["plan_sha256"] == digest(record)
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path}: cannot be read ({error}); delete the folder or give another --out") from error
    if not is_whole:
        raise ValueError(f"{path}: was changed after it was hashed; delete the folder or give another --out")
    return record


def versions() -> dict[str, str]:
    """Versions that the numbers depend on; for the engine the SHA-256 of its library, which changes with its code."""
    packages = ("numpy", "scipy", "scikit-learn", "lightgbm")
    found = {name: importlib.metadata.version(name) for name in packages}
    return {"sightline": sightline.__version__, "engine": engine(), "python": platform.python_version(), **found}


def engine() -> str:
    """SHA-256 of the engine's library."""
    return hashlib.sha256(Path(_native.__file__).read_bytes()).hexdigest()


def _optimum(group: list[World], objective: str, evaluations: int, seed: int) -> dict[str, Any]:
    scenes = [worlds.opened(Source.read(world.path), frames=2) for world in group]
    found = sightline.optimize(scenes, objective=objective, evaluations=evaluations, seed=seed)
    if found.best is None:
        raise ValueError(f"the search for {objective} in {', '.join(w.name for w in group)} found no placement")
    return {"objective": objective, "scenes": [w.name for w in group], "poses": found.best.poses.tolist()}
