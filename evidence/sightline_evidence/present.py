"""Tables and one picture of a study's result."""

from __future__ import annotations

import gzip
import io
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .decide import NULL, handmade
from .files import finite
from .tables import interval, tables

#: The pool that the picture shows.
POOL = "four in the mount"

#: Colours of what the picture tells apart.
COLOURS = {"published or by hand": "#dd6b20", "optimum of a score": "#2f855a", "random": "#a0aec0"}


def write(result: dict[str, Any], out: Path) -> None:
    """``tables.md``, ``figure.svg`` and ``record.json.gz``, which ``restore`` reads, in ``out``."""
    _whole(out / "record.json.gz", record(result))
    _whole(out / "tables.md", tables(result).encode())
    _whole(out / "figure.svg", figure(result))


def record(result: dict[str, Any]) -> bytes:
    """Compact record of a run, at most 300 kB of gzipped JSON: all that ``restore`` needs to write the run again.

    Scores keep six significant digits and metrics four, enough to order placements as they were.
    """
    checks = {name: result["checks"][name] for name in ("shuffled-labels", "learning-curve") if name in result["checks"]}
    placements = [
        {
            "name": one["name"],
            "seeds": one["seeds"],
            "scores": _rounded(one["scores"], 6),
            "by_seed_and_scene": _rounded(one["by_seed_and_scene"], 4),
        }
        for one in result["placements"]
    ]
    kept = {key: result[key] for key in ("plan_sha256", "plan", "targets", "missing_units")}
    text = json.dumps(finite({**kept, "checks": checks, "placements": placements}), separators=(",", ":"), sort_keys=True)
    return gzip.compress(text.encode(), mtime=0)


def _rounded(value: Any, digits: int) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(inner, digits) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner, digits) for inner in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


def _whole(path: Path, content: bytes) -> None:
    beside = path.with_name(f"{path.name}.tmp")
    beside.write_bytes(content)
    os.replace(beside, path)


def figure(result: dict[str, Any]) -> bytes:
    """SVG: what one loses by trusting each score, and what each placement of the pool is worth."""
    import matplotlib
    from matplotlib.figure import Figure

    design, count = result["plan"]["design"], len(result["placements"])
    page = Figure(figsize=(11, 5.6), layout="constrained")
    title = f"{design} study: {count} placements, targets that no placement moves"
    if POOL in result["pools"]:
        left, right = page.subplots(1, 2)
        _losses(left, result["pools"][POOL]["regret"])
        _worth(right, result)
    page.suptitle(title, fontsize=11)
    written = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "sightline"}):
        page.savefig(written, format="svg", metadata={"Date": None})
    return written.getvalue()


def _losses(spot: Any, regret: dict[str, Any]) -> None:
    rows = sorted(regret["scores"].items(), key=lambda item: -item[1]["mean"]["value"])
    for height, (score, of) in enumerate(rows):
        colour = "#718096" if score in NULL else "#2b6cb0"
        spot.plot([of["mean"]["low"], of["mean"]["high"]], [height, height], color=colour, linewidth=2)
        spot.plot(of["mean"]["value"], height, "o", color=colour)
    spot.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=8)
    spot.axvline(0, color="black", linewidth=0.8)
    spot.axvline(1, color="black", linewidth=0.8, linestyle="--")
    spot.set_xlabel("lost by taking the placement that the score puts first\n0: none was better · 1: the mean of the placements")
    spot.set_title(f"mean over {len(regret['metrics'])} metrics, 95 % over placements and scenes; grey: null models", fontsize=9)


def _worth(spot: Any, result: dict[str, Any]) -> None:
    kinds: dict[str, list[tuple[float, float, str]]] = {name: [] for name in COLOURS}
    for placement in result["placements"]:
        x, y = placement["metrics"]["birds_eye_miou"], placement["metrics"]["objects_5"]
        if placement["pool"] != "box" or x is None or y is None:
            continue
        name = placement["name"]
        optimum = "optimum of a score" if name.startswith("best-") else "random"
        kinds["published or by hand" if handmade(name) else optimum].append((x, y, name))
    for kind, points in kinds.items():
        spot.scatter([p[0] for p in points], [p[1] for p in points], s=18, color=COLOURS[kind], label=kind)
    spot.margins(x=0.15, y=0.08)
    found = result["pools"][POOL]["metrics"]["birds_eye_miou"]["scores"]["information_gain"]["spearman"]
    spot.set_title(f"four LiDARs in the mount; gain orders the map with ρ {interval(found)}", fontsize=9)
    spot.set_xlabel("bird's-eye map, mIoU")
    spot.set_ylabel("objects with at least 5 points, share")
    spot.legend(fontsize=8)
    named = [(x, y, _short(name)) for x, y, name in kinds["published or by hand"] + kinds["optimum of a score"]]
    _names(spot, named, [point[:2] for points in kinds.values() for point in points])


def _short(name: str) -> str:
    return name.removeprefix("best-").removeprefix("pool-").removesuffix("-box")


#: A rectangle in points of print: left, low, right, high.
_Box = tuple[float, float, float, float]


def _names(spot: Any, named: list[tuple[float, float, str]], points: list[tuple[float, float]]) -> None:
    """Writes names where they cover neither another name nor a point, as near to their own as that goes.

    A thin line leads to each; a name that has no room is left out.
    """
    spot.figure.draw_without_rendering()
    scale, size = 72 / spot.figure.dpi, 5.5
    frame = tuple(edge * scale for edge in spot.bbox.extents)
    at = [spot.transData.transform(point) * scale for point in points]
    taken: list[_Box] = [(u - 2, v - 2, u + 2, v + 2) for u, v in at]
    line = {"arrowstyle": "-", "linewidth": 0.3, "color": "#a0aec0", "shrinkA": 0, "shrinkB": 2}
    for x, y, name in sorted(named, key=lambda one: -one[1]):
        u, v = spot.transData.transform((x, y)) * scale
        free = (box for box in _around(u, v, 0.6 * size * len(name), size) if _is_free(box, frame, taken))
        box = next(free, None)
        if box:
            taken.append(box)
            offset = (box[0] - u, box[1] - v)
            spot.annotate(name, (x, y), fontsize=size, xytext=offset, textcoords="offset points", arrowprops=line)


def _around(u: float, v: float, width: float, height: float) -> Iterator[_Box]:
    """Places of a name about a point, the nearest first, on each of eight sides."""
    for away in range(4, 60, 3):
        for right, up in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            left = u + right * away - width * (1 - right) / 2
            low = v + up * away - height / 2
            yield (left, low, left + width, low + height)


def _is_free(box: _Box, frame: tuple[float, ...], taken: list[_Box]) -> bool:
    inside = frame[0] < box[0] and frame[1] < box[1] and box[2] < frame[2] and box[3] < frame[3]
    return inside and not any(box[0] < t[2] and t[0] < box[2] and box[1] < t[3] and t[1] < box[3] for t in taken)
