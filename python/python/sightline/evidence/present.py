"""Tables in Markdown and one figure of a study's result."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

#: What a reader sees first; the rest is in ``result.json``.
SHOWN = ("voxel_miou", "voxel_1m_miou", "birds_eye_miou", "objects_5", "ground_seen_10m", "own_miou")


def write(result: dict[str, Any], out: Path) -> None:
    """``tables.md`` and ``figure.svg`` in ``out``."""
    _whole(out / "tables.md", tables(result).encode())
    _whole(out / "figure.svg", figure(result))


def _whole(path: Path, content: bytes) -> None:
    beside = path.with_name(f"{path.name}.tmp")
    beside.write_bytes(content)
    os.replace(beside, path)


def tables(result: dict[str, Any]) -> str:
    """Correlation and regret of each pool, the checks, the placements."""
    parts = [f"# Evidence, {result['plan']['design']} run\n\nPlan {result['plan_sha256']}.\n"]
    for name, pool in result["pools"].items():
        metrics = [m for m in SHOWN if m in pool["metrics"]]
        parts.append(f"\n## {name} ({pool['placements']} placements)\n")
        parts.append("\nSpearman with the metric [95 %, over placements and scenes]; in brackets given mean height.\n\n")
        parts.append(_head(["score", *metrics]))
        parts += [_row([f"`{s}`", *(_rho(pool, m, s) for m in metrics)]) for s in _scores(pool)]
        parts.append(_row(["noise ceiling", *(_number(pool["metrics"][m]["noise_ceiling"]) for m in metrics)]))
        parts.append("\nRegret, mean over scenes [95 %, over scenes]; 0 the best placement, 1 a random one.\n\n")
        parts.append(_head(["score", *metrics]))
        parts += [_row([f"`{s}`", *(_interval(pool["metrics"][m]["scores"][s]["regret"]) for m in metrics)]) for s in _scores(pool)]
    parts.append("\n## Checks\n\n" + "".join(f"- {line}\n" for line in _checks(result["checks"])))
    parts.append("\n## Placements, by what voxels within 1 m are taken for\n\n" + _head(["placement", "pool", *SHOWN]))
    ranked = sorted(result["placements"], key=lambda p: -(p["metrics"]["voxel_1m_miou"] or 0))
    parts += [_row([p["name"], p["pool"], *(_number(p["metrics"][m], 3) for m in SHOWN)]) for p in ranked]
    return "".join(parts)


def _checks(checks: dict[str, Any]) -> list[str]:
    labels, curve = checks["shuffled-labels"], checks["learning-curve"]
    grown = ", ".join(f"{m:.3f} from {s}" for s, m in zip(curve["scenes"], curve["own_miou"]))
    failed = ", ".join(checks["learnt"]["not_learnt"]) or "none"
    last = ", ".join(f"{m} {'yes' if is_last else 'no'}" for m, is_last in checks["gamed_rank_last"].items())
    more = checks["one_more_lidar"].get("voxel_1m_miou", [])
    return [
        f"mIoU on own points with right labels {labels['right']:.3f}, with shuffled ones {labels['shuffled']:.3f}, chance {labels['chance']:.3f}",
        f"mIoU on own points by number of training scenes: {grown}",
        f"gamed placements rank last: {last or 'none there'}",
        f"voxels within 1 m, one to {len(more)} LiDARs: {', '.join(f'{m:.3f}' for m in more)}",
        f"learners not better than the commonest group: {failed}",
    ]


def _scores(pool: dict[str, Any]) -> list[str]:
    return list(next(iter(pool["metrics"].values()))["scores"])


def _rho(pool: dict[str, Any], metric: str, score: str) -> str:
    found = pool["metrics"][metric]["scores"][score]
    return f"{_interval(found['spearman'])} ({_number(found['partial_given_height'])})"


def _interval(found: dict[str, float]) -> str:
    return f"{_number(found['value'])} [{_number(found['low'])} {_number(found['high'])}]"


def _number(value: float | None, digits: int = 2) -> str:
    return "–" if value is None or value != value else f"{value:.{digits}f}".replace("-", "−")


def _head(cells: list[str]) -> str:
    return _row(cells) + "|" + "---|" * len(cells) + "\n"


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |\n"


def figure(result: dict[str, Any]) -> bytes:
    """SVG: for three scores, each placement's score against what the learner makes of it; gamed ones marked."""
    import io

    import matplotlib
    from matplotlib.figure import Figure

    colours = {"box": "#2b6cb0", "mixed": "#2f855a", "number": "#a0aec0", "gamed": "#c53030"}
    chosen = ("information_gain", "m_sog_scaled", "mean_height")
    shown = ("voxel_1m_miou", "birds_eye_miou")
    page = Figure(figsize=(11, 6.4), layout="constrained")
    axes = page.subplots(len(shown), len(chosen), sharey="row")
    pool = result["pools"].get("four in the mount")
    for row, metric in enumerate(shown):
        for column, score in enumerate(chosen):
            spot = axes[row][column]
            for name, colour in colours.items():
                points = [
                    (_mean(p["scores"][score]), p["metrics"][metric])
                    for p in result["placements"]
                    if p["pool"] == name and p["metrics"][metric] is not None
                ]
                if points:
                    spot.scatter(*zip(*points), s=16, color=colour, label=name)
            if pool:
                found = pool["metrics"][metric]["scores"][score]["spearman"]
                spot.set_title(f"ρ {_interval(found)}, box only", fontsize=9)
            spot.set_xlabel(score)
            if not column:
                spot.set_ylabel(metric)
    axes[0][0].legend(fontsize=8)
    page.suptitle(f"{result['plan']['design']}: {len(result['placements'])} placements, fixed targets, boosted trees")
    written = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "sightline"}):
        page.savefig(written, format="svg", metadata={"Date": None})
    return written.getvalue()


def _mean(values: list[float | None]) -> float:
    there = [value for value in values if value is not None]
    return sum(there) / len(there) if there else float("nan")
