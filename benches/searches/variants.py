"""Variants: problems with one more option of `optimize`, and what their plain relative is compared by."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path

from .problems import FIELDS, ROOT, Lidars, Problem, mirror

#: A placement that is good on residential; `uc-inject` starts from it.
START = Path(__file__).with_name("start.json")


def level(lidars: Lidars) -> list[Lidars]:
    """The placement with every roll at 0."""
    return [[{**lidar, "roll": 0.0} for lidar in lidars]]


def paired(lidars: Lidars) -> list[Lidars]:
    """Every half of an even number of LiDARs, with its mirror image in place of the other half."""
    halves = combinations(lidars, len(lidars) // 2)
    return [[*half, *map(image, half)] for half in halves]


def image(lidar: dict[str, float]) -> dict[str, float]:
    """The LiDAR mirrored at the plane y = 0."""
    return {**lidar, **dict(zip(FIELDS, mirror([lidar.get(name, 0.0) for name in FIELDS])))}


def or_start(lidars: Lidars) -> list[Lidars]:
    """The placement, and the start that is injected."""
    return [lidars, *(placement["lidars"] for placement in json.loads(START.read_text())["placements"])]


def variants(known: dict[str, Problem]) -> dict[str, Problem]:
    """Variants of known problems, by key."""
    crossing, both = known["uc"], known["two"]
    vehicle = ROOT / "scenes/vehicles/place3d.json"
    found = [
        replace(both, key="two-mirror", plain=both, options=("--mirror",), title="both scenes and their mirror images",
                fair="as it is"),
        replace(crossing, key="uc-free", plain=crossing, vehicle=vehicle, title="urban-crossing with free phases",
                fair="as it is"),
        replace(crossing, key="uc-fog", plain=crossing, options=("--condition", "fog:mor=50"),
                title="urban-crossing in fog", fair="as it is"),
        replace(crossing, key="uc-fix", plain=crossing, options=("--fix", "roll=0"),
                title="urban-crossing with roll fixed at 0", fair="with every roll at 0", rivals=level),
        replace(crossing, key="uc-symmetric", plain=crossing, options=("--symmetric",),
                title="urban-crossing with mirrored pairs", fair="its best half and the image of it", rivals=paired),
        replace(crossing, key="uc-inject", plain=crossing, start=START, title="urban-crossing from a given start",
                fair="as it is, or the start if that is better", rivals=or_start),
    ]
    return {problem.key: problem for problem in found}
