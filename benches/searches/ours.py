"""Runs of `sightline optimize`: value, requirements, work and CPU seconds."""

from __future__ import annotations

import json
import resource
import shlex
import shutil
import subprocess
from pathlib import Path
from typing import Any

from .problems import Lidars, Problem


def children() -> float:
    """CPU seconds of ended child processes."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def made(problem: Problem, program: Path) -> None:
    """Makes scene and vehicle of a problem that has none in the repository."""
    if problem.made and not problem.scenes[0].exists():
        called(program, ["scene", "new", *problem.made, "--out", str(problem.scenes[0])], (0,))
    if problem.vehicle_made and problem.vehicle:
        problem.vehicle.write_text(problem.vehicle_made)


class Refused(SystemExit):
    """The program ended with exit code 2, a refusal; holds the command and its words."""


def called(program: Path, arguments: list[str], codes: tuple[int, ...]) -> str:
    """Runs the program and returns what it prints. Refused for exit code 2, SystemExit for others; both hold its words."""
    command = [str(program), *arguments]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in codes:
        kind = Refused if done.returncode == 2 else SystemExit
        raise kind(f"{shlex.join(command)}: exit code {done.returncode}\n{done.stderr.strip()}")
    return done.stdout


def doubts(guards: list[str]) -> list[str]:
    """Guards that make scores doubtful; others are facts about a rig: sectors it does not see, LiDARs that could be left out."""
    return [guard for guard in guards if not guard.startswith(("blind_sector", "redundant_lidar"))]


def work_of(result: dict[str, Any]) -> int:
    """Sensor poses × frames that a run cast: to choose frames, in generations and swaps, to confirm."""
    lidars = len(result["best"]["placement"]["lidars"])
    if result.get("fidelity"):
        spent = result["fidelity"]["placement_frames"]
        return lidars * sum(spent[part] for part in ("levels", "search", "swaps", "confirm"))
    return result["search_frames"] * sum(method["poses_cast"] for method in result["methods"])


def value_of(scored: dict[str, Any]) -> float | None:
    """Objective of a placement as result.json has it; None where anything is broken or unmet."""
    unmet = [row for row in scored["scores"].get("requirements", []) if not row["met"]]
    return None if unmet or scored["violations"] or doubts(scored["scores"]["guards"]) else scored["objective"]


def best_of(baselines: list[dict[str, Any]]) -> tuple[float | None, Lidars | None]:
    """Value and LiDARs of the best baseline that keeps everything."""
    kept = [(value, row["placement"]["lidars"]) for row in baselines if (value := value_of(row)) is not None]
    return max(kept, key=lambda row: row[0], default=(None, None))


def record_of(result: dict[str, Any]) -> dict[str, Any]:
    """The part of result.json that is kept. `value` is None where anything is broken or unmet."""
    best = result["best"]
    required = best["scores"].get("requirements", [])
    return {
        "value": value_of(best),
        "objective": best["objective"],
        "unmet": [row["name"] for row in required if not row["met"]],
        "broken": best["violations"] + doubts(best["scores"]["guards"]),
        "holds_in": best["scores"].get("requirements_hold_in"),
        "required": {row["name"]: row["required"] for row in required},
        "lidars": best["placement"]["lidars"],
        "mounts": result.get("mounts"),
        "baseline": best_of(result["baselines"])[1],
        "work": work_of(result),
        "poses_cast": sum(method["poses_cast"] for method in result["methods"]),
        "search_frames": result["search_frames"],
        "frames": result["frames"],
    }


def optimized(problem: Problem, seed: int, options: list[str], program: Path, out: Path) -> dict[str, Any]:
    """A run of `optimize`; its folder is taken away once its record is read."""
    folder = out / "runs" / f"{problem.key}-{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.parent.mkdir(parents=True, exist_ok=True)
    told = ["--seed", str(seed), *options]
    rest = ["--out", str(folder), "--backend", "cpu", "--quiet", "--format", "json"]
    before = children()
    text = called(program, ["optimize", *problem.arguments, *told, *rest], (0, 1))
    seconds = children() - before
    result = json.loads(text)
    shutil.rmtree(folder, ignore_errors=True)
    command = shlex.join(["sightline", "optimize", *problem.shown, *told])
    if problem.made:
        command = shlex.join(["sightline", "scene", "new", *problem.made, "--out", problem.shown[0]]) + f" && {command}"
    return {**record_of(result), "cpu_seconds": seconds, "command": command}


def scored(problem: Problem, placements: list[Lidars], options: list[str], program: Path, out: Path) -> dict[str, Any]:
    """The best of placements that keeps the rules of a problem, over all frames; value None where none does.

    They are the baselines of a run of one evaluation, since `score` knows neither rules nor mirrored scenes.
    """
    folder = out / "runs" / f"{problem.key}-plain"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    named = [{"name": str(index), "lidars": lidars} for index, lidars in enumerate(placements)]
    (folder / "placements.json").write_text(json.dumps({"placements": named}))
    told = ["--baselines", str(folder / "placements.json"), "--evaluations", "1", "--method", "cma", "--frames", "1",
            "--tolerance", "0", *options,
            "--out", str(folder / "run"), "--backend", "cpu", "--quiet", "--format", "json"]
    result = json.loads(called(program, ["optimize", *problem.arguments, *told], (0, 1)))
    shutil.rmtree(folder, ignore_errors=True)
    value, lidars = best_of(result["baselines"])
    return {"value": value, "lidars": lidars}
