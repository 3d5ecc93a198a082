"""What there is to win, after a run: ``python -m sightline.evidence win --out DIR``.

Searches for the metrics themselves through trees in the run's training worlds (``direct``), four LiDARs in the mount and two
of four low round the body, tests what is found in its test scenes, and says by how much it differs from the published
optimum. Everything lies in ``DIR/win``; killed at any time, the same command goes on.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from . import decide, direct, pool, run, stage
from . import plan as plans
from .files import is_whole, read_json, write_json
from .layouts import Layout, out_of_step
from .plan import Plan
from .tables import head, interval, row

#: Poses in the mount, and low ones, that exchanges are drawn from.
POSES = (400, 160)

#: Exchanges of one pose in each search.
EXCHANGES = 24

#: Placements in the mount that a search may begin at, by what their names begin with; of those with low ones, all.
STARTS = (decide.PUBLISHED, "best-near_gain-", "best-pool-near_and_")


def carry_out(plan: Plan, out: Path, exchanges: int, jobs: int) -> dict[str, Any]:
    """Searches and tests whatever is not in ``out/win`` yet; the differences from the published optimum."""
    folder, seed = out / "win", plan.seeds[0]
    published = out / "units" / f"{decide.PUBLISHED}-{seed}.json"
    if not is_whole(published):
        raise ValueError(f"{published}: is not there; run the study with this --out first")
    stage.carry_out("searches through trees", _searches(plan, out, exchanges), jobs)
    found = out_of_step([Layout(f"direct-trees-{group}", "direct", _poses(folder, group)) for group in ("box", "low")])
    stage.carry_out("tests", [(folder / f"{one.name}-{seed}.json", run.unit, (plan, one, seed, out)) for one in found], jobs)
    ours = read_json(published)["scenes"]
    result: dict[str, Any] = {}
    for one, group in zip(found, ("box", "low")):
        theirs = read_json(folder / f"{one.name}-{seed}.json")["scenes"]
        searched = read_json(folder / f"search-{group}.json")
        result[one.name] = {
            "search": {key: searched[key] for key in ("poses", "value", "start", "starts", "exchanges", "taken")},
            "less_published": {
                metric: asdict(decide.over_scenes(np.array([_of(theirs, s, metric) - _of(ours, s, metric) for s in ours])))
                for metric in direct.METRICS
            },
        }
    return result


def _searches(plan: Plan, out: Path, exchanges: int) -> list[stage.Task]:
    """In the mount, and with two of four low; those of another length are forgotten."""
    train, folder = plan.of("train"), out / "win"
    mount = train[0].source().described["mount"]
    poses, kinds = pool.drawn(mount, *POSES, seed=1)
    inside, apart = kinds == pool.INSIDE, float(mount.get("min_distance", 0.0))
    tasks: list[stage.Task] = []
    for sort, group, allowed in (("box", "box", [inside] * 4), ("mixed", "low", [inside, inside, ~inside, ~inside])):
        starts = {
            # High ones before low ones, as the search has them.
            one.name: one.poses[np.argsort(one.poses[:, 2] < 1.5, kind="stable")]
            for one in plan.placements
            if one.pool == sort and (sort == "mixed" or one.name.startswith(STARTS))
        }
        if not starts:
            raise ValueError(f"{out}: has no {group} placement to begin at; give the folder of quick, standard or again")
        path, kept = folder / f"search-{group}.json", folder / f"search-{group}.known.json"
        if is_whole(path) and read_json(path)["exchanges"] != exchanges:
            # With what is kept a search of another length goes on where the two part.
            for stale in (path, folder / f"direct-trees-{group}-{plan.seeds[0]}.json"):
                stale.unlink(missing_ok=True)
        work = (train, direct.Room(poses, allowed, apart), starts, exchanges, plan.learner, folder / "truth", kept)
        tasks.append((path, direct.optimum, work))
    return tasks


def _poses(folder: Path, group: str) -> Any:
    return np.array(read_json(folder / f"search-{group}.json")["poses"])


def _of(scenes: dict[str, Any], scene: str, metric: str) -> float:
    value = scenes[scene]["metrics"][metric]
    return float("nan") if value is None else float(value)


def table(result: dict[str, Any]) -> str:
    """Markdown."""
    text = head(["searched", "value in training worlds: best start, found", *direct.METRICS])
    for name, of in result.items():
        search = of["search"]
        begun = f"{search['starts'][search['start']]:.2f} ({search['start']}), {search['value']:.2f}"
        text += row([name, begun, *(interval(of["less_published"][metric], 3) for metric in direct.METRICS)])
    return text


def main(arguments: list[str]) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m sightline.evidence win", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder of a run")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of the own four scenes [scenes]")
    parser.add_argument("--exchanges", type=int, default=EXCHANGES, help=f"of one pose in each search [{EXCHANGES}]")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes [all cores]")
    given = parser.parse_args(arguments)
    if min(given.jobs, given.exchanges) < 1:
        parser.error("--jobs, --exchanges: give 1 or more")
    out = given.out.resolve()
    result = carry_out(plans.of_run(out, given.scenes.resolve()), out, given.exchanges, given.jobs)
    write_json(out / "win" / "win.json", result)
    print(f"less {decide.PUBLISHED} [95 %, over scenes]\n\n{table(result)}", end="")
    return 0
