"""Three displays and two controls from the kept records: ``python -m sightline_evidence displays --out docs/evidence``.

Needs nothing but the records in ``evidence/runs``. Prints the tables of ``docs/evidence.md`` and writes two pictures.
"""

from __future__ import annotations

import argparse
import gzip
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import correlate, decide
from ._types import F64, Bools
from .correlate import Interval
from .gathered import Gathered, mean
from .layouts import Layout
from .tables import head, row
from .worlds import OWN

#: Records that the repository keeps, by their names in the tables.
RUNS = {"standard": "standard.json.gz", "towns": "towns.json.gz"}

#: Groups of deciding metrics, and whether a learner is part of them. Without the U-Net, whose units are not kept.
GROUPS = {
    "recognition (trees)": ("voxel_miou", "voxel_1m_miou", "birds_eye_miou"),
    "objects (points counted)": ("objects_5", "objects_20"),
    "near ground (geometry)": ("ground_seen_3m", "ground_seen_10m"),
}

#: Scores of the forest plot.
SHOWN = ("near_gain", "information_gain", "m_sog_scaled_nonzero", "m_sog_scaled", "covered")

#: Scores whose optima were searched by the engine.
SEARCHED = ("near_gain", "information_gain", "m_sog_scaled_nonzero", "m_sog_scaled")

#: Differences that small are called equal, in the units of the metric. Chosen after the runs, and too wide for
#: ``voxel_miou``: ``table_of_margin`` counts who else is equal.
MARGIN = 0.02

#: Title of the picture of these differences.
EQUAL = (
    f"less Ours-seg, in mIoU or shares; right is better; grey: within ±{MARGIN}\n"
    "for voxel_miou nearly the whole pool lies within it: equality says nothing there"
)

#: The score that costs nothing.
FREE = "mean_height"


@dataclass(frozen=True)
class Losses:
    """Regret of what scores pick, ``[1 + draws, scores, groups]``: as it is, then in each draw."""

    table: F64
    scores: list[str]

    def of(self, score: str, group: int) -> Interval:
        """Regret of a score in a group of metrics."""
        return decide.interval_of(self.table[:, self.scores.index(score), group])

    def less(self, score: str, other: str | None, group: int) -> Interval:
        """Regret of a score less another's, draw by draw; ``None`` is a random pick, whose regret is 1."""
        base: Any = 1.0 if other is None else self.table[:, self.scores.index(other), group]
        return decide.interval_of(self.table[:, self.scores.index(score), group] - base)


def read(path: Path) -> Gathered:
    """A record as arrays; metrics of the trees and of geometry alone, as the record has them."""
    kept: dict[str, Any] = json.loads(gzip.decompress(path.read_bytes()))
    plan: Any = kept["plan"]
    layouts = [Layout.from_dict(one) for one in plan["placements"]]
    if [one.name for one in layouts] != [one["name"] for one in kept["placements"]]:
        raise ValueError(f"{path}: its placements are not those of its plan; give a record that was not edited")
    scenes = [scene["name"] for scene in plan["scenes"] if scene["role"] == "test"]
    seeds: list[int] = plan["seeds"]

    def metric(name: str) -> F64:
        by_seed = [[one["by_seed_and_scene"][name][k] for one in kept["placements"]] for k in range(len(seeds))]
        return np.array(by_seed, dtype=np.float64)

    metrics = {name: metric(name) for name in plan["metrics"]}
    scores = {name: np.array([one["scores"][name] for one in kept["placements"]], dtype=np.float64) for name in plan["scores"]}
    return Gathered(kept["plan"], layouts, scenes, seeds, metrics, scores, {}, [])


def losses(given: Gathered, kept: Bools) -> Losses:
    """Regret among the placements ``kept``, by the groups of ``GROUPS``, then their mean over all seven metrics."""
    names = [metric for group in GROUPS.values() for metric in group]
    tables = np.stack([given.mean(metric)[kept] for metric in names])
    among = np.array([[metric in group for metric in names] for group in (*GROUPS.values(), names)])
    drawn = correlate.Drawn.of(np.random.default_rng(decide.SEED), *tables.shape[1:])
    scores = list(given.scores)
    return Losses(decide.picked(np.stack([given.scores[s][kept] for s in scores]), tables, among, drawn), scores)


def without_optima(given: Gathered) -> Bools:
    """Four in the mount that no score was searched for: made by hand, or random."""
    free: Bools = given.pool("box") & np.array([not one.name.startswith("best-") for one in given.layouts], dtype=bool)
    return free


def at_random(given: Gathered) -> Bools:
    """Random placements of four in the mount."""
    drawn: Bools = given.pool("box") & np.array([one.name.startswith("random-") for one in given.layouts], dtype=bool)
    return drawn


def shown(found: Interval, digits: int = 2) -> str:
    """``−.09 [−.22 .04]``."""
    return f"{_bare(found.value, digits)} [{_bare(found.low, digits)} {_bare(found.high, digits)}]"


def _bare(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    text = text.replace("-0.", "−.").replace("-", "−")
    return text[1:] if text.startswith("0.") else text


def table_of_runs(given: dict[str, Gathered]) -> str:
    """Scenes that judged in each record, and runs that had looked at them before."""
    text = head(["record", "placements in the mount", "of which in the other record", "test scenes", "own scenes, looked at by earlier runs", "maps in the other record"])
    for name, run in given.items():
        others = [other for called, other in given.items() if called != name]
        known = {poses_of(one) for other in others for one in other.layouts}
        maps = {map_of(scene) for other in others for scene in other.scenes} - {None}
        box = [one for one, kept in zip(run.layouts, run.pool("box")) if kept]
        shared = sorted({str(map_of(scene)) for scene in run.scenes if map_of(scene) in maps})
        own = [scene for scene in run.scenes if scene in OWN]
        count = str(sum(poses_of(one) in known for one in box))
        text += row([name, str(len(box)), count, str(len(run.scenes)), ", ".join(own) or "none", ", ".join(shared) or "none"])
    return text


def poses_of(layout: Layout) -> bytes:
    """Key of a placement: its poses, rounded."""
    return np.round(layout.poses, 6).tobytes()


def map_of(scene: str) -> str | None:
    """OpenDRIVE map that a test scene was made on."""
    return scene.partition("-")[0] if scene.startswith("Town") else None


def table_of_differences(given: dict[str, Gathered]) -> str:
    """Near gain less other scores, with all placements and where no score's optimum is in the pool."""
    text = head(["record, pool", "near gain less", *GROUPS, "all seven"])
    for name, run in given.items():
        for pool, kept in (("all", run.pool("box")), ("without optima", without_optima(run))):
            found = losses(run, kept)
            for other in ("information_gain", FREE, "covered", "m_sog_scaled_nonzero"):
                cells = [shown(found.less("near_gain", other, k)) for k in range(len(GROUPS) + 1)]
                text += row([f"{name}, {pool}", f"`{other}`", *cells])
    return text


def table_of_regret(given: dict[str, Gathered]) -> str:
    """Regret by group of metrics and over all seven, then over all seven without the optima of scores in the pool."""
    text = head(["record", "regret, 0 best, 1 mean", *GROUPS, "all seven", "all seven, without optima"])
    for name, run in given.items():
        found, free = losses(run, run.pool("box")), losses(run, without_optima(run))
        for score in ("near_gain", "information_gain", "m_sog_scaled", "covered", FREE, "shuffled"):
            cells = [found.of(score, k) for k in range(len(GROUPS) + 1)] + [free.of(score, len(GROUPS))]
            text += row([name, f"`{score}`", *map(shown, cells)])
    return text


def table_of_margin(given: dict[str, Gathered]) -> str:
    """Placements of the pool that are equal to ``Ours-seg`` by the margin, the whole interval within it; not itself."""
    metrics = [metric for group in GROUPS.values() for metric in group]
    text = head([f"within ±{_bare(MARGIN, 2)}", *metrics])
    for name, run in given.items():
        ours, kept = run.place(decide.PUBLISHED), run.pool("box")
        others = [k for k in np.flatnonzero(kept) if k != ours]
        cells = []
        for metric in metrics:
            found = [decide.over_scenes(run.metrics[metric][:, k] - run.metrics[metric][:, ours]) for k in others]
            cells.append(f"{sum(-MARGIN <= one.low and one.high <= MARGIN for one in found)} of {len(others)}")
        text += row([name, *cells])
    return text


def table_of_ranks(given: dict[str, Gathered]) -> str:
    """Spearman of scores with metrics among random placements."""
    metrics = ("birds_eye_miou", "objects_20")
    titles = [f"{name}, {at_random(run).sum()} placements: {metric}" for name, run in given.items() for metric in metrics]
    text = head(["random placements alone, ρ", *titles])
    for score in ("near_gain", "information_gain", FREE):
        cells = []
        for run in given.values():
            kept = at_random(run)
            for metric in metrics:
                table = run.mean(metric)[kept]
                drawn = correlate.Drawn.of(np.random.default_rng(decide.SEED), *table.shape)
                cells.append(shown(correlate.spearman_interval(run.scores[score][kept], table, drawn)))
        text += row([f"`{score}`", *cells])
    return text


def optima_less_published(run: Gathered) -> dict[str, dict[str, Interval]]:
    """Optima of each searched score less ``Ours-seg``, in units of each metric, over scenes and seeds."""
    ours = run.place(decide.PUBLISHED)
    found: dict[str, dict[str, Interval]] = {}
    for score in SEARCHED:
        rows = [run.place(name) for name in decide.optima_of(run, score)]
        of = (metric for group in GROUPS.values() for metric in group)
        found[score] = {m: decide.over_scenes(mean(run.metrics[m][:, rows], 1) - run.metrics[m][:, ours]) for m in of}
    return found


def _written(page: Any) -> bytes:
    import matplotlib

    content = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "sightline"}):
        page.savefig(content, format="svg", metadata={"Date": None})
    return content.getvalue()


def _line(spot: Any, found: Interval, height: float, colour: str) -> None:
    spot.plot([found.low, found.high], [height, height], color=colour, linewidth=2)
    spot.plot(found.value, height, "o", color=colour, markersize=5)


COLOURS = {"standard": "#2b6cb0", "towns": "#dd6b20"}


def forest(given: dict[str, Gathered]) -> bytes:
    """SVG: regret of scores less a random pick's and less mean height's, by group of metrics."""
    from matplotlib.figure import Figure

    page = Figure(figsize=(11, 6), layout="constrained")
    spots = page.subplots(2, len(GROUPS), sharey=True, sharex="row")
    for at, (name, run) in enumerate(given.items()):
        found = losses(run, run.pool("box"))
        for line, (other, words) in enumerate(((None, "a random pick"), (FREE, "mean height"))):
            for k, group in enumerate(GROUPS):
                spot = spots[line][k]
                for height, score in enumerate(reversed(SHOWN)):
                    _line(spot, found.less(score, other, k), height + 0.15 - 0.3 * at, COLOURS[name])
                spot.axvline(0, color="black", linewidth=0.8)
                spot.set_title(group, fontsize=10)
                spot.set_yticks(range(len(SHOWN)), list(reversed(SHOWN)), fontsize=9)
                spot.set_xlabel(f"regret less that of {words}; left is better", fontsize=9)
    lines = [spots[0][0].plot([], [], "o-", color=colour, label=name)[0] for name, colour in COLOURS.items() if name in given]
    page.legend(handles=lines, loc="outside upper center", ncols=2, fontsize=9, title="scores against a free choice, 95 % over placements and scenes, not corrected for their number", title_fontsize=10)
    return _written(page)


def equivalence(given: dict[str, Gathered]) -> bytes:
    """SVG: optima of scores less ``Ours-seg`` in the units of each metric, with the margin within which they are equal."""
    from matplotlib.figure import Figure

    names = [metric for group in GROUPS.values() for metric in group]
    page = Figure(figsize=(11, 5), layout="constrained")
    spots = page.subplots(1, len(SEARCHED), sharey=True, sharex=True)
    for at, (name, run) in enumerate(given.items()):
        for spot, (score, by_metric) in zip(spots, optima_less_published(run).items()):
            for height, metric in enumerate(reversed(names)):
                _line(spot, by_metric[metric], height + 0.15 - 0.3 * at, COLOURS[name])
            spot.set_title(f"optima of {score}", fontsize=9)
    for spot in spots:
        spot.axvspan(-MARGIN, MARGIN, color="#e2e8f0", zorder=0)
        spot.axvline(0, color="black", linewidth=0.8)
        spot.set_yticks(range(len(names)), list(reversed(names)), fontsize=9)
    lines = [spots[0].plot([], [], "o-", color=colour, label=name)[0] for name, colour in COLOURS.items() if name in given]
    page.legend(handles=lines, loc="outside upper center", ncols=2, fontsize=9, title=EQUAL, title_fontsize=10)
    return _written(page)


def tables(given: dict[str, Gathered]) -> str:
    """All tables as Markdown."""
    parts = (table_of_runs, table_of_differences, table_of_regret, table_of_ranks, table_of_margin)
    return "\n".join(part(given) for part in parts)


def main(arguments: list[str]) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m sightline_evidence displays", description=__doc__)
    parser.add_argument("--runs", type=Path, default=Path("evidence/runs"), help="folder of the records [evidence/runs]")
    parser.add_argument("--out", type=Path, help="folder for forest.svg and equivalence.svg; without it tables alone")
    asked = parser.parse_args(arguments)
    given = {name: read(asked.runs / file) for name, file in RUNS.items()}
    print(tables(given))
    if asked.out:
        asked.out.mkdir(parents=True, exist_ok=True)
        for name, picture in (("forest", forest), ("equivalence", equivalence)):
            beside = asked.out / f"{name}.svg.tmp"
            beside.write_bytes(picture(given))
            beside.replace(asked.out / f"{name}.svg")
    return 0
