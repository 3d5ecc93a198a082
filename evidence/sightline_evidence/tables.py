"""A study's result as Markdown."""

from __future__ import annotations

from typing import Any

#: Metrics that a reader sees first; the rest is in ``result.json``.
SHOWN = ("voxel_miou", "voxel_1m_miou", "birds_eye_miou", "objects_5", "ground_seen_10m", "own_miou", "unet_birds_eye_miou")


#: Effects that are differences from one placement: name, title, what stands in the first column.
DIFFERENCES = (
    ("sensors", "Other LiDARs of about as many points at the poses of Ours-seg, less the study's own", "LiDAR"),
    ("low", "Two of four low, less Ours-seg", "placement"),
    ("phases", "A quarter of an azimuth step apart, less in step", "placement"),
)


def tables(result: dict[str, Any]) -> str:
    """The rule's choice, regret, correlation of each pool, optima, effects, checks, placements."""
    parts = [f"# Evidence, {result['plan']['design']} run\n\nPlan {result['plan_sha256']}.\n"]
    if result["missing_units"]:
        parts.append(f"\n**{missing(result['missing_units'])}.**\n")
    for name, pool in result["pools"].items():
        parts.append(f"\n## {name} ({pool['placements']} placements)\n")
        parts += [_verdict(pool["regret"]), _regret(pool["regret"]), _correlation(pool), _optima(pool["regret"])]
    parts.append(_poses(result["effects"]["poses"]))
    for name, title, what in DIFFERENCES:
        parts.append(_differences(result["effects"][name], title, what))
    parts.append(_needed(result["effects"]["needed"]))
    parts += [_to_win(result["effects"]["to_win"]), _places(result["effects"]["places"])]
    parts.append(_parts(result["parts"]))
    parts += [_more(result["checks"]["one_more_lidar"]), _agreement(result["agreement"])]
    parts.append("\n## Checks\n\n" + "".join(f"- {line}\n" for line in _checks(result["checks"])))
    return "".join([*parts, _placements(result["placements"])])


def missing(units: list[str]) -> str:
    """How many units are missing, by seed, and which if they are few."""
    if not units:
        return "No unit is missing"
    seeds = [unit.rpartition("-")[2] for unit in units]
    by_seed = ", ".join(f"{seeds.count(seed)} of seed {seed}" for seed in sorted(set(seeds)))
    named = f": {', '.join(units)}" if len(units) <= 12 else ""
    return f"{len(units)} units are missing, {by_seed}{named}"


def _verdict(regret: dict[str, Any]) -> str:
    said = regret["verdict"]
    text = f"\nLeast mean regret over {', '.join(regret['metrics'])}: `{said['least_mean_regret']}`."
    if "becomes_default" in said:
        text += f" By the rule it {'becomes' if said['becomes_default'] else 'does not become'} the default: {said['why']}."
    if said.get("least_of_engine"):
        text += f" Of what the engine maximizes, `{said['least_of_engine']}` loses least."
    return text + "\n"


def _regret(regret: dict[str, Any]) -> str:
    metrics = regret["metrics"]
    rows = sorted(regret["scores"].items(), key=lambda item: item[1]["mean"]["value"])
    text = "\nRegret of the placement that a score puts first, mean over scenes [95 %, over placements and scenes]; 0 the best, 1 the "
    text += "mean of the placements.\n\n"
    about = list(rows[0][1]["about"])
    text += head(["score", "mean", "less than the gain", *(f"mean: {name}" for name in about), *metrics])
    for name, of in rows:
        means = [interval(of["mean"]), interval(of["less_than_gain"]), *(interval(of["about"][group]) for group in about)]
        text += row([f"`{name}`", *means, *(number(of["by_metric"][m]["value"]) for m in metrics)])
    return text


def _correlation(pool: dict[str, Any]) -> str:
    metrics = [m for m in SHOWN if m in pool["metrics"]]
    scores = list(next(iter(pool["metrics"].values()))["scores"])
    text = "\nSpearman with the metric [95 %, over placements and scenes]; in brackets given mean height, given beams that hit.\n\n"
    text += head(["score", *metrics])
    for score in scores:
        found = [pool["metrics"][m]["scores"][score] for m in metrics]
        text += row([f"`{score}`", *(_rho(one) for one in found)])
    ceilings = [pool["metrics"][m]["noise_ceiling"] for m in metrics]
    return text + row(["noise ceiling", *map(number, ceilings)])


def _rho(found: dict[str, Any]) -> str:
    given = (number(found[f"partial_given_{what}"]["value"]) for what in ("height", "hits"))
    return f"{interval(found['spearman'])} ({', '.join(given)})"


def _optima(regret: dict[str, Any]) -> str:
    if not regret["optima"]:
        return ""
    metrics = regret["metrics"]
    text = "\nOptima, mean over those of a score, less the published `Ours-seg` and less the best made by hand, on the test scenes "
    text += "[95 %, over scenes and seeds]; regret first: above 0 the optimum loses less.\n\n" + head(["searched with", "against", "regret", *metrics])
    for score, of in regret["optima"].items():
        for other, less in of["less_regret_than"].items():
            each = [of["metrics"][m].get(f"minus {other}") for m in metrics]
            text += row([f"`{score}`", other, interval(less), *(interval(one, 3) if one else "" for one in each)])
    return text


def _poses(effects: dict[str, Any]) -> str:
    if not effects:
        return ""
    names = list(next(iter(effects.values())))
    text = "\n## Height, spread and roll of four in the mount\n\nStandard deviations of the metric a standard deviation of the "
    text += "quantity, all four at once [95 %, over placements].\n\n" + head(["metric", *names])
    return text + "".join(row([m, *(interval(of[name]) for name in names)]) for m, of in effects.items())


def _differences(effects: dict[str, Any], title: str, what: str) -> str:
    if not effects:
        return ""
    metrics = list(next(iter(effects.values())))
    text = f"\n## {title} [95 %, over scenes and seeds]\n\n" + head([what, *metrics])
    return text + "".join(row([name, *(interval(of[m], 3) for m in metrics)]) for name, of in effects.items())


def _needed(effects: dict[str, Any]) -> str:
    if not effects:
        return ""
    text = "\n## Scenes that tell two placements in the mount apart by .01 (80 % power)\n\n"
    text += head(["metric", "spread of a difference between scenes", "scenes"])
    return text + "".join(row([m, number(of["spread"], 3), f"{of['scenes']:.0f}"]) for m, of in effects.items())


def _to_win(effects: dict[str, Any]) -> str:
    if not effects:
        return ""
    columns = list(dict.fromkeys(name for of in effects.values() for name in of))
    text = "\n## What there is to win: chosen on the first seed, judged by the others in the same scenes (optimistic), less Ours-seg [95 %, over scenes and seeds]\n\n"
    text += head(["", *columns])
    for name, of in effects.items():
        text += row([name, *(f"{interval(of[c], 3)} (`{of[c]['placement']}`)" for c in columns)])
    return text


def _places(effects: dict[str, Any]) -> str:
    if not effects:
        return ""
    text = "\n## Scenes by where they come from: regret of a score; of its optima less Ours-seg [95 %, over scenes]\n\n"
    text += head(["score", *(f"{len(of['scenes'])} {origin}" for origin, of in effects.items())])
    for score in next(iter(effects.values()))["optima"]:
        text += row([f"`{score}`", *(f"{interval(of['regret'][score])}; {interval(of['optima'][score])}" for of in effects.values())])
    return text


def _parts(parts: dict[str, Any]) -> str:
    if not parts:
        return ""
    text = "\n## By class, distance and kind\n\n`Ours-seg`, and what others have more; means over scenes [95 %, over scenes]. "
    text += "Of the ECE less is better.\n\n"
    text += head(["", "Ours-seg", *parts["placements"]])
    for what, rows in parts["parts"].items():
        for name, columns in rows.items():
            text += row([f"{what}: {name}", *(interval(found, 3) for found in columns.values())])
    return text


def _more(steps: dict[str, Any]) -> str:
    if not steps:
        return ""
    count = max(len(of["means"]) for of in steps.values())
    text = "\n## One to six LiDARs, each with all of the one before; step [95 %, over scenes and seeds]\n\n"
    text += head(["metric", "1", *(f"{k} → {k + 1}" for k in range(1, count))])
    return text + "".join(
        row([m, number(of["means"][0], 3), *(interval(step, 3) for step in of["steps"])]) for m, of in steps.items()
    )


def _agreement(agreement: dict[str, Any]) -> str:
    if not agreement:
        return ""
    text = "\n## Do learners agree?\n\nSpearman of the trees' bird's-eye mIoU with [95 %, over placements and scenes].\n\n"
    text += head(["with, among", "placements", "Spearman", "Kendall"])
    return text + "".join(row([m, str(of["of"]), interval(of), number(of["kendall"])]) for m, of in agreement.items())


def _checks(checks: dict[str, Any]) -> list[str]:
    lines = []
    if labels := checks.get("shuffled-labels"):
        lines.append(
            f"mIoU on own points with right labels {number(labels['right'], 3)}, with shuffled ones "
            f"{number(labels['shuffled'], 3)}, chance {number(labels['chance'], 3)}"
        )
    if curve := checks.get("learning-curve"):
        grown = ", ".join(f"{number(m, 3)} from {s}" for s, m in zip(curve["scenes"], curve["own_miou"]))
        lines.append(f"mIoU on own points by number of training scenes: {grown}")
    last = ", ".join(f"{m} {'yes' if is_last else 'no'}" for m, is_last in checks["gamed_rank_last"].items())
    lines.append(f"gamed placements rank last: {last or 'none there'}")
    random = ", ".join(f"{pool} {'yes' if holds else 'no'}" for pool, holds in checks["shuffled_is_random"].items())
    lines.append(f"interval of the regret of `shuffled` holds 1: {random or 'none there'}")
    lines.append(f"learners not better than the commonest group: {', '.join(checks['learnt']['not_learnt']) or 'none'}")
    if second := checks["second_learner"]:
        told = second if isinstance(second, str) else ", ".join(f"{key} {value}" for key, value in second.items())
        lines.append(f"second learner: {told}")
    return lines


def _placements(placements: list[dict[str, Any]]) -> str:
    metrics = [m for m in SHOWN if any(m in p["metrics"] for p in placements)]
    ranked = sorted(placements, key=lambda p: -(p["metrics"]["voxel_1m_miou"] or 0))
    text = "\n## Placements, by what voxels within 1 m are taken for\n\n" + head(["placement", "pool", "seeds", *metrics])
    return text + "".join(
        row([p["name"], p["pool"], str(len(p["seeds"])), *(number(p["metrics"].get(m), 3) for m in metrics)]) for p in ranked
    )


def interval(found: dict[str, float], digits: int = 2) -> str:
    """``value [low high]``."""
    return f"{number(found['value'], digits)} [{number(found['low'], digits)} {number(found['high'], digits)}]"


def number(value: float | None, digits: int = 2) -> str:
    """With a true minus; a dash for nothing."""
    return "–" if value is None or value != value else f"{value:.{digits}f}".replace("-", "−")


def head(cells: list[str]) -> str:
    """First line of a table, and the one below."""
    return row(cells) + "|" + "---|" * len(cells) + "\n"


def row(cells: list[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(cells)} |\n"
