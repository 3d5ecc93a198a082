"""Optima of candidates over a pool of single poses, searched in training scenes alone and in all of them together."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import candidates, worlds
from ._types import F64, I64, Bools
from .candidates import SUMS, WEIGHTS, Ground
from .truth import body_of
from .worlds import World

#: Occupied voxels of a frame that are looked at, drawn at random: shares are right to a part in a thousand.
MOST = 20_000

#: Kinds of poses: in the mount, and low around the body.
INSIDE, LOW = 0, 1


def drawn(mount: dict[str, Any], inside: int, low: int, seed: int) -> tuple[F64, I64]:
    """Poses ``[P, 6]`` and their kinds: on the decimetres of the mount, where published layouts stand; and round a body
    of 4.7 × 2 m.

    Nearly half stand on top of the mount, where good ones do; rolls are the extremes, a third and two thirds of them,
    and 0 for a third of the poses. Yaw is uniform, so that phases of azimuth steps are free; low ones stand between 0.6
    and 1 m, upright.
    """
    rng = np.random.default_rng([seed, 41])
    least, most = np.array(mount["min"], dtype=float), np.array(mount["max"], dtype=float)
    spots = np.clip(np.round(rng.uniform(least, most, (inside, 3)), 1), least, most)
    spots[rng.random(inside) < 0.45, 2] = most[2]
    least_roll, most_roll = mount.get("roll", [0.0, 0.0])
    turns = np.array([-3, -2, -1, 0, 0, 0, 1, 2, 3])[rng.integers(0, 9, inside)] / 3
    roll = np.where(turns < 0, -turns * least_roll, turns * most_roll)
    high = np.c_[spots, roll, np.zeros(inside), rng.uniform(-np.pi, np.pi, inside)]
    along = rng.uniform(0, 1, low)
    corners = np.array([(2.35, 1.0), (-2.35, 1.0), (-2.35, -1.0), (2.35, -1.0), (2.35, 1.0)])
    # A third stands at the corners themselves.
    side = rng.integers(0, 4, low)
    along = np.where(np.arange(low) % 3 == 0, 0.0, along)
    xy = corners[side] + along[:, None] * (corners[side + 1] - corners[side])
    zeros = np.zeros((low, 2))
    below = np.c_[xy, rng.uniform(0.6, 1.0, low), zeros, rng.uniform(-np.pi, np.pi, low)]
    poses: F64 = np.concatenate([high, below]).round(4)
    return poses, np.r_[np.full(inside, INSIDE), np.full(low, LOW)].astype(np.int64)


def cast(world: World, poses: F64, folder: Path) -> dict[str, int]:
    """Looks from every pose ``[P, 6]`` in the frames of a training world; writes ``WORLD.npz``, returns its sizes."""
    source = world.source()
    whole = worlds.opened(source)
    psog, body = whole.psog, body_of(whole)
    rng = np.random.default_rng(7)
    kept: dict[str, Any] = {}
    ground: Ground | None = None
    for number, frame in enumerate(world.frames):
        scene = worlds.at(source, frame, psog)
        (scan,) = scene.scan(poses[:1], ideal=True, frames=[0])
        ground = ground.with_boxes(scan.boxes) if ground else Ground.of(psog, source.grid, body, scan.boxes)
        sample = np.sort(rng.permutation(len(ground.keys))[:MOST])
        place = np.full(len(ground.keys), -1, np.int64)
        place[sample] = np.arange(len(sample))
        seen = [candidates.look(scene, ground, pose[None]) for pose in poses]
        for name, rows in (
            ("covered", [place[one.covered] for one in seen]),
            ("hit", [place[one.hit] for one in seen]),
            ("squares", [one.squares for one in seen]),
        ):
            rows = [row[row >= 0] for row in rows]
            kept[f"{number}.{name}.ends"] = np.cumsum([len(row) for row in rows])
            kept[f"{number}.{name}"] = np.concatenate(rows).astype(np.int32)
        kept[f"{number}.points"] = np.array([one.points for one in seen])
        kept[f"{number}.sizes"] = np.array([len(sample), len(ground.squares)])
        for name, weight in ground.weights.items():
            # A part left out takes the mean of the parts kept: sums stay shares.
            kept[f"{number}.weight.{name}"] = weight[sample] / max(weight[sample].sum(), 1e-300)
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / f"{world.name}.npz", **kept)
    return {"poses": len(poses), "frames": len(world.frames)}


@dataclass(frozen=True)
class Sets:
    """Things with a weight that each pose sees, over all frames."""

    #: Things of pose p are ``index[starts[p] : starts[p + 1]]``.
    starts: I64
    index: I64
    #: Weight of each thing; the sum over all is 1.
    weight: F64

    def gains(self, seen: Bools) -> F64:
        """Weight ``[P]`` that each pose adds to what is ``seen`` already."""
        left = np.where(seen, 0.0, self.weight)
        total = np.concatenate([[0.0], np.cumsum(left[self.index])])
        added: F64 = total[self.starts[1:]] - total[self.starts[:-1]]
        return added

    def union(self, chosen: list[int]) -> Bools:
        """Which things these poses see."""
        seen = np.zeros(len(self.weight), bool)
        for pose in chosen:
            seen[self.index[self.starts[pose] : self.starts[pose + 1]]] = True
        return seen


@dataclass(frozen=True)
class Actors:
    """Points of each pose in each box of all frames, ``[P, B]``, and what a box weighs ``[B]`` (sum 1)."""

    points: I64
    weight: F64
    enough: int

    def totals(self, chosen: list[int]) -> F64:
        """The share with one pose ``[P]`` more."""
        has = self.points[chosen].sum(axis=0)
        share: F64 = ((has + self.points) >= self.enough) @ self.weight
        return share


#: Share that a choice of poses has with each pose more, ``[P]``.
Objective = Callable[[list[int]], F64]


def objective(name: str, world_names: list[str], folder: Path) -> Objective:
    """Objective of a candidate, over all of these training worlds."""
    if name in SUMS:
        parts = [(objective(part, world_names, folder), factor) for part, factor in SUMS[name].items()]
        return lambda chosen: np.sum([factor * part(chosen) for part, factor in parts], axis=0)
    if name.startswith("actors_"):
        return _actors(int(name.removeprefix("actors_")), world_names, folder).totals
    read = {"distinct_voxels": "hit", "near_field": "squares"}.get(name, "covered")
    sets = _sets(read, name if name in WEIGHTS else None, world_names, folder)

    def totals(chosen: list[int]) -> F64:
        seen = sets.union(chosen)
        found: F64 = sets.weight[seen].sum() + sets.gains(seen)
        return found

    return totals


def _frames(world_names: list[str], folder: Path) -> list[tuple[Any, int]]:
    found = []
    for name in world_names:
        stored = _stored(folder / f"{name}.npz")
        found += [(stored, number) for number in range(sum(key.endswith(".points") for key in stored))]
    return found


@functools.lru_cache(maxsize=64)
def _stored(path: Path) -> dict[str, Any]:
    with np.load(path) as stored:
        return dict(stored)


def _sets(read: str, weighted: str | None, world_names: list[str], folder: Path) -> Sets:
    frames = _frames(world_names, folder)
    rows: list[list[I64]] = []
    weights, offset = [], 0
    for stored, number in frames:
        size = int(stored[f"{number}.sizes"][1 if read == "squares" else 0])
        weight = stored[f"{number}.weight.{weighted}"] if weighted else np.full(size, 1 / max(size, 1))
        weights.append(weight / len(frames))
        ends = stored[f"{number}.{read}.ends"]
        rows.append([part + offset for part in np.split(stored[f"{number}.{read}"], ends[:-1])])
        offset += size
    index = [part for pose in zip(*rows) for part in pose]
    count = [sum(len(part) for part in pose) for pose in zip(*rows)]
    return Sets(np.concatenate([[0], np.cumsum(count)]), np.concatenate(index), np.concatenate(weights))


def _actors(enough: int, world_names: list[str], folder: Path) -> Actors:
    frames = [stored[f"{number}.points"] for stored, number in _frames(world_names, folder)]
    frames = [points for points in frames if points.shape[1]]
    weight = [np.full(points.shape[1], 1 / points.shape[1] / len(frames)) for points in frames]
    return Actors(np.concatenate(frames, axis=1), np.concatenate(weight), enough)


def search(totals: Objective, poses: F64, allowed: list[Bools], apart: float) -> tuple[list[int], float]:
    """Greedy choice of a pose for each place, then exchanges of one for the best other until none helps.

    ``allowed`` ``[P]`` ones for each place, no two nearer than ``apart`` metres. Returns their numbers, rising, and the
    value.
    """
    chosen: list[int] = []
    value, count = 0.0, len(allowed)
    for here in allowed:
        best, value = _best(totals, poses, here, chosen, apart)
        chosen.append(best)
    slot, idle = 0, 0
    while idle < count:
        rest = chosen[:slot] + chosen[slot + 1 :]
        best, found = _best(totals, poses, allowed[slot], rest, apart)
        idle = 0 if found > value * (1 + 1e-9) else idle + 1
        if not idle:
            chosen = [*rest[:slot], best, *rest[slot:]]
            value = found
        slot = (slot + 1) % count
    return sorted(chosen), value


def _best(totals: Objective, poses: F64, allowed: Bools, rest: list[int], apart: float) -> tuple[int, float]:
    free = allowed.copy()
    for pose in rest:
        free &= np.linalg.norm(poses[:, :3] - poses[pose, :3], axis=1) >= apart
    free[rest] = False
    if not free.any():
        raise ValueError(f"pool: no pose is {apart} m from {len(rest)} others; draw more poses")
    found = np.where(free, totals(rest), -np.inf)
    best = int(found.argmax())
    return best, float(found[best])


def optimum(
    name: str, world_names: list[str], folder: Path, poses: F64, allowed: list[Bools], apart: float
) -> dict[str, Any]:
    """The best pose of each place for a candidate, and its value in these worlds."""
    chosen, value = search(objective(name, world_names, folder), poses, allowed, apart)
    return {"candidate": name, "poses": poses[chosen].tolist(), "numbers": chosen, "value": value}
