"""The table of the benchmark, from finished runs; pure."""

from __future__ import annotations

import math
from typing import Any

UNMET = -math.inf


def number(value: float | None) -> float:
    """A value to sort by: a search that met not every rule is worse than any that did."""
    return UNMET if value is None else value


def quantile(values: list[float], share: float) -> float:
    """Quantile with linear interpolation between ranks, of one value or more; beside an infinity the lower rank."""
    ranked = sorted(values)
    place = share * (len(ranked) - 1)
    below, part = math.floor(place), place - math.floor(place)
    if part == 0.0 or ranked[below] == ranked[below + 1]:
        return ranked[below]
    if math.isinf(ranked[below]) or math.isinf(ranked[below + 1]):
        return ranked[below]
    return ranked[below] + part * (ranked[below + 1] - ranked[below])


def quartiles(values: list[float]) -> tuple[float, float, float]:
    """Lower quartile, median, upper quartile."""
    lower, median, upper = (quantile(values, share) for share in (0.25, 0.5, 0.75))
    return lower, median, upper


def margin(ours: float | None, peer: float | None) -> float:
    """By how much ours is above the peer's value, in per cent of the peer's; infinite where one has none."""
    if ours is None and peer is None:
        return 0.0
    if ours is None or peer is None:
        return -math.inf if ours is None else math.inf
    return 100.0 * (ours - peer) / abs(peer)


def percent(value: float, signed: bool = False, sides: tuple[str, str] = ("ours", "theirs")) -> str:
    """A percentage to read; where it is infinite, which of two sides meets all."""
    if math.isinf(value):
        return f"only {sides[0 if value > 0.0 else 1]} meets all"
    return f"{value:+.2f}" if signed else f"{value:.2f}"


def gain(value: float) -> str:
    """A share in per cent, or that requirements are not met."""
    return "unmet" if math.isinf(value) else f"{100.0 * value:.3f}"


def summary(values: list[float | None], best: float | None) -> dict[str, Any]:
    """Median and worst value, spread over seeds in per cent of the median, distance of the median from the best."""
    ranked = [number(value) for value in values]
    middle, worst, top = quantile(ranked, 0.5), min(ranked), max(ranked)
    spread = None if math.isinf(worst) else 100.0 * (top - worst) / abs(middle)
    distance = None if best is None or math.isinf(middle) else 100.0 * (best - middle) / abs(best)
    return {"median": middle, "worst": worst, "spread": spread, "distance": distance,
            "met": sum(value is not None for value in values), "seeds": len(values)}


def own_row(name: str, values: list[float | None], seconds: list[float], best: float | None) -> str:
    """A row of the first table: a method of this project's own."""
    found = summary(values, best)
    cells = [name, gain(found["median"]), gain(found["worst"])]
    cells += ["–" if found[key] is None else percent(found[key]) for key in ("spread", "distance")]
    cells += [f"{found['met']} of {found['seeds']}", f"{quantile(seconds, 0.5):.1f}"]
    return f"| {' | '.join(cells)} |"


def peer_row(name: str, ours: dict[int, float | None], peer: dict[int, float | None],
             seconds: list[float], placements: str) -> str:
    """A row of the second table: margins of ours over a peer at equal seeds."""
    margins = [margin(ours[seed], peer[seed]) for seed in sorted(ours) if seed in peer]
    values = [number(value) for value in peer.values()]
    ahead = sum(value > 0.0 for value in margins)
    cells = [name, gain(quantile(values, 0.5)), percent(quantile(margins, 0.5), True),
             percent(min(margins), True), f"{ahead} of {len(margins)}", placements,
             f"{quantile(seconds, 0.5):.1f}"]
    return f"| {' | '.join(cells)} |"


def more_row(title: str, fewer: int, more: int, pairs: dict[int, tuple[float | None, float | None]]) -> str:
    """A row of the table of evaluations: values by seed of runs of fewer and of more."""
    margins = {seed: margin(b, a) for seed, (a, b) in pairs.items()}
    lost = [str(seed) for seed, by in margins.items() if by < 0.0]
    sides = (str(more), str(fewer))
    ends = [percent(by, True, sides) for by in (quantile(list(margins.values()), 0.5), min(margins.values()))]
    seeds = f"{len(lost)} of {len(margins)}" + (f": {', '.join(lost)}" if lost else "")
    return f"| {' | '.join([title, f'{more} against {fewer}', *ends, seeds])} |"


def variant_row(title: str, relative: str, fair: str, pairs: dict[int, tuple[float | None, float | None]]) -> str:
    """A row of the table of variants: values by seed of the variant, and of its relative's placement."""
    medians = [gain(quantile([number(pair[side]) for pair in pairs.values()], 0.5)) for side in (0, 1)]
    margins, sides = [margin(*pair) for pair in pairs.values()], ("the variant", "its relative")
    ends = [percent(by, True, sides) for by in (quantile(margins, 0.5), min(margins))]
    behind = f"{sum(by < 0.0 for by in margins)} of {len(margins)}"
    return f"| {' | '.join([title, medians[0], f'{relative}, {fair}', medians[1], *ends, behind])} |"


OWN_HEAD = """| search | median | worst | spread, % | from the best known, % | all met | CPU s |
|---|--:|--:|--:|--:|--:|--:|"""
PEER_HEAD = """| peer | its median | margin of ours, median, % | worst seed, % | ours ahead | cast × frames | CPU s |
|---|--:|--:|--:|--:|--:|--:|"""


def section(key: str, title: str, best: float | None, own: list[str], compared: str, rivals: list[str]) -> str:
    """Part of the table for one problem."""
    known = "none" if best is None else f"{100.0 * best:.4f} %"
    picture = f"![Near gain of {title} against work and CPU seconds, with quartiles over seeds]({key}.svg)"
    lines = [f"## {title}", "", f"Best known near gain: {known}.", "", picture, "", OWN_HEAD, *own, ""]
    if rivals:
        lines += [f"Margins of {compared}:", "", PEER_HEAD, *rivals, ""]
    return "\n".join(lines)


MORE = """## More evaluations against fewer

Gain of a run over the run of the same seed with fewer evaluations, in per cent of the latter's value.

| problem | evaluations | median, % | worst seed, % | seeds that lost |
|---|---|--:|--:|---|
"""
VARIANTS = """## Variants beside their plain relatives

{count} evaluations. The relative's placement is the result of `optimize` without the option, with as many evaluations and
the same seed. It is brought under the rules of the variant and scored for its question, which the variant searched for.

| variant | its median | relative's placement | median of that | difference, median, % | worst seed, % | seeds behind |
|---|--:|---|--:|--:|--:|--:|
"""
INTRODUCTION = """# Benchmark of searches

Near gain in per cent, over all frames; {seeds}. *unmet*: a requirement, guard or rule is not kept. Spread is the best
seed's value less the worst's, in per cent of the median. A margin above zero says that ours is better at the same seed.
Our CPU seconds are the whole program's, with P-SOG, bound, confirmation and page; a peer's are its search's, with the
scores. A curve begins where three of four seeds keep everything.
"""
