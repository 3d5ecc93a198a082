"""Writes a run again from its compact record: ``python -m sightline_evidence restore runs/standard.json.gz --out DIR``.

Its worlds are made again and must have the SHA-256 that the plan names. Scores are written to six digits, metrics to
four. Then ``learned``, ``cost`` and ``tables`` go on from there. A plan whose engine or packages differ now gets another hash.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from . import plan as plans
from . import stage, worlds
from .designs import DESIGNS
from .files import read_json, write_json
from .plan import Plan
from .worlds import World


def restore(kept: dict[str, Any], out: Path, scenes: Path, xodr: Path | None) -> Plan:
    """Writes plan, scores, units and checks of a record to ``out``.

    Raises ``ValueError`` for a record that is none or has no metrics by seed and scene, and for scenes that are others now.
    """
    record = _record(kept)
    _check_maps(record, xodr)
    plans.worlds_of(DESIGNS[record["design"]], out, scenes, xodr)
    scenes_of_run = [World.from_dict(world, out, scenes) for world in record["scenes"]]
    now = plans.versions()
    changed = sorted(key for key in now if record["versions"].get(key) != now[key])
    stage.say(f"other than in the record: {', '.join(changed) or 'nothing'}")
    record = {**record, "versions": now}
    tested = [world.name for world in scenes_of_run if world.role == "test"]
    placements = kept["placements"]
    for index, scene in enumerate(tested):
        of_scene = {score: [one["scores"][score][index] for one in placements] for score in record["scores"]}
        write_json(out / "scores" / f"{scene}.json", of_scene)
        write_json(out / "truth" / f"{scene}.json", kept["targets"][scene])
    for one in placements:
        for row, seed in enumerate(one["seeds"]):
            judged = {scene: {"metrics": _metrics(one, row, k), "detail": {}} for k, scene in enumerate(tested)}
            unit = {"placement": one["name"], "seed": seed, "curve": [], "scenes": judged}
            write_json(out / "units" / f"{one['name']}-{seed}.json", unit)
    for check in ("shuffled-labels", "learning-curve"):
        if check in kept["checks"]:
            write_json(out / "checks" / f"{check}.json", kept["checks"][check])
    # The plan comes last: a folder that has one is whole.
    write_json(out / "plan.json", {"plan_sha256": plans.digest(record), "plan": record})
    return plans.of_run(out, scenes)


def _metrics(placement: dict[str, Any], row: int, scene: int) -> dict[str, float]:
    """Metrics of the trees; units of another learner are not kept."""
    found = placement["by_seed_and_scene"]
    return {metric: found[metric][row][scene] for metric in found if not metric.startswith("unet_")}


def _check_maps(record: dict[str, Any], xodr: Path | None) -> None:
    """Refuses a run with towns on maps that are not there, before any world is made."""
    design, run = DESIGNS[record["design"]], {scene["name"] for scene in record["scenes"]}
    towns = [*design.train_towns, *design.test_towns]
    maps = list(dict.fromkeys(name for name, seed in towns if run & {name, f"{name}-{seed}"}))
    if xodr is None and maps:
        raise ValueError(f"it has towns on the OpenDRIVE maps {', '.join(maps)}; give their folder with --xodr")
    if xodr is not None:
        for name in maps:
            worlds.map_of(xodr, name)


def _record(kept: dict[str, Any]) -> dict[str, Any]:
    """The plan of what was kept, if that is what it says and holds all that is needed."""
    record: dict[str, Any] = kept.get("plan") or {}
    if record.get("design") not in DESIGNS or kept.get("plan_sha256") != plans.digest(record):
        raise ValueError("it is no result of a study, or was changed; give the record.json.gz or result.json of a run")
    if not all("by_seed_and_scene" in one for one in kept["placements"]):
        raise ValueError("it has means alone, no metrics by seed and scene; of such a run nothing can be restored")
    if kept["missing_units"]:
        raise ValueError(f"it lacks {len(kept['missing_units'])} units; only whole runs are restored")
    return record


def main(arguments: list[str]) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m sightline_evidence restore", description=__doc__)
    parser.add_argument("record", type=Path, help="record.json.gz or result.json of a whole run, such as evidence/runs/standard.json.gz")
    parser.add_argument("--out", type=Path, required=True, help="folder for the run; must not hold one")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of the own four scenes [scenes]")
    parser.add_argument("--xodr", type=Path, help="folder of the OpenDRIVE maps that the run had, if any")
    given = parser.parse_args(arguments)
    out = given.out.resolve()
    if (out / "plan.json").exists():
        raise ValueError(f"{out}: holds a run already; give another --out")
    try:
        plan = restore(read_json(given.record), out, given.scenes.resolve(), given.xodr.resolve() if given.xodr else None)
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{given.record}: {error}") from error
    stage.say(f"restored {len(plan.placements)} placements in {len(plan.of('test'))} scenes, plan {plan.sha256[:12]}, to {given.out}")
    return 0
