"""One placement through the trees: scans, training, and every metric in every test scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

import sightline

from ._types import F32, F64, I64, U8, Bools
from .grid import Grid
from .groups import GROUND, GROUPS, groups_of
from .layouts import Layout
from .learners import trees
from .metrics import objects, segmentation, targets
from .metrics.calibration import calibration
from .truth import KINDS, VISIBLE, Truth, points_on
from .worlds import World

#: Metrics that rank placements; larger is better.
METRICS = (
    "voxel_miou",
    "voxel_1m_miou",
    "birds_eye_miou",
    "objects_5",
    "objects_20",
    "ground_seen_3m",
    "ground_seen_10m",
    "own_miou",
    "own_miou_semantickitti",
)

#: Metres from its middle within which a target voxel may be known from another one.
REACH = 1.0

#: Metres from the body within which ground counts as near.
NEAR = (3, 10)


class Learner(Protocol):
    """Whatever names the groups of points."""

    @property
    def curve(self) -> list[float]:
        """How its loss fell."""

    def predict(self, frame: Frame) -> tuple[U8, F32]:
        """Groups ``[P]`` of a frame's points, and how sure it is ``[P]``."""


@dataclass(frozen=True)
class Frame:
    """A placement's scan of one frame; its own body left out."""

    xyz: F64
    labels: U8
    #: Points by actor's instance.
    points: dict[int, int]


def frames_of(world: World, layout: Layout, seed: int) -> list[Frame]:
    """Scans of the frames of a scene, with their noise drawn by the seed."""
    scene = world.scene(layout.lidar)
    scans = scene.scan(layout.placement(), seed=seed, frames=world.frames)
    return [_frame(scan) for scan in scans]


def _frame(scan: sightline.Scan) -> Frame:
    others = scan.instance != 65535
    boxes = scan.boxes.instance.astype(np.int64)
    points = dict(zip(boxes.tolist(), points_on(scan, boxes).tolist()))
    return Frame(scan.xyz[others].astype(np.float64), groups_of(scan.classes, scan.class_id[others]), points)


def sampled(scans: list[Frame], most: int, seed: int) -> tuple[F32, U8]:
    """Features ``[P, F]`` and groups ``[P]`` of about ``most`` labelled points, drawn before they are described."""
    labelled = [np.flatnonzero(scan.labels) for scan in scans]
    share = min(1.0, most / max(sum(map(len, labelled)), 1))
    rng = np.random.default_rng([seed, 2])
    kept = [np.sort(rng.permutation(of)[: math.ceil(share * len(of))]) for of in labelled]
    described = [trees.features(scan.xyz, of) for scan, of in zip(scans, kept)]
    return np.concatenate(described), np.concatenate([scan.labels[of] for scan, of in zip(scans, kept)])


@dataclass(frozen=True)
class OnPoints:
    """Trees as a learner of frames."""

    trees: trees.Trees

    @property
    def curve(self) -> list[float]:
        """How its loss fell."""
        return self.trees.curve

    def predict(self, frame: Frame) -> tuple[U8, F32]:
        """Groups ``[P]`` of a frame's points, and how sure it is ``[P]``."""
        return self.trees.predict(trees.features(frame.xyz))


def learn(scans: list[Frame], seed: int, settings: trees.Settings) -> OnPoints | None:
    """Trees on these frames; ``None`` where a placement sees too little to learn from."""
    described, labels = sampled(scans, settings.points, seed)
    return OnPoints(trees.train(described, labels, seed, settings)) if len(np.unique(labels)) > 1 else None


def judge(world: World, truths: list[Truth], scans: list[Frame], learner: Learner | None) -> dict[str, Any]:
    """Metrics of a placement in a test scene, over its frames together: ``metrics`` to rank by, and ``detail``."""
    grid = world.source().grid
    counts = {name: np.zeros((len(GROUPS), len(GROUPS)), np.int64) for name in ("own", "voxel", "voxel_1m", "map")}
    rings = np.zeros((len(targets.RINGS) - 1, len(GROUPS), len(GROUPS)), np.int64)
    overhead = np.zeros_like(counts["own"])
    sure: list[F32] = []
    right: list[Bools] = []
    for truth, scan in zip(truths, scans, strict=True):
        predicted, confidence = (
            learner.predict(scan) if learner else (np.zeros(0, np.uint8), np.zeros(0, np.float32))
        )
        xyz = scan.xyz if learner else scan.xyz[:0]
        if learner:
            labelled = scan.labels > 0
            counts["own"] += segmentation.confusion(scan.labels[labelled], predicted[labelled], len(GROUPS))
            sure.append(confidence[labelled])
            right.append((predicted == scan.labels)[labelled])
        seen = targets.seen_as(grid, truth.keys, xyz, predicted)
        reached = targets.seen_as(grid, truth.keys, xyz, predicted, REACH)
        counts["voxel"] += segmentation.confusion(truth.labels, seen, len(GROUPS))
        counts["voxel_1m"] += segmentation.confusion(truth.labels, reached, len(GROUPS))
        counts["map"] += targets.birds_eye_confusion(
            targets.birds_eye(grid, truth.keys, truth.labels), targets.birds_eye(grid, truth.keys, reached)
        )
        rings += np.array(targets.by_ring(grid, truth.keys, truth.labels, reached))
        high = ~targets.beneath(grid, truth.keys)
        overhead += segmentation.confusion(truth.labels[high], reached[high], len(GROUPS))
    # A placement that meets nothing has no points to be right or wrong on.
    is_labelled = any(len(one) for one in sure)
    metrics = {
        "voxel_miou": segmentation.fixed(counts["voxel"]).mean,
        "voxel_1m_miou": segmentation.fixed(counts["voxel_1m"]).mean,
        "birds_eye_miou": segmentation.fixed(counts["map"]).mean,
        "own_miou": segmentation.nuscenes(counts["own"]).mean,
        "own_miou_semantickitti": segmentation.semantickitti(counts["own"]).mean if is_labelled else np.nan,
    }
    found, ground = _objects(truths, scans), _ground(grid, truths, scans)
    detail = {
        "iou_by_class_1m": _named(segmentation.fixed(counts["voxel_1m"]).by_class),
        "iou_by_class_own": _named(segmentation.nuscenes(counts["own"]).by_class),
        "miou_by_ring_1m": [segmentation.fixed(ring).mean for ring in rings],
        "miou_overhead_1m": segmentation.fixed(overhead).mean,
        "share_of_voxels_seen": float(1 - counts["voxel"][1:, 0].sum() / max(counts["voxel"][1:].sum(), 1)),
        "ece_15_bins": calibration(np.concatenate(sure), np.concatenate(right)).error if is_labelled else np.nan,
        "chance_miou": chance(counts["own"]),
        "objects": found["detail"],
        "blind_ground_m2": ground["detail"],
    }
    return {"metrics": {**metrics, **found["metrics"], **ground["metrics"]}, "detail": detail}


def chance(own: I64) -> float:
    """mIoU of always naming the commonest group, on the points of a confusion ``[truth, predicted]``."""
    truth = own.sum(axis=1)
    blind = np.zeros_like(own)
    blind[:, int(truth.argmax())] = truth
    return segmentation.nuscenes(blind).mean


def _named(by_class: F64) -> dict[str, float]:
    return {name: float(value) for name, value in zip(GROUPS, by_class) if np.isfinite(value)}


def _objects(truths: list[Truth], scans: list[Frame]) -> dict[str, Any]:
    points = np.concatenate(
        [[scan.points.get(int(box), 0) for box in truth.instance] for truth, scan in zip(truths, scans)]
    ).astype(np.int64)
    target = np.concatenate([truth.points >= VISIBLE for truth in truths])
    kind = np.concatenate([truth.kind for truth in truths])
    metrics, detail = {}, {}
    for enough in objects.ENOUGH:
        seen, of = objects.recall(points, target, enough)
        metrics[f"objects_{enough}"] = seen / of if of else np.nan
        for number, name in enumerate(KINDS):
            detail[f"{name}_{enough}"] = list(objects.recall(points, target & (kind == number), enough))
    return {"metrics": metrics, "detail": detail}


def _ground(grid: Grid, truths: list[Truth], scans: list[Frame]) -> dict[str, Any]:
    blind: dict[int, float] = dict.fromkeys(NEAR, 0.0)
    whole = dict.fromkeys(NEAR, 0.0)
    for truth, scan in zip(truths, scans):
        # Columns, not voxels: ground on a slope may fill two.
        columns = np.unique(truth.keys[np.isin(truth.labels, GROUND)] // grid.shape[2])
        cells = grid.centres(columns * grid.shape[2])[:, :2]
        hits = scan.xyz[np.isin(scan.labels, GROUND), :2]
        body = (float(truth.body[0]), float(truth.body[1]), float(truth.body[2]), float(truth.body[3]))
        for within in NEAR:
            dark, of = objects.blind_ground(cells, hits, body, within, grid.voxel[0])
            blind[within] += dark / len(truths)
            whole[within] += of / len(truths)
    metrics = {f"ground_seen_{r}m": 1 - blind[r] / whole[r] if whole[r] else np.nan for r in NEAR}
    return {"metrics": metrics, "detail": {f"{r}m": blind[r] for r in NEAR}}
