"""Scores for the peers: costs of variables within a budget of work, best placements over all frames."""

from __future__ import annotations

import math
import resource
from dataclasses import dataclass, field
from typing import Any

from .ours import doubts
from .problems import Problem, Space

#: Costs that are more than any score: of rules, of guards and of requirements.
BROKEN, DOUBTED, UNMET = 1e3, 1e2, 1e1
#: Placements scored at once: up to 64 are looked at for the guard `self_hit`.
TOGETHER = 64
#: Best placements that are confirmed over all frames.
FINALISTS = 8
#: A search may ask for this many placements that break a rule for each one that it may cast.
MOST_ASKED = 200


class Spent(Exception):
    """The budget of a search is used up."""


class Scenes:
    """The scenes of a problem over some of their frames, in the Python module."""

    def __init__(self, sightline: Any, problem: Problem, frames: int | None, psogs: list[Any] | None) -> None:
        psogs = psogs or [None] * len(problem.scenes)
        self.scenes = [
            sightline.Scene.load(path, vehicle=problem.vehicle, frames=frames, psog=psog, backend="cpu")
            for path, psog in zip(problem.scenes, psogs, strict=True)
        ]
        self.frames = sum(min(frames or scene.frames, scene.frames) for scene in self.scenes)
        self.suite = sightline.Suite(self.scenes) if len(self.scenes) > 1 else self.scenes[0]

    @property
    def psogs(self) -> list[Any]:
        """P-SOGs of the scenes, to be shared by others that model fewer frames."""
        return [scene.psog for scene in self.scenes]

    def costs(self, placements: list[Any], sensors: list[str] | None, required: dict[str, float]) -> list[float]:
        """Minus the near gain; DOUBTED or UNMET and what is missing, where a guard or requirement is not kept."""
        found: list[float] = []
        for start in range(0, len(placements), TOGETHER):
            scores = self.suite.score(placements[start : start + TOGETHER], sensors=sensors)
            seen = {name: scores[f"seen.{name}"] for name in required}
            for index, gain in enumerate(scores["near_gain"]):
                missing = sum(max(0.0, least - float(seen[name][index])) for name, least in required.items())
                found.append(cost(float(gain), doubts(scores.guards[index]), missing))
        return found


def cost(gain: float, guards: list[str], missing: float) -> float:
    """Cost of a placement that keeps the rules of the mount, in steps that no score bridges."""
    if guards or math.isnan(gain):
        return DOUBTED + len(guards)
    return UNMET + missing if missing > 0.0 else -gain


def processor() -> float:
    """CPU seconds of this process, all threads."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


@dataclass
class Budget:
    """Costs of variables, until the work is done: sensor poses × frames."""

    space: Space
    scenes: Any
    required: dict[str, float]
    work: int
    #: Cost, poses, work done by then, CPU seconds by then, of every placement cast.
    cast: list[tuple[float, list[list[float]], int, float]] = field(default_factory=list)
    asked: int = 0

    def __post_init__(self) -> None:
        self.each = len(self.space.mounts) * self.scenes.frames
        self.most = max(1, self.work // self.each)
        self.begun = processor()

    def costs(self, batch: Any) -> list[float]:
        """Costs of a batch of variables. Placements that break a rule are not cast.

        Raises Spent once the budget is used up; what still fits is cast before.
        """
        placements = [self.space.poses(shares) for shares in batch]
        missing = [self.space.missing(poses) for poses in placements]
        room = self.most - len(self.cast)
        kept = [poses for poses, by in zip(placements, missing) if by == 0.0]
        fits = kept[:room]
        found = self.scenes.costs(fits, self.space.sensors, self.required) if fits else []
        done, seconds = len(self.cast), processor() - self.begun
        self.cast += [(value, poses, (done + k + 1) * self.each, seconds)
                      for k, (value, poses) in enumerate(zip(found, fits))]
        self.asked += len(placements)
        if len(kept) >= room or self.asked > MOST_ASKED * self.most:
            raise Spent
        values = iter(found)
        return [BROKEN + by if by > 0.0 else next(values) for by in missing]


def confirmed(budget: Budget, whole: Any, marks: list[int]) -> list[dict[str, Any]]:
    """At each mark of work the best of the FINALISTS best until then, over all frames.

    `value` is None where none of them keeps every guard and requirement. `whole` has all frames.
    """
    known: dict[int, float] = {}
    if whole.frames == budget.scenes.frames:
        known = {index: entry[0] for index, entry in enumerate(budget.cast)}
    points = []
    for mark in marks:
        until = [index for index, entry in enumerate(budget.cast) if entry[2] <= mark]
        finalists = sorted(until, key=lambda index: budget.cast[index][0])[:FINALISTS]
        new = [index for index in finalists if index not in known]
        values = whole.costs([budget.cast[index][1] for index in new], budget.space.sensors, budget.required)
        known.update(zip(new, values))
        best = min(finalists, key=lambda index: known[index], default=None)
        if best is not None and known[best] > 0.0:
            best = None
        points.append({
            "work": mark,
            "value": None if best is None else -known[best],
            "poses": None if best is None else budget.cast[best][1],
            "cpu_seconds": budget.cast[until[-1]][3] if until else 0.0,
            "placements": len(until),
        })
    return points
