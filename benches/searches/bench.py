"""Course of the benchmark: makes the runs that are missing, then writes table and figures."""

from __future__ import annotations

import importlib
import shlex
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from . import ours, peers, table
from .figure import drawn
from .problems import FIELDS, Problem, space_of
from .records import Absent, BestKnown, Store, commit, write
from .scoring import Budget, Scenes, confirmed

OWN = ("ours", "swaps")
#: Shares of --work at which peers are looked at.
SHARES = (0.125, 0.25, 0.5, 1.0)


class LeftOut(Exception):
    """A method that a problem does not take; holds a sentence."""


class Bench:
    """Arguments, finished runs, and scenes that are built when a peer first needs them."""

    def __init__(self, args: Namespace) -> None:
        self.args = args
        self.store = Store(args.out, args.kept)
        self.best = BestKnown(args.best_known)
        self.at = commit()
        self.scenes: dict[tuple[str, int | None], Scenes] = {}
        self.notes: list[str] = []
        for method in [method for method in args.methods if method in peers.PEERS and not args.kept]:
            note = peers.lacking(method)
            if note:
                self.note(note)
                args.methods.remove(method)

    def note(self, text: str) -> None:
        """Says something once, and at the end of the table."""
        if text not in self.notes:
            self.notes.append(text)
            print(text, file=sys.stderr)

    def offer(self, problem: Problem, record: dict[str, Any], value: float | None, lidars: Any) -> None:
        """Offers a result to the best known."""
        if self.best.offer(problem.key, value, lidars, record["command"], record["commit"]):
            print(f"{problem.key}: best known is now {value} ({record['command']})", file=sys.stderr)

    def optimized(self, problem: Problem, method: str, seed: int, options: list[str]) -> dict[str, Any]:
        """A run of the program, kept, or the one that is there."""
        options = [*options, *self.args.options]

        def run() -> dict[str, Any]:
            ours.made(problem, self.args.program)
            found = ours.optimized(problem, seed, options, self.args.program, self.args.out)
            return {**found, "commit": self.at}

        record = self.store.done(problem.key, method, seed, {"options": shlex.join(options)}, run)
        self.say(record, record["value"], record["work"], record["cpu_seconds"])
        self.offer(problem, record, record["value"], record["lidars"])
        return record

    def say(self, record: dict[str, Any], value: float | None, work: int, seconds: float) -> None:
        """A line of progress."""
        name = f"{record['problem']} {record['method']} seed {record['seed']}"
        shown = "unmet" if value is None else f"{100.0 * value:.3f} %"
        print(f"{name}: {shown}, {work} poses × frames, {seconds:.1f} CPU s", file=sys.stderr, flush=True)

    def built(self, problem: Problem, frames: int | None) -> Scenes:
        """The scenes of a problem over some frames, or all; P-SOGs always are of all."""
        key = (problem.key, frames)
        if key not in self.scenes:
            ours.made(problem, self.args.program)
            psogs = None if frames is None else self.built(problem, None).psogs
            sightline = importlib.import_module("sightline")
            self.scenes[key] = Scenes(sightline, problem, frames, psogs)
        return self.scenes[key]

    def marks(self, runs: list[dict[str, Any]]) -> list[int]:
        """Work at which peers are looked at: that of our runs of the seed, or shares of --work."""
        if self.args.work:
            return [round(share * self.args.work) for share in SHARES]
        return [run["work"] for run in runs]

    def searched(self, problem: Problem, method: str, seed: int, runs: list[dict[str, Any]]) -> dict[str, Any]:
        """A run of a peer over poses of the equipment that ours found, kept, or the one that is there.

        LeftOut where a peer needs a baseline to start from and none fits.
        """
        mine, marks = runs[self.compared()], self.marks(runs)
        frames = self.args.peer_frames or -(-mine["search_frames"] // len(problem.scenes))
        settings = {"marks": marks, "frames": frames, "equipment": [mine["mounts"], equipment(mine)]}

        def run() -> dict[str, Any]:
            space, first = space_of(problem, mine["lidars"], mine["mounts"]), None
            if method in peers.STARTED:
                first = space.shares([[lidar.get(name, 0.0) for name in FIELDS] for lidar in mine["baseline"] or []])
                if first is None:
                    raise LeftOut(f"{peers.TITLES[method]} is left out on {problem.title}: "
                                  "no baseline fits its mounts.")
            few, whole = self.built(problem, frames), self.built(problem, None)
            budget = Budget(space, few, mine["required"], max(marks))
            peers.searched(method, budget.costs, space.variables, seed, budget.most, first)
            command = f"python3 -m benches.searches --problems {problem.key} --methods {method}, seed {seed}"
            return {"points": confirmed(budget, whole, marks), "frames": few.frames, "asked": budget.asked,
                    "variables": space.variables, "sensors": space.sensors, "command": command,
                    "commit": self.at}

        record = self.store.done(problem.key, method, seed, settings, run)
        last = record["points"][-1]
        self.say(record, last["value"], last["work"], last["cpu_seconds"])
        for point in record["points"]:
            self.offer(problem, record, point["value"], lidars(point["poses"], record["sensors"]))
        return record

    def compared(self) -> int:
        """Which of our runs peers are compared with: that of --compare evaluations, or the last."""
        known = self.args.evaluations
        return known.index(self.args.compare) if self.args.compare in known else len(known) - 1

    def measured(self, problem: Problem) -> dict[str, dict[int, Any]]:
        """All runs of a problem, by method and seed; of `ours` a list of runs, by evaluations.

        Runs that --kept does not find are left out, and a seed where one of `ours` is.
        """
        found: dict[str, dict[int, Any]] = {"ours": {}}
        others = [method for method in self.args.methods if method != "ours"]
        if problem.plain and others:
            self.note(f"Left out on {problem.title}: {', '.join(others)}; `optimize` alone runs variants, since peers "
                      "know neither its option nor its rules.")
            others = []
        for seed in self.seeds:
            try:
                runs = [self.optimized(problem, f"ours-{count}", seed, ["--evaluations", str(count)])
                        for count in self.args.evaluations]
            except Absent:
                continue
            found["ours"][seed] = runs
            for method in others:
                try:
                    run = self.optimized(problem, method, seed, ["--method", "swaps"]) if method == "swaps" \
                        else self.searched(problem, method, seed, runs)
                except Absent:
                    continue
                except LeftOut as left_out:
                    self.note(str(left_out))
                except ours.Refused as refused:
                    self.note(f"{method} is left out on {problem.title}: {str(refused).splitlines()[-1]}")
                else:
                    found.setdefault(method, {})[seed] = run
        if self.args.kept:
            there = ", ".join(f"{method} {len(found.get(method, {}))}" for method in ("ours", *others))
            self.note(f"{problem.title}, seeds that are there: {there}")
        return found

    @property
    def seeds(self) -> range:
        """Seeds of the runs."""
        return range(1, self.args.seeds + 1)

    def more(self, problem: Problem) -> list[str]:
        """Rows of the table of evaluations: each number of them against the next smaller, over seeds that have both."""
        rows, counts = [], self.args.evaluations
        for pair in zip(counts, counts[1:]):
            told = [shlex.join(["--evaluations", str(count), *self.args.options]) for count in pair]
            runs = {seed: [self.store.known(problem.key, f"ours-{count}", seed, {"options": options})
                           for count, options in zip(pair, told)] for seed in self.seeds}
            values = {seed: (both[0]["value"], both[1]["value"]) for seed, both in runs.items() if all(both)}
            if values:
                rows.append(table.more_row(problem.title, *pair, values))
        return rows

    def beside(self, variant: Problem, runs: dict[int, list[dict[str, Any]]]) -> list[str]:
        """The row of a variant in the table of variants; none where no run is there."""
        values = {}
        for seed, by_count in runs.items():
            try:
                rival = self.adapted(variant, seed)
            except Absent:
                continue
            values[seed] = (by_count[self.compared()]["value"], rival)
        if not values:
            return []
        return [table.variant_row(variant.title, variant.plain.title, variant.fair, values)]

    def adapted(self, variant: Problem, seed: int) -> float | None:
        """Value for the variant of what the plain relative's search found, brought under the variant's rules."""
        count = self.args.evaluations[self.compared()]
        plain = self.optimized(variant.plain, f"ours-{count}", seed, ["--evaluations", str(count)])
        rivals = variant.rivals(plain["lidars"])

        def run() -> dict[str, Any]:
            found = ours.scored(variant, rivals, self.args.options, self.args.program, self.args.out)
            words = shlex.join(["sightline", "optimize", *variant.shown, *self.args.options])
            command = f"{plain['command']}, {variant.fair}, as a baseline of {words}"
            return {**found, "command": command, "commit": self.at}

        settings = {"options": shlex.join(self.args.options), "placements": rivals}
        record = self.store.done(variant.key, f"plain-{count}", seed, settings, run)
        self.offer(variant, record, record["value"], record["lidars"])
        return record["value"]

    def written(self, problem: Problem, found: dict[str, dict[int, Any]]) -> str:
        """Draws the figure of a problem; its part of the table."""
        best = self.best.value(problem.key)
        counts, chosen = self.args.evaluations, self.compared()
        own = []
        for index, count in enumerate(counts):
            runs = [runs[index] for runs in found["ours"].values()]
            own.append(own_row(f"`optimize`, {count} evaluations", runs, best))
        if "swaps" in found:
            own.append(own_row("`optimize --method swaps`", list(found["swaps"].values()), best))
        values = {seed: runs[chosen]["value"] for seed, runs in found["ours"].items()}
        rivals = [self.rival(method, values, by_seed) for method, by_seed in found.items() if method not in OWN]
        curves = {"optimize": list(found["ours"].values())}
        curves |= {peers.TITLES[method]: [run["points"] for run in by_seed.values()]
                   for method, by_seed in found.items() if method not in OWN}
        if "swaps" in found:
            curves["greedy and exchanges on the grid"] = [[run] for run in found["swaps"].values()]
        unable = drawn(self.args.out / f"{problem.key}.svg", problem.title, best, curves)
        if unable:
            self.note(unable)
        work = f"beside peers at {self.args.work} poses × frames" if self.args.work else "at equal work"
        compared = f"`optimize`, {counts[chosen]} evaluations, {work}"
        return table.section(problem.key, problem.title, best, own, compared, rivals)

    def rival(self, method: str, values: dict[int, Any], by_seed: dict[int, Any]) -> str:
        """A peer's row: at the work of the compared run, or at all of --work."""
        place = -1 if self.args.work else self.compared()
        points = {seed: run["points"][place] for seed, run in by_seed.items()}
        cast = sorted({point["placements"] for point in points.values()})
        frames = sorted({run["frames"] for run in by_seed.values()})
        spent = " × ".join(str(c[0]) if len(c) == 1 else f"{c[0]} to {c[-1]}" for c in (cast, frames))
        theirs = {seed: point["value"] for seed, point in points.items()}
        seconds = [point["cpu_seconds"] for point in points.values()]
        return table.peer_row(peers.TITLES[method], values, theirs, seconds, spent)

    def run(self, problems: list[Problem]) -> str:
        """Measures problem by problem and writes table.md after each."""
        parts, more, beside, text = [], [], [], ""
        seeds = f"seeds 1 to {self.args.seeds}" if self.args.seeds > 1 else "seed 1"
        seeds += ", where all runs of ours are there" if self.args.kept else ""
        for problem in problems:
            found = self.measured(problem)
            if found["ours"]:
                parts.append(self.written(problem, found))
            more += self.more(problem)
            beside += self.beside(problem, found["ours"]) if problem.plain else []
            self.scenes.clear()
            notes = [f"- {note}\n" for note in self.notes]
            tables = [table.MORE + "\n".join(more) + "\n"] if more else []
            if beside:
                count = self.args.evaluations[self.compared()]
                tables.append(table.VARIANTS.format(count=count) + "\n".join(beside) + "\n")
            text = "\n".join([table.INTRODUCTION.format(seeds=seeds), *parts, *tables, *notes])
            write(self.args.out / "table.md", text)
        return text


def own_row(name: str, runs: list[dict[str, Any]], best: float | None) -> str:
    """A row of a method of this project's own."""
    return table.own_row(name, [run["value"] for run in runs], [run["cpu_seconds"] for run in runs], best)


def equipment(record: dict[str, Any]) -> list[str] | None:
    """Models of the LiDARs of a result, where they are named."""
    models = [lidar.get("sensor") for lidar in record["lidars"]]
    return models if any(models) else None


def lidars(poses: list[list[float]] | None, sensors: list[str] | None) -> list[dict[str, Any]]:
    """LiDARs as placement files have them."""
    named = [dict(zip(FIELDS, pose)) for pose in poses or []]
    return [{**lidar, "sensor": model} for lidar, model in zip(named, sensors)] if sensors else named
