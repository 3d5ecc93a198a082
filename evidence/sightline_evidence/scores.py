"""Scores of placements in a test scene, and the null models that they must beat."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

import sightline

from . import candidates
from ._types import F64
from .candidates import CANDIDATES, Ground
from .layouts import Layout
from .truth import Source, body_of
from .worlds import World, at, opened

#: Scores of the engine.
_ENGINE = (
    "near_gain",
    "information_gain",
    "m_sog",
    "m_sog_nonzero",
    "m_sog_scaled",
    "m_sog_scaled_nonzero",
    "s_mig",
    "covered",
    "covered_nonzero",
)

#: All scores; larger is better. ``gain`` is the engine's own under another name; the last three know no entropy.
SCORES = (*_ENGINE, *(name for name in CANDIDATES if name != "gain"), "hits", "mean_height", "shuffled")

#: Frames of a scene that scores are means over, spread as the engine spreads them.
FRAMES = 4


def of_world(world: World, placements: list[Layout], frames: int = FRAMES) -> dict[str, list[float]]:
    """Every score of every placement in a scene, ``NaN`` where a placement has none.

    ``hits`` counts the beams that end in the region; ``shuffled`` is the gain of another
    placement.
    """
    table = {name: np.full(len(placements), np.nan) for name in SCORES}
    psog = opened(Source.read(world.path)).psog
    lidars = [json.dumps(layout.lidar) for layout in placements]
    for lidar in sorted(set(lidars)):
        kept = np.array([one == lidar for one in lidars])
        among = [layout for layout, keep in zip(placements, kept) if keep]
        for name, values in _of_one_lidar(world, psog, among, frames).items():
            table[name][kept] = values
    table["mean_height"] = np.array([layout.poses[:, 2].mean() for layout in placements])
    # One permutation for all scenes, or means over scenes would know the gain again.
    order = np.random.default_rng(7).permutation(len(placements))
    table["shuffled"] = table["information_gain"][order]
    return {name: table[name].tolist() for name in SCORES}


def _of_one_lidar(world: World, psog: sightline.Psog, placements: list[Layout], frames: int) -> dict[str, F64]:
    """Scores of placements of the same LiDAR model."""
    source = Source.read(world.path)
    scene = opened(source, frames, placements[0].lidar, psog)
    rigs = [layout.placement(f"placement-{k}") for k, layout in enumerate(placements)]
    found = scene.score(rigs, self_hits=False)
    table = {name: np.asarray(found[name], dtype=np.float64) for name in _ENGINE}
    rows: list[list[list[float]]] = []
    for there, ground in frames_of(scene, source, psog, placements[0], frames):
        seen = [candidates.look(there, ground, rig) for rig in rigs]
        rows.append([[*candidates.values(ground, one).values(), one.hits] for one in seen])
    mean = np.mean(rows, axis=0)
    table |= {name: mean[:, k] for k, name in enumerate((*CANDIDATES, "hits")) if name != "gain"}
    return table


def frames_of(
    scene: sightline.Scene, source: Source, psog: sightline.Psog, layout: Layout, frames: int
) -> Iterator[tuple[sightline.Scene, Ground]]:
    """Each frame that candidates are means over, opened alone with the LiDAR of a layout, and what is there to be seen."""
    count = min(frames, scene.frames)
    ground: Ground | None = None
    for frame in (k * scene.frames // count for k in range(count)):
        there = at(source, frame, psog, layout.lidar)
        (scan,) = there.scan(layout.poses, ideal=True, frames=[0])
        ground = ground.with_boxes(scan.boxes) if ground else Ground.of(psog, source.grid, body_of(scene), scan.boxes)
        yield there, ground
