"""Worth of a placement to a trained U-Net in a scene: its map on the fixed truth, and its objects."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..groups import GROUPS
from ..layouts import Layout
from ..metrics import segmentation, targets
from ..metrics.detection import NAMES, Objects, detection
from ..truth import KINDS, VISIBLE, Truth
from ..worlds import World
from . import points, shared, unet

#: Confidence from which a prediction counts for the recall, and metres within which it must be.
SURE, WITHIN = 0.3, 2.0

#: Most predictions of a frame, and the confidence that they must have; what is less sure adds nothing to the AP.
MOST, FAINT = 50, 0.02


def judge(world: World, truths: list[Truth], layout: Layout, seed: int, net: unet.Unet) -> dict[str, Any]:
    """``metrics`` and ``detail`` over the frames of a scene together, as of the trees.

    ``birds_eye_miou`` is over cells of the net's size. ``centre_recall`` is the share of the visible boxes that have a
    sure prediction of their kind close by, each taken once. ``centre_ap`` is nuScenes' mean AP over the kinds that are
    there, at any distance within the region. Its ``class_range`` is not applied.
    """
    grid = world.source().grid
    small = unet.coarse(grid, net.settings.cell)
    counts = np.zeros((len(GROUPS), len(GROUPS)), np.int64)
    wanted, found = [], []
    for frame, truth in zip(world.frames, truths, strict=True):
        xyz = points.met(world, frame, layout, truth.body, seed)
        groups, _, objects = net.predict(small, unet.image(small, xyz), most=MOST)
        counts += targets.birds_eye_confusion(unet.map_of(grid, truth, net.settings.cell), groups)
        wanted.append(_visible(truth))
        found.append(_sure(objects))
    metrics, detail = _objects(wanted, found)
    whole = segmentation.fixed(counts)
    by_class = {name: float(v) for name, v in zip(GROUPS, whole.by_class) if np.isfinite(v)}
    return {
        "metrics": {"birds_eye_miou": whole.mean, **metrics},
        "detail": {"iou_by_class_map": by_class, "chance_miou": shared.chance(counts), "objects": detail},
    }


def _visible(truth: Truth) -> Objects:
    kept = truth.points >= VISIBLE
    kinds = [KINDS[kind] for kind in truth.kind[kept]]
    return Objects(truth.centre[kept], truth.size[kept], truth.yaw[kept], kinds, np.ones(len(kinds)))


def _sure(found: Objects) -> Objects:
    kept = found.score >= FAINT
    kinds = [kind for kind, keep in zip(found.kind, kept) if keep]
    return Objects(found.centre[kept], found.size[kept], found.yaw[kept], kinds, found.score[kept])


def _objects(wanted: list[Objects], found: list[Objects]) -> tuple[dict[str, float], dict[str, Any]]:
    there = {kind: sum(frame.kind.count(kind) for frame in wanted) for kind in NAMES}
    if not any(there.values()):
        return {"centre_recall": np.nan, "centre_ap": np.nan}, {}
    judged = detection(wanted, found)
    hits = {kind: sum(_hits(a, b, kind) for a, b in zip(wanted, found)) for kind in there}
    ap = [float(np.mean(list(judged.ap[kind].values()))) for kind, count in there.items() if count]
    metrics = {"centre_recall": sum(hits.values()) / sum(there.values()), "centre_ap": float(np.mean(ap))}
    kinds = [kind for kind, count in there.items() if count]
    detail = {
        "found": {kind: [hits[kind], there[kind]] for kind in kinds},
        "ap": {kind: judged.ap[kind] for kind in kinds},
        "errors": {kind: judged.errors[kind] for kind in kinds},
    }
    return metrics, detail


def _hits(wanted: Objects, found: Objects, kind: str) -> int:
    """Boxes of a kind that a sure prediction, from the surest on, has nearest and near enough; each taken once."""
    left = [wanted.centre[k, :2] for k, name in enumerate(wanted.kind) if name == kind]
    count = len(left)
    for k in np.argsort(-found.score, kind="stable"):
        if found.kind[k] != kind or found.score[k] < SURE or not left:
            continue
        away = [float(np.hypot(*(found.centre[k, :2] - middle))) for middle in left]
        nearest = int(np.argmin(away))
        if away[nearest] < WITHIN:
            left.pop(nearest)
    return count - len(left)

