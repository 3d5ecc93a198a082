"""Scores of placements in a test scene, and the null models that they must beat."""

from __future__ import annotations

import numpy as np

import sightline

from ._types import F64
from .layouts import Layout
from .metrics.objects import distance_to
from .truth import Source, body_of
from .worlds import World, opened

#: Those of the engine.
_ENGINE = ("information_gain", "m_sog", "m_sog_scaled", "m_sog_scaled_nonzero", "s_mig", "covered", "covered_nonzero")

#: All scores; larger is better. The last four know no entropy, the very last knows nothing.
SCORES = (*_ENGINE, "gain_by_class", "distinct_voxels", "hits", "mean_height", "shuffled")

#: Frames of a scene that scores are means over.
FRAMES = 4


def of_world(world: World, placements: list[Layout]) -> dict[str, list[float]]:
    """Every score of every placement in a scene, ``NaN`` where a placement has none.

    ``gain_by_class`` averages the share of its entropy that each class gives away, so that walls, which have most
    voxels, do not decide alone; ``distinct_voxels`` counts voxels of the region hit, a mean over frames that are
    not tested on; ``hits`` counts the beams that do so; ``shuffled`` is the gain of another placement.
    """
    source = Source.read(world.path)
    scene = opened(source, FRAMES)
    rigs = [sightline.Placement(layout.poses, name=layout.name) for layout in placements]
    found = scene.score(rigs)
    table = {name: np.asarray(found[name], dtype=np.float64) for name in _ENGINE}
    table["gain_by_class"] = _gain_by_class(source, rigs)
    table["distinct_voxels"], table["hits"] = _hits(scene, source, world, rigs)
    table["mean_height"] = np.array([layout.poses[:, 2].mean() for layout in placements])
    # The same permutation in every scene, or means over scenes would know the gain again.
    order = np.random.default_rng(7).permutation(len(placements))
    table["shuffled"] = table["information_gain"][order]
    return {name: table[name].tolist() for name in SCORES}


def _gain_by_class(source: Source, rigs: list[sightline.Placement]) -> F64:
    scene = opened(source, 2)
    psog = scene.psog
    entropy, commonest = psog.entropy(), psog.counts.argmax(axis=1)
    total = np.bincount(commonest, weights=entropy, minlength=len(psog.classes))
    there = total > 0
    gains = []
    for rig in rigs:
        seen = np.isin(psog.index, scene.covered(rig), assume_unique=True)
        told = np.bincount(commonest[seen], weights=entropy[seen], minlength=len(total))
        gains.append(np.mean(told[there] / total[there]))
    return np.array(gains)


def _hits(
    scene: sightline.Scene, source: Source, world: World, rigs: list[sightline.Placement]
) -> tuple[F64, F64]:
    body = body_of(scene)
    outline = (float(body[0]), float(body[1]), float(body[2]), float(body[3]))
    others = [frame for frame in range(scene.frames) if frame not in world.frames] or [0]
    chosen = others[:: max(len(others) // 2, 1)][:2]
    distinct, hits = np.zeros(len(rigs)), np.zeros(len(rigs))
    for frame in chosen:
        cast = scene.cast(rigs, frame=frame)
        met = np.isfinite(cast["t_hit"])
        xyz = cast["origin"][met] + (cast["t_hit"][met, None] + 1e-3) * cast["direction"][met]
        keys = source.grid.keys(xyz)
        counted = (keys >= 0) & (distance_to(outline, xyz[:, :2]) > 0)
        owner, keys = cast["placement"][met][counted], keys[counted]
        hits += np.bincount(owner, minlength=len(rigs)) / len(chosen)
        pairs = np.unique(np.stack([owner.astype(np.int64), keys]), axis=1)
        distinct += np.bincount(pairs[0], minlength=len(rigs)) / len(chosen)
    return distinct, hits
