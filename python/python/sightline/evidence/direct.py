"""What there is to win: a placement searched for the metrics themselves, through trees that are taught once.

All of it in training worlds, half of them to teach and half to judge in, so that what is found is tested like any other
placement.
"""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import trial, truth
from ._types import F64, I64, Bools
from .files import is_whole, read_json, write_json
from .layouts import Layout, out_of_step
from .learners import trees
from .stage import in_words, say
from .worlds import World

#: Random placements that teach in each world, and those that tell how far a metric goes.
TEACHING, DRAWN = 2, 12

#: What is searched for: all that is ranked by on fixed targets.
METRICS = tuple(metric for metric in trial.METRICS if not metric.startswith("own_"))


@dataclass(frozen=True)
class Room:
    """What a placement may be made of."""

    #: ``[P, 6]``.
    poses: F64
    #: Which of them each LiDAR may have, ``[P]`` each.
    allowed: list[Bools]
    #: Least distance of two LiDARs, metres.
    apart: float

    def exchanged(self, placement: F64, slot: int, wanted: I64) -> F64:
        """The placement with the first of the ``wanted`` poses that LiDAR ``slot`` may have in place of its own."""
        others = np.delete(placement, slot, axis=0)
        for number in wanted[self.allowed[slot][wanted]]:
            pose = self.poses[number]
            if np.array_equal(pose, placement[slot]):
                continue
            if np.linalg.norm(others[:, :3] - pose[:3], axis=1).min(initial=np.inf) >= self.apart:
                found: F64 = np.insert(others, slot, pose, axis=0)
                return found
        return placement

    def random(self, rng: np.random.Generator) -> F64:
        """Poses ``[L, 6]``, drawn."""
        placement = np.array([self.poses[rng.choice(np.flatnonzero(here))] for here in self.allowed])
        for slot in range(len(placement)):
            placement = self.exchanged(placement, slot, rng.permutation(len(self.poses)))
        return placement


def optimum(
    train: list[World],
    room: Room,
    starts: dict[str, F64],
    exchanges: int,
    learner: trees.Settings,
    folder: Path,
    kept: Path,
) -> dict[str, Any]:
    """The best placement after so many exchanges of one pose, from the best of ``starts``; its value and what was tried.

    The value is the mean over metrics of (value − mean) / (best − mean) of random placements: 0 a random one. Targets lie
    in ``folder``, what was looked at in the file ``kept``.
    """
    rng = np.random.default_rng(17)
    teaching = [room.random(rng) for _ in train[::2] for _ in range(TEACHING)]
    judge = Judge(train, teaching, learner, folder, kept, DRAWN + len(starts) + exchanges)
    drawn = np.array([judge.look(room.random(rng), f"{k + 1} of {DRAWN} random ones") for k in range(DRAWN)])
    middle = drawn.mean(axis=0)
    unit = np.maximum(drawn.max(axis=0) - middle, 1e-9)

    def value(placement: F64, which: str) -> float:
        return float(np.mean((judge.look(placement, which) - middle) / unit))

    begun = {name: value(one, f"{k} of {len(starts)} starts") for k, (name, one) in enumerate(starts.items(), 1)}
    start = max(begun, key=lambda name: begun[name])
    best, most, taken = starts[start], begun[start], 0
    for exchange in range(exchanges):
        tried = room.exchanged(best, exchange % len(best), rng.permutation(len(room.poses)))
        found = value(tried, f"{exchange + 1} of {exchanges} exchanges")
        if found > most:
            best, most, taken = tried, found, taken + 1
    return {"poses": best.tolist(), "value": most, "start": start, "starts": begun, "exchanges": exchanges, "taken": taken}


class Judge:
    """Metrics of placements by trees that are taught once; a file keeps them, with which a killed search goes on."""

    def __init__(
        self, train: list[World], teaching: list[F64], learner: trees.Settings, folder: Path, kept: Path, looks: int
    ) -> None:
        self.worlds, self.teaching, self.learner, self.folder, self.kept = train, teaching, learner, folder, kept
        # What a placement is found to have depends on these alone.
        told = [[(w.sha256, w.frames) for w in train], [one.tolist() for one in teaching], trees.describe(learner)]
        self.of = hashlib.sha256(json.dumps(told).encode()).hexdigest()
        known = read_json(kept) if is_whole(kept) else {}
        #: ``METRICS`` by the JSON of the poses.
        self.known: dict[str, list[float]] = known["known"] if known.get("of") == self.of else {}
        self.taught: trial.OnPoints | None = None
        self.left, self.taken = looks, 0
        self.began = time.monotonic()

    def look(self, placement: F64, which: str) -> F64:
        """``METRICS`` of a placement; says ``which`` it is and how long the rest takes."""
        key = json.dumps(placement.tolist())
        self.left -= 1
        if key not in self.known:
            if self.taught is None:
                self.taught = _taught(self.worlds[::2], self.teaching, self.learner)
                self.began = time.monotonic()
            self.known[key] = _metrics(self.taught, self.worlds[1::2], placement, self.folder).tolist()
            write_json(self.kept, {"of": self.of, "known": self.known})
            self.taken += 1
            rest = (time.monotonic() - self.began) / self.taken * self.left
            say(f"{self.kept.name.partition('.')[0]}, {which}, {in_words(rest)} left")
        return np.array(self.known[key], dtype=np.float64)


def _taught(worlds: list[World], teaching: list[F64], learner: trees.Settings) -> trial.OnPoints:
    seen = []
    for k, placement in enumerate(teaching):
        world, number = worlds[k // TEACHING], k % TEACHING
        (layout,) = out_of_step([Layout(f"teaching-{number}", "direct", placement)])
        seen += trial.frames_of(world, layout, number + 1)
    taught = trial.learn(seen, 1, learner)
    if taught is None:
        raise ValueError(f"{', '.join(world.name for world in worlds)}: random placements see one kind of things only")
    return taught


def _metrics(taught: trial.OnPoints, worlds: list[World], placement: F64, folder: Path) -> F64:
    """``METRICS``, means over worlds, of LiDARs that fire out of step, all placements with the same phases."""
    (layout,) = out_of_step([Layout("looked-at", "direct", placement)])
    rows = []
    for world in worlds:
        known = truth.cached(world.source(), world.sha256, world.frames, folder)
        found = trial.judge(world, known, trial.frames_of(world, layout, 1), taught)["metrics"]
        rows.append([found[metric] for metric in METRICS])
    means: F64 = np.nanmean(np.array(rows), axis=0)
    return means
