"""Boosted trees on the geometry around each point, trained anew for each placement in seconds."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from .._types import F32, F64, I64, U8, Floats
from ..groups import GROUPS

#: Neighbours whose spread describes a point.
NEIGHBOURS = (8, 32)

#: Metres, edges of the columns that tell how a point stands over what is around it.
COLUMNS = (0.6, 2.0, 6.0)


@dataclass(frozen=True)
class Settings:
    """Settings of LightGBM; the rest are its defaults."""

    rounds: int = 40
    leaves: int = 31
    rate: float = 0.15
    #: Most points that are learnt from, drawn by the seed.
    points: int = 60_000
    threads: int = 1


def features(xyz: Floats, of: I64 | None = None) -> F32:
    """Geometry of points ``[P, 3]`` (metres, ego frame), ``[P, F]``; nothing of it names a sensor or a placement.

    The first columns are height and distance in plan. Each of ``NEIGHBOURS`` adds the distance of the farthest,
    linearity, planarity, scattering, verticality of the normal, spread of heights and height above the lowest. Each of
    ``COLUMNS`` adds heights above the lowest and below the highest point, the spread between, and the logarithm of
    their number. With ``of``, rows of these points alone, among all.
    """
    if not len(xyz):
        return np.zeros((0, 2 + 7 * len(NEIGHBOURS) + 4 * len(COLUMNS)), np.float32)
    points: F64 = xyz.astype(np.float64)
    chosen = points if of is None else points[of]
    parts = [chosen[:, 2], np.hypot(chosen[:, 0], chosen[:, 1])]
    most = min(max(NEIGHBOURS), len(points))
    away, near = cKDTree(points, balanced_tree=False).query(chosen, k=most)
    away, near = np.reshape(away, (len(chosen), most)), np.reshape(near, (len(chosen), most))
    # Small numbers, about the point itself, bear single precision, which is twice as fast.
    around = (points[near] - chosen[:, None]).astype(np.float32)
    for count in NEIGHBOURS:
        parts += _neighbourhood(around[:, :count], away[:, :count])
    for edge in COLUMNS:
        column = _column(points, edge)
        parts += column if of is None else [values[of] for values in column]
    table: F32 = np.stack(parts, axis=1).astype(np.float32)
    return table


def _neighbourhood(around: F32, away: F64) -> list[F64]:
    centred = around - around.mean(axis=1, keepdims=True)
    covariance = (centred.transpose(0, 2, 1) @ centred).astype(np.float64) / around.shape[1]
    values, vectors = np.linalg.eigh(covariance)
    small, middle, large = np.sqrt(np.maximum(values, 0)).T
    scale = np.maximum(large, 1e-9)
    heights = around[:, :, 2].astype(np.float64)
    return [
        away[:, -1],
        (large - middle) / scale,
        (middle - small) / scale,
        small / scale,
        np.abs(vectors[:, 2, 0]),
        heights.std(axis=1),
        -heights.min(axis=1),
    ]


def _column(xyz: F64, edge: float) -> list[F64]:
    cell = np.floor(xyz[:, :2] / edge).astype(np.int64)
    _, place, count = np.unique(cell[:, 0] * (1 << 32) + cell[:, 1], return_inverse=True, return_counts=True)
    lowest, highest = np.full(len(count), np.inf), np.full(len(count), -np.inf)
    np.minimum.at(lowest, place, xyz[:, 2])
    np.maximum.at(highest, place, xyz[:, 2])
    floor, roof = lowest[place], highest[place]
    return [xyz[:, 2] - floor, roof - xyz[:, 2], roof - floor, np.log(count[place].astype(np.float64))]


@dataclass(frozen=True)
class Trees:
    """A trained learner, and how its loss fell on the points that it was not trained on."""

    booster: Any
    #: Groups that the training had, by the learner's own number.
    known: I64
    #: Mean negative log-likelihood after each round, on a tenth of the points that was held back.
    curve: list[float]

    def predict(self, described: F32) -> tuple[U8, F32]:
        """Groups ``[P]`` of points by their features, and how sure it is ``[P]``."""
        if not len(described):
            return np.zeros(0, np.uint8), np.zeros(0, np.float32)
        likely = np.asarray(self.booster.predict(described)).reshape(len(described), -1)
        return self.known[likely.argmax(axis=1)].astype(np.uint8), likely.max(axis=1).astype(np.float32)


def train(described: F32, labels: U8, seed: int, settings: Settings) -> Trees:
    """Learns groups ``[P]`` (0: no truth, left out) from features ``[P, F]``; the same bits for the same seed.

    Rare groups weigh more: by one over the square root of their number.
    """
    import lightgbm

    rng = np.random.default_rng([seed, 1])
    labelled = np.flatnonzero(labels)
    kept = np.sort(rng.permutation(labelled)[: settings.points])
    known = np.unique(labels[kept]).astype(np.int64)
    if len(known) < 2:
        names = ", ".join(GROUPS[k] for k in known) or "none"
        raise ValueError(f"labels: hold these groups only: {names}; a learner needs two")
    number = np.searchsorted(known, labels[kept])
    weight = 1 / np.sqrt(np.bincount(number))[number]
    held = rng.random(len(kept)) < 0.1
    parameters = {
        "objective": "multiclass",
        "num_class": len(known),
        "num_leaves": settings.leaves,
        "learning_rate": settings.rate,
        "min_data_in_leaf": 10,
        "feature_fraction": 0.6,
        "max_bin": 63,
        "seed": seed,
        "deterministic": True,
        "force_row_wise": True,
        "num_threads": settings.threads,
        "verbosity": -1,
    }
    data = lightgbm.Dataset(described[kept[~held]], number[~held], weight=weight[~held])
    rest = lightgbm.Dataset(described[kept[held]], number[held], weight=weight[held], reference=data)
    losses: dict[str, dict[str, list[float]]] = {}
    booster = lightgbm.train(
        parameters,
        data,
        settings.rounds,
        valid_sets=[rest],
        valid_names=["held back"],
        callbacks=[lightgbm.record_evaluation(losses)],
    )
    return Trees(booster, known, losses["held back"]["multi_logloss"])


def describe(settings: Settings) -> dict[str, Any]:
    """Family and settings for a plan."""
    return {"family": "trees", **asdict(settings), "neighbours": NEIGHBOURS, "columns": COLUMNS}
