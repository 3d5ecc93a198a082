"""A study of seconds on variants of the small world."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from sightline_evidence import layouts, plan, worlds
from sightline_evidence.designs import Design
from sightline_evidence.learners import trees
from sightline_evidence.plan import Plan

DESIGN = Design(name="tiny", train=(), test=(), learner=trees.Settings(rounds=8, points=8_000))


def variant(described: dict[str, Any], number: int) -> dict[str, Any]:
    """The small world with its things elsewhere."""
    made = json.loads(json.dumps(described))
    made["name"] = f"tiny-{number}"
    wall, hedge, pole = made["static"][3]["box"], made["static"][4]["box"], made["static"][5]["cylinder"]
    wall["min"][1] += number % 3
    hedge["min"][0] -= 2 * number
    hedge["max"][0] -= number
    pole["foot"] = [8 - 3 * number, 5 + number % 2, 0]
    for pose in made["actors"][0]["poses"]:
        pose["x"] += 2 * number
    return made


def study(out: Path, described: dict[str, Any], kept: list[str] | None = None) -> Plan:
    """Two worlds to train, two to test; published, mixed, counted and gamed layouts, or those of ``kept``."""
    chosen = []
    for number, role in enumerate(("train", "train", "test", "test")):
        path = out / "worlds" / f"tiny-{number}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(variant(described, number)), encoding="utf-8")
        chosen.append(worlds.world(path.stem, path, role, DESIGN.frames))
    placed = layouts.published() + layouts.mixed()[:1] + layouts.numbers()[:2] + layouts.gamed()
    placed = [layout for layout in placed if kept is None or layout.name in kept]
    return plan.settle(DESIGN, chosen, placed, out)
