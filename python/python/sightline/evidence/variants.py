"""Placements as ``NAME@VARIANT``: what a variant changes, and whether scores still put the placements in order."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from . import correlate, decide
from ._types import F64, I64
from .gathered import Gathered, mean

#: Scores that choose among the placements of a variant.
CHOOSING = (
    "near_gain",
    "information_gain",
    "m_sog_scaled",
    "m_sog_scaled_nonzero",
    "blend",
    "distinct_voxels",
    "hits",
    "mean_height",
)

#: Metrics that a score is correlated with.
ORDERED = ("birds_eye_miou", "voxel_1m_miou", "objects_5")

#: Fewer placements have no order to speak of.
FEWEST = 4


def of(given: Gathered) -> dict[str, Any]:
    """By variant: means less those of the first variant, how it orders the placements, and what scores choose in it.

    ``chosen`` has each score of ``CHOOSING`` as the first variant has it (``as_first``) and, where they differ, as this
    one has it (``here``, and what that loses less, ``less``), and of each search what its optima lose less than the
    published optimum.
    """
    names = [layout.name for layout in given.layouts if layout.pool == "variant"]
    found: dict[str, Any] = {}
    first = names[0].partition("@")[2] if names else ""
    for variant in dict.fromkeys(name.partition("@")[2] for name in names):
        bases = [n.partition("@")[0] for n in names if n.endswith(f"@{variant}") and f"{n.partition('@')[0]}@{first}" in names]
        here, there = (np.array([given.place(f"{base}@{v}") for base in bases], dtype=np.int64) for v in (variant, first))
        of = {m: given.mean(m) for m in decide.DECIDING if m in given.metrics}
        drawn = correlate.Drawn.of(np.random.default_rng(decide.SEED), len(bases), len(given.scenes))
        found[variant] = {
            "placements": len(bases),
            "metrics": {
                m: {
                    "mean": float(np.nanmean(table[here])),
                    "less_first": asdict(decide.over_scenes(mean(table[here] - table[there], 0))),
                    "order_as_first": asdict(correlate.spearman_interval(table[here], table[there], drawn)),
                }
                for m, table in of.items()
            },
            "chosen": _chosen(given, bases, here, there, drawn) if len(bases) >= FEWEST else {},
        }
    return found


def _chosen(given: Gathered, bases: list[str], here: I64, there: I64, drawn: correlate.Drawn) -> dict[str, Any]:
    """What scores choose among the placements ``here``, which stand ``there`` in the first variant."""
    one = _alone(given, bases, here)
    kept = np.ones(len(bases), dtype=bool)
    metrics = decide.metrics_of(one, kept)
    tables = np.stack([one.mean(m) for m in metrics])
    first = {s: given.scores[s][there] for s in CHOOSING}
    # What knows no weather has no score in it; what is the same in both is shown once.
    own = {s: table for s in CHOOSING if np.isfinite(table := given.scores[s][here]).all() and not np.array_equal(table, first[s])}
    every = [*first.values(), *own.values()]
    lost = decide.picked(np.stack(every), tables, np.ones((1, len(metrics)), dtype=bool), drawn)[:, :, 0]
    among = {m: one.mean(m) for m in ORDERED if m in metrics}

    def told(table: F64, loss: F64) -> dict[str, Any]:
        rho = {m: asdict(correlate.spearman_interval(table, of, drawn)) for m, of in among.items()}
        return {"regret": asdict(decide.interval_of(loss)), "spearman": rho}

    found: dict[str, Any] = {s: {"as_first": told(table, lost[:, k])} for k, (s, table) in enumerate(first.items())}
    for k, (s, table) in enumerate(own.items(), len(first)):
        found[s] |= {"here": told(table, lost[:, k]), "less": asdict(decide.interval_of(lost[:, CHOOSING.index(s)] - lost[:, k]))}
    by_seed = mean(decide.lost_by_seed(one, kept, metrics), 0)
    optima = {s: of["less_regret_than"] for s, of in decide.optima(one, kept, by_seed, metrics).items()}
    return {"metrics": metrics, "scores": found, "optima": {s: less[decide.PUBLISHED] for s, less in optima.items()}}


def _alone(given: Gathered, bases: list[str], rows: I64) -> Gathered:
    """One variant, its placements under the names without it, as four in the mount."""
    layouts = [replace(given.layouts[k], name=base, pool="box") for k, base in zip(rows, bases)]
    metrics = {m: table[:, rows] for m, table in given.metrics.items()}
    return replace(given, layouts=layouts, metrics=metrics, scores={s: table[rows] for s, table in given.scores.items()})
