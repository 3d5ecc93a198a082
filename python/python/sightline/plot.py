"""Results as plots: ``pip install 'sightline-lidar[plot]'``.

Each function draws into ``axes``, or new ones, and returns them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ._extra import load
from ._records import Front, Result
from ._scores import Scores

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["convergence", "front", "near_field", "range_card"]


def _axes(axes: Any, projection: str | None = None) -> Any:
    plt = load("matplotlib.pyplot", "plot")
    return plt.subplots(subplot_kw={"projection": projection})[1] if axes is None else axes


def range_card(card: Mapping[str, Any], axes: Axes | None = None) -> Axes:
    """The farthest distance at which each target of :meth:`Scene.range_card` is met, by bearing; ``axes`` are polar."""
    polar = _axes(axes, "polar")
    for target in card["targets"]:
        bearings = [np.radians(at["bearing"]) for at in target["bearings"]]
        farthest = [max((last for _, last in at["met"]), default=0.0) for at in target["bearings"]]
        polar.plot([*bearings, bearings[0]], [*farthest, farthest[0]], label=target["target"])
    polar.set_theta_zero_location("N")
    polar.set_title(f"farthest distance with {card['beams']} beams, m")
    polar.legend()
    return polar  # type: ignore[no-any-return]


def near_field(scores: Scores, axes: Axes | None = None) -> Axes:
    """Shares of the ground near the vehicle that each placement sees; of ``score(…, near_field=True)``."""
    axes = _axes(axes)
    at = np.arange(len(scores.rows))
    axes.barh(at - 0.2, 100 * scores["near_ring"], 0.4, label="within 3 m")
    axes.barh(at + 0.2, 100 * scores["near_field"], 0.4, label="within 10 m")
    axes.set_yticks(at, scores.names)
    axes.set_xlabel("ground with a hit close by, %")
    axes.legend()
    return axes


def front(found: Front, axes: Axes | None = None) -> Axes:
    """Placements of a front by their first two objectives, with the names of its picks."""
    axes = _axes(axes)
    values = np.array(found.values)
    axes.plot(values[:, 0], values[:, 1], "o")
    for role, number in found.picks.items():
        axes.annotate(role, (values[number, 0], values[number, 1]))
    axes.set_xlabel(found.objectives[0])
    axes.set_ylabel(found.objectives[1])
    return axes


def convergence(result: Result, axes: Axes | None = None) -> Axes:
    """Best value of a search by the placements evaluated."""
    axes = _axes(axes)
    best = [(record["evaluations"], record["best_so_far"]) for record in result.history]
    axes.step(*zip(*best), where="post")
    axes.set_xlabel("placements evaluated")
    axes.set_ylabel(str(result.record.get("settings", result.record)["objective"]))
    return axes
