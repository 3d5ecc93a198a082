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

#: Scores whose first choices are drawn, of ``variants.CHOOSING``.
CHOICES = ("near_gain", "information_gain", "m_sog_scaled", "mean_height")

#: Colours of what is drawn side by side in a line, by the end of its name.
_ORANGE, _BLUE, _GREY = "#dd6b20", "#2b6cb0", "#718096"
TRAINED = {", trained in clear air": _ORANGE, ", trained in it": _BLUE}


def of(page: Any, effects: dict[str, Any]) -> bool:
    """Draws variants or what was searched elsewhere on a page of matplotlib; whether there is either."""
    variants, transfer = effects["variants"], effects["transfer"]
    if variants:
        first = next(iter(variants))
        chosen = {name: of["chosen"]["scores"] for name, of in variants.items() if of.get("chosen")}
        upper, lower = page.subfigures(2, 1) if chosen else (page, None)
        if _counts(variants):
            _curves(upper, variants, first)
        else:
            _changes(upper, variants, first)
        if chosen:
            _choices(lower, chosen, first)
    elif transfer:
        found = {name.removeprefix("best-of-"): {m: by["all"] for m, by in of.items()} for name, of in transfer.items()}
        _dots(page, found, _titled(found), "difference from Ours-seg", {})
    return bool(variants or transfer)


def _counts(variants: dict[str, Any]) -> bool:
    """Whether every variant is named after a number."""
    return all(name.partition("-")[0].isdecimal() for name in variants)


def _changes(page: Any, variants: dict[str, Any], first: str) -> None:
    """What each variant has more than the first."""
    less = {name: {m: of["less_first"] for m, of in found["metrics"].items()} for name, found in variants.items() if name != first}
    titles = {m: f"{title}\n({variants[first]['metrics'][m]['mean']:.2f} in {first})" for m, title in _titled(less).items()}
    _dots(page, less, titles, f"difference from {first}", TRAINED)


def _choices(page: Any, chosen: dict[str, Any], first: str) -> None:
    """Regret of what scores put first, as the first variant has them and as the variant has them; of learners trained in it."""
    ends = {f", scored as in {first}": _ORANGE, ", scored as here": _BLUE}
    found = {}
    for name, scores in chosen.items():
        if name.endswith(", trained in clear air"):
            continue
        for end, how in zip(ends, ("as_first", "here")):
            of = {s: scores[s][how]["regret"] for s in CHOICES if how in scores.get(s, {})}
            if of:
                found[name.removesuffix(", trained in it") + end] = of
    titles = {s: f"first choice of {s}" for s in CHOICES if s in chosen[first]}
    _dots(page, found, titles, "regret: 0 the best, 1 the mean placement", ends, until=1.0)


def _titled(found: dict[str, Any]) -> dict[str, str]:
    return {m: title for m, title in DRAWN.items() if m in next(iter(found.values()))}


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


def _dots(
    page: Any, found: dict[str, Any], titles: dict[str, str], what: str, ends: dict[str, str], until: float = 0.0
) -> None:
    """A panel for each title and a line for each name; side by side those that differ only by ``ends``, each in its colour.

    Where nothing and ``until`` are stands a grey line.
    """

    def plain(name: str) -> str:
        for end in ends:
            name = name.removesuffix(end)
        return name

    names = list(dict.fromkeys(map(plain, found)))
    # Regrets are compared from panel to panel, metrics are not.
    spots = page.subplots(1, len(titles), squeeze=False, sharex=until > 0, sharey=True)[0]
    for spot, (key, title) in zip(spots, titles.items()):
        for name, of in found.items():
            if key not in of:
                continue
            one, end = of[key], name.removeprefix(plain(name))
            height = names.index(plain(name)) + (0.3 * list(ends).index(end) - 0.15 if end else 0)
            colour = ends.get(end, _BLUE)
            spot.plot([one["low"], one["high"]], [height, height], color=colour, linewidth=2)
            spot.plot(one["value"], height, "o", color=colour, markersize=4)
        for line in {0.0, until}:
            spot.axvline(line, color=_GREY, linewidth=0.8)
        spot.set_title(title, fontsize=9)
        spot.set_xlabel(what, fontsize=8)
        spot.tick_params(axis="x", labelsize=8)
        spot.locator_params(axis="x", nbins=5)
    for spot in spots:
        # What is no difference shall look like none.
        low, high = spot.get_xlim()
        spot.set_xlim(min(low, -0.05), max(high, 0.01))
    spots[0].set_yticks(range(len(names)), names)
    spots[0].invert_yaxis()
    if len(names) < len(found):
        for end, colour in ends.items():
            spots[0].plot([], [], "o-", color=colour, label=end.removeprefix(", "))
        page.legend(fontsize=8, ncols=len(ends), loc="outside lower center")
