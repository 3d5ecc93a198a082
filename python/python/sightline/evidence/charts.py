"""Pictures of the studies of one question: what each variant has more than the first, or the published optimum."""

from __future__ import annotations

from typing import Any

#: Metrics that are drawn, and what a reader calls them.
DRAWN = {
    "voxel_1m_miou": "voxels within 1 m, mIoU",
    "birds_eye_miou": "bird's-eye map, mIoU",
    "objects_5": "objects, 5 points, share",
    "objects_20": "objects, 20 points, share",
    "ground_seen_10m": "ground within 10 m, share",
}

#: What follows the condition in the name of a variant, and its colour.
TRAINED = {", trained in clear air": "#dd6b20", ", trained in it": "#2b6cb0"}

_BLUE, _GREY = "#2b6cb0", "#718096"


def of(page: Any, effects: dict[str, Any]) -> bool:
    """Draws variants or what was searched elsewhere on a page of matplotlib; whether there is either."""
    variants, transfer = effects["variants"], effects["transfer"]
    if variants:
        first = next(iter(variants))
        rest = [name for name in variants if name != first]
        if all(name.partition("-")[0].isdecimal() for name in variants):
            _curves(page, variants, first)
        else:
            less = {name: {m: found["less_first"] for m, found in variants[name]["metrics"].items()} for name in rest}
            middle = {m: found["mean"] for m, found in variants[first]["metrics"].items()}
            _dots(page, less, {m: f"({middle[m]:.2f})" for m in middle}, f"difference from {first}")
    elif transfer:
        found = {name.removeprefix("best-of-"): {m: by["all"] for m, by in of.items()} for name, of in transfer.items()}
        _dots(page, found, {}, "difference from Ours-seg")
    return bool(variants or transfer)


def _curves(page: Any, variants: dict[str, Any], first: str) -> None:
    """Against the number that a variant begins with; intervals are those of the difference from the first."""
    numbers = [int(name.partition("-")[0]) for name in variants]
    metrics = [m for m in DRAWN if m in variants[first]["metrics"]]
    for spot, metric in zip(page.subplots(1, len(metrics), squeeze=False)[0], metrics):
        found = [of["metrics"][metric] for of in variants.values()]
        begin = found[0]["mean"]
        low, high = ([begin + one["less_first"][end] for one in found] for end in ("low", "high"))
        spot.fill_between(numbers, low, high, color=_BLUE, alpha=0.2, linewidth=0)
        spot.plot(numbers, [begin + one["less_first"]["value"] for one in found], "o-", color=_BLUE)
        spot.set_xscale("log", base=2)
        spot.set_xticks(numbers, [str(number) for number in numbers])
        spot.set_xlabel(first.partition("-")[2])
        # All are shares.
        spot.set_ylim(0, min(max(1.15 * max(high), 1e-9), 1))
        spot.set_title(DRAWN[metric], fontsize=9)


def _dots(page: Any, found: dict[str, Any], beneath: dict[str, str], what: str) -> None:
    """A line for each name, and side by side those that differ only by ``TRAINED``."""
    names = list(dict.fromkeys(_untrained(name) for name in found))
    metrics = [m for m in DRAWN if m in next(iter(found.values()))]
    spots = page.subplots(1, len(metrics), squeeze=False, sharey=True)[0]
    for spot, metric in zip(spots, metrics):
        for name, of in found.items():
            one, plain = of[metric], _untrained(name)
            height = names.index(plain) + (0.15 if name.endswith(", trained in it") else -0.15 if name != plain else 0)
            colour = TRAINED.get(name.removeprefix(plain), _BLUE)
            spot.plot([one["low"], one["high"]], [height, height], color=colour, linewidth=2)
            spot.plot(one["value"], height, "o", color=colour, markersize=4)
        spot.axvline(0, color=_GREY, linewidth=0.8)
        # What is no difference shall look like none.
        low, high = spot.get_xlim()
        spot.set_xlim(min(low, -0.05), max(high, 0.01))
        spot.set_title(DRAWN[metric], fontsize=9)
        spot.set_xlabel(f"{what} {beneath.get(metric, '')}".strip(), fontsize=8)
        spot.tick_params(axis="x", labelsize=8)
        spot.locator_params(axis="x", nbins=5)
    spots[0].set_yticks(range(len(names)), names)
    spots[0].invert_yaxis()
    if len(names) < len(found):
        for ending, colour in TRAINED.items():
            spots[0].plot([], [], "o-", color=colour, label=ending.removeprefix(", "))
        page.legend(fontsize=8, ncols=len(TRAINED), loc="outside lower center")


def _untrained(name: str) -> str:
    for ending in TRAINED:
        name = name.removesuffix(ending)
    return name
