"""Average precision against a second reading of the rule, and where the devkit's words end."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("nuscenes.eval.detection.algo", reason="nuscenes-devkit is not installed")
from sightline_evidence.metrics.detection import DISTANCES, Objects, detection


def drawn(rng: np.random.Generator, count: int, like: Objects | None = None) -> Objects:
    kinds = ["vehicle", "pedestrian", "cyclist"]
    if like is None:
        return Objects(
            np.c_[rng.uniform(-30, 30, (count, 2)), np.ones(count)],
            rng.uniform(0.5, 5, (count, 3)),
            rng.uniform(-3, 3, count),
            list(rng.choice(kinds, count)),
            np.ones(count),
        )
    spread = rng.choice([0.2, 1.0, 3.0])
    noise = np.c_[rng.normal(0, spread, (len(like.kind), 2)), np.zeros(len(like.kind))]
    sizes = like.size * rng.uniform(0.8, 1.2, like.size.shape)
    return Objects(like.centre + noise, sizes, like.yaw + 0.1, like.kind, np.round(rng.random(len(like.kind)), 1))


def by_the_letter(truth: list[Objects], predicted: list[Objects], kind: str, within: float) -> float:
    """Section 2 of the rule with NumPy: rank, match the nearest untaken, 101 recalls, clip."""
    total = sum(frame.kind.count(kind) for frame in truth)
    rows = [
        (float(frame.score[b]), number, b)
        for number, frame in enumerate(predicted)
        for b in range(len(frame.kind))
        if frame.kind[b] == kind
    ]
    order = sorted(range(len(rows)), key=lambda i: (rows[i][0], i), reverse=True)
    taken: set[tuple[int, int]] = set()
    hits = []
    for i in order:
        _, number, b = rows[i]
        free = [
            (float(np.hypot(*(truth[number].centre[g, :2] - predicted[number].centre[b, :2]))), g)
            for g in range(len(truth[number].kind))
            if truth[number].kind[g] == kind and (number, g) not in taken
        ]
        best = min(free, default=(np.inf, -1))
        hits.append(best[0] < within)
        if hits[-1]:
            taken.add((number, best[1]))
    if not total or not any(hits):
        return 0.0
    right = np.cumsum(hits)
    precision = np.interp(np.linspace(0, 1, 101), right / total, right / np.arange(1, len(hits) + 1), right=0)
    return float(np.mean(np.maximum(precision[11:] - 0.1, 0)) / 0.9)


def test_two_hundred_random_sets() -> None:
    for seed in range(200):
        rng = np.random.default_rng(seed)
        truth = [drawn(rng, int(rng.integers(0, 12))) for _ in range(3)]
        predicted = [drawn(rng, 0, frame) for frame in truth]
        found = detection(truth, predicted)
        for kind, ap in found.ap.items():
            for within in DISTANCES:
                assert ap[str(within)] == pytest.approx(by_the_letter(truth, predicted, kind, within), abs=1e-12)


def test_errors_of_a_known_offset() -> None:
    rng = np.random.default_rng(1)
    truth = [drawn(rng, 30) for _ in range(4)]
    moved = [
        Objects(f.centre + np.array([0.36, 0.48, 0]), f.size * [0.5, 1, 1], f.yaw + 0.2, f.kind, f.score) for f in truth
    ]
    # Far enough apart that each takes its own.
    spread = [Objects(f.centre * 20, f.size, f.yaw, f.kind, f.score) for f in truth]
    moved = [
        Objects(s.centre + np.array([0.36, 0.48, 0]), m.size, m.yaw, m.kind, m.score)
        for s, m in zip(spread, moved, strict=True)
    ]
    found = detection(spread, moved)
    for kind in ("vehicle", "pedestrian", "cyclist"):
        assert found.errors[kind]["trans_err"] == pytest.approx(0.6, abs=1e-9)
        assert found.errors[kind]["scale_err"] == pytest.approx(0.5, abs=1e-9)
        assert found.errors[kind]["orient_err"] == pytest.approx(0.2, abs=1e-9)
        assert found.ap[kind]["0.5"] == 0.0 and found.ap[kind]["1.0"] == pytest.approx(1.0)


def test_frames_must_be_the_same() -> None:
    with pytest.raises(ValueError, match="same frames"):
        detection([], [drawn(np.random.default_rng(0), 2)])
