"""Curves of value against work and against CPU seconds, with quartiles over seeds, as one SVG a problem."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

from .records import write
from .table import number, quartiles

COLOURS = ("#0b5fa5", "#7a3e9d", "#8a8a8a", "#d1495b", "#2a9d6f", "#e0a100", "#6c584c", "#1aa3b8", "#b5179e")


def steps(runs: list[list[dict[str, Any]]]) -> list[tuple[float, float, tuple[float, float, float]]]:
    """Median work, median CPU seconds and quartiles of the value, mark by mark, of runs with equal marks."""
    found = []
    for points in zip(*runs):
        middle = [quartiles([point[key] for point in points])[1] for key in ("work", "cpu_seconds")]
        found.append((middle[0], middle[1], quartiles([number(point["value"]) for point in points])))
    return found


def drawn(path: Path, title: str, best: float | None, curves: dict[str, list[list[dict[str, Any]]]]) -> str | None:
    """Writes the figure of a problem. A sentence where it cannot be drawn."""
    try:
        import matplotlib

        matplotlib.use("svg")
        from matplotlib import pyplot
    except ImportError as error:
        return f"figures are left out: {error}; pip install matplotlib"
    matplotlib.rcParams.update({"svg.hashsalt": title, "svg.fonttype": "none", "font.size": 9})
    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4.2), sharey=True)
    for colour, (name, runs) in zip(COLOURS * 3, curves.items()):
        kept = [step for step in steps(runs) if not math.isinf(step[2][0])]
        for column, axis in enumerate(axes):
            across = [step[column] for step in kept]
            lower, middle, upper = ([100.0 * step[2][k] for step in kept] for k in range(3))
            axis.fill_between(across, lower, upper, color=colour, alpha=0.15, linewidth=0)
            axis.plot(across, middle, color=colour, label=name, marker="o", markersize=3, linewidth=1.4)
    for axis, label in zip(axes, ("sensor poses cast × frames", "CPU seconds")):
        if best is not None:
            axis.axhline(100.0 * best, color="black", linewidth=0.8, linestyle=":", label="best known")
        axis.set_xscale("log")
        axis.set_xlabel(label)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("near gain, %: median and quartiles")
    axes[0].set_title(title, loc="left")
    axes[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    text = io.StringIO()
    figure.savefig(text, format="svg", bbox_inches="tight", metadata={"Date": None})
    pyplot.close(figure)
    write(path, text.getvalue())
    return None
