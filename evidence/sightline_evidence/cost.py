"""Cost and worth of a prediction: ``python -m sightline_evidence cost --out DIR``, after ``learned``.

From mean height, which costs nothing, to a net trained for each placement: CPU-seconds for one more placement over all
test scenes, against the rank correlation with the dearest measurement that all placements have, the shared U-Net's.
Writes ``cost.json``, ``cost.md`` and ``cost.svg`` into the folder of the run.
"""

from __future__ import annotations

import argparse
import io
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import sightline

from . import agreement, candidates, run, scores
from . import plan as plans
from ._types import F64
from .correlate import Interval
from .files import is_whole, read_json, write_json
from .plan import Plan
from .scores import FRAMES
from .worlds import opened

#: Scores by what they are called, and whose time they take.
SCORES = {
    "mean height": ("mean_height", "nothing"),
    "M-SOG": ("m_sog_scaled", "score"),
    "gain": ("information_gain", "score"),
    "near gain": ("near_gain", "score"),
    "points in boxes": ("actors_5", "boxes"),
}

#: Where learners' units lie, their metrics for maps and for objects.
LEARNERS = {
    "trees": ("units", "birds_eye_miou", "objects_5"),
    "U-Net, shared": ("learned/units", "birds_eye_miou", "centre_recall"),
    "U-Net, anew": ("learned/anew", "birds_eye_miou", "centre_recall"),
}

#: The measurement that all are held against.
DEAREST = "U-Net, shared"

#: A step up in correlation that is worth dearer work.
WORTH = 0.05

#: Placements below which a rank correlation tells too little: it is listed, and neither drawn nor argued with.
FEWEST = 8

#: Placements that scores are timed with, and test scenes; the rest cost as much.
TIMED, SCENES = 8, 2


@dataclass(frozen=True)
class Way:
    """A way to predict what a placement is worth."""

    name: str
    #: CPU-seconds for one more placement.
    seconds: float
    #: Rank correlation with the dearest: of maps, and of objects found.
    maps: Interval
    objects: Interval
    #: Placements that both have judged.
    placements: int
    #: Rank correlation with the maps of nets trained anew, and for how many placements there are such.
    anew: float
    anew_of: int

    def tells(self) -> bool:
        """Whether enough placements stand behind its correlations."""
        return self.placements >= FEWEST and bool(np.isfinite(self.maps.value))


def measured(plan: Plan, out: Path) -> dict[str, float]:
    """CPU-seconds of the engine and of the trees for one more placement over all test scenes."""
    sightline.set_threads(1)
    test = plan.of("test")
    own = [layout for layout in plan.placements if layout.lidar is None][:TIMED]
    rigs = [layout.placement(layout.name) for layout in own]
    found = {"nothing": 0.0, "score": 0.0, "boxes": 0.0}
    for world in test[:SCENES]:
        scene = opened(world.source(), FRAMES)
        scene.score(rigs[:1])
        # The rigs and all frames are scored at once; points in boxes are counted in as many frames, one by one.
        found["score"] += _spent(lambda scene=scene: scene.score(rigs, self_hits=False)) / len(rigs)  # type: ignore[misc]
        for there, ground in scores.frames_of(scene, world.source(), scene.psog, own[0], FRAMES):
            candidates.look(there, ground, rigs[-1])
            found["boxes"] += _spent(lambda there=there, ground=ground: candidates.look(there, ground, rigs[0]))  # type: ignore[misc]
    found = {name: value * len(test) / min(SCENES, len(test)) for name, value in found.items()}
    found["trees"] = _spent(lambda: run.unit(plan, own[0], plan.seeds[0], out))
    return found


def _spent(work: Callable[[], Any]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def ways(plan: Plan, out: Path, spent: dict[str, float]) -> list[Way]:
    """All of them, cheapest first; those that a run has nothing of are left out."""
    kept = np.array([layout.pool != "gamed" for layout in plan.placements])
    folder, maps, objects = LEARNERS[DEAREST]
    dear = _Dear(
        agreement.metric_of(plan, out / folder, maps)[kept],
        agreement.metric_of(plan, out / folder, objects)[kept],
        agreement.metric_of(plan, out / LEARNERS["U-Net, anew"][0], maps)[kept],
    )
    if not np.isfinite(dear.maps).any():
        raise ValueError(f"{out / folder}: has no unit yet; run `python -m sightline_evidence learned` with this --out")
    scenes = [read_json(out / "scores" / f"{world.name}.json") for world in plan.of("test")]
    found = []
    for name, (score, time_of) in SCORES.items():
        if all(score in scene for scene in scenes):
            values = np.array([scene[score] for scene in scenes], dtype=np.float64).T[kept]
            found.append(dear.way(name, spent[time_of], values, values))
    for name, (folder, maps, objects) in LEARNERS.items():
        seconds = spent["trees"] if name == "trees" else _seconds(out / folder)
        ours = [agreement.metric_of(plan, out / folder, metric)[kept] for metric in (maps, objects)]
        if np.isfinite(ours[0]).any():
            found.append(dear.way(name, seconds, *ours))
    return sorted(found, key=lambda way: way.seconds)


@dataclass(frozen=True)
class _Dear:
    """The dearest measurements, ``[placements, scenes]``."""

    maps: F64
    objects: F64
    anew: F64

    def way(self, name: str, seconds: float, maps: F64, objects: F64) -> Way:
        """A way, held against them; the dearest against itself tells nothing and is ``NaN``."""
        nothing = Interval(float("nan"), float("nan"), float("nan"))
        own = name == DEAREST
        judged = np.isfinite(maps).any(axis=1)
        both = np.isfinite(self.anew).any(axis=1) & judged
        return Way(
            name,
            seconds,
            nothing if own else agreement.agreement(maps, self.maps),
            nothing if own else agreement.agreement(objects, self.objects),
            int((np.isfinite(self.maps).any(axis=1) & judged).sum()),
            agreement.agreement(maps, self.anew).value if name != "U-Net, anew" else float("nan"),
            int(both.sum()),
        )


def _seconds(folder: Path) -> float:
    files = [file for file in folder.glob("*.json") if is_whole(file)]
    return float(np.median([read_json(file)["cpu_seconds"] for file in files])) if files else float("nan")


def bend(found: list[Way]) -> str:
    """Where more work stops to pay, in one sentence: the cheapest way that none dearer beats by ``WORTH``."""
    known = [way for way in found if way.tells()]
    if not known:
        return "Nothing could be held against the dearest measurement."
    most = max(way.maps.value for way in known)
    at = next(way for way in known if way.maps.value >= most - WORTH)
    later = [way for way in known if way.seconds > at.seconds]
    gained = max((way.maps.value - at.maps.value for way in later), default=0.0)
    tail = f"what is dearer adds {max(gained, 0):.2f} at most" if later else "nothing dearer was tried"
    return f"The curve bends at {at.name}: ρ {at.maps.value:.2f} with the map of the {DEAREST} for {at.seconds:.2g} CPU-seconds; {tail}."


def table(found: list[Way]) -> str:
    """Markdown."""
    lines = [f"| way | CPU-seconds a placement | ρ with the map, {DEAREST} | ρ with the objects | ρ with the map, anew |", "|---" * 5 + "|"]
    for way in found:
        cells = ["–" if not np.isfinite(part.value) else agreement.shown(part) for part in (way.maps, way.objects)]
        anew = f"{way.anew:.2f}, n = {way.anew_of}" if np.isfinite(way.anew) else "–"
        lines.append(f"| {way.name} | {way.seconds:.2g} | {cells[0]} | {cells[1]} | {anew} |")
    return "\n".join(lines)


def chart(found: list[Way]) -> bytes:
    """SVG: CPU-seconds against the correlation with the dearest, whose own cost is a line."""
    import matplotlib
    from matplotlib.figure import Figure

    page = Figure(figsize=(7, 4.2), layout="constrained")
    spot = page.subplots()
    # A way that costs nothing stands at the left edge of a logarithmic axis.
    least = min((way.seconds for way in found if way.seconds > 0), default=1.0) / 10
    told = [way for way in found if way.tells()]
    of_cost = {way.seconds: [other for other in told if other.seconds == way.seconds] for way in told}
    for key, colour, label in (("maps", "#2b6cb0", "map"), ("objects", "#dd6b20", "objects found")):
        shown = []
        for way in told:
            # Ways of one cost stand side by side, the name of the first on its left.
            alike, interval = of_cost[way.seconds], getattr(way, key)
            x = max(way.seconds, least) * 1.25 ** alike.index(way)
            if not np.isfinite(interval.value):
                continue
            shown.append((x, interval))
            spot.plot([x, x], [interval.low, interval.high], color=colour, linewidth=1.5, alpha=0.5)
            if key == "maps":
                side, shift = ("right", -5) if alike.index(way) == 0 < len(alike) - 1 else ("left", 5)
                spot.annotate(way.name, (x, interval.value), fontsize=8, xytext=(shift, 4), textcoords="offset points", ha=side)
        spot.plot([one[0] for one in shown], [one[1].value for one in shown], "o", color=colour, label=label)
    spot.set_xscale("log")
    for way in found:
        if way.name == DEAREST and np.isfinite(way.seconds):
            spot.axvline(way.seconds, color="grey", linewidth=1, linestyle="--", label=f"cost of the {DEAREST}, itself")
    # Room for the name of the dearest way.
    spot.margins(x=0.12)
    spot.axhline(0, color="black", linewidth=0.8)
    spot.set_xlabel("CPU-seconds for one more placement (mean height: none)")
    spot.set_ylabel(f"Spearman with the {DEAREST}")
    spot.legend(fontsize=8)
    written = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "sightline"}):
        page.savefig(written, format="svg", metadata={"Date": None})
    return written.getvalue()


def main(arguments: list[str]) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m sightline_evidence cost", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder of a run that `learned` has judged")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of the own four scenes [scenes]")
    given = parser.parse_args(arguments)
    out = given.out.resolve()
    plan = plans.of_run(out, given.scenes.resolve())
    if not is_whole(out / "cost-seconds.json"):
        write_json(out / "cost-seconds.json", measured(plan, out))
    found = ways(plan, out, read_json(out / "cost-seconds.json"))
    says = bend(found)
    write_json(out / "cost.json", {"ways": [asdict(way) for way in found], "says": says})
    (out / "cost.md").write_text(f"{table(found)}\n\n{says}\n", encoding="utf-8")
    beside = out / f"cost.{os.getpid()}.tmp"
    beside.write_bytes(chart(found))
    os.replace(beside, out / "cost.svg")
    print(f"{table(found)}\n\n{says}")
    return 0
