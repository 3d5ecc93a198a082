"""A network that a user trained on an export, judged: ``python -m sightline_evidence predictions DIR --truth EXPORT``.

``DIR`` holds ``sequences/NN/predictions/NNNNNN.label`` (SemanticKITTI, raw labels), ``lidarseg/SET/TOKEN_lidarseg.bin``
(nuScenes, classes 1 to 16), or is a nuScenes detection result (``.json``). ``EXPORT`` is the folder that ``sightline scan
--layout semantickitti|nuscenes`` wrote.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from . import truth
from ._types import I64
from .exported import Export, Labelled
from .files import write_json
from .grid import majority
from .labels import COMMON, Format, common_of
from .metrics import segmentation
from .truth import Source


def judge(given: Iterable[Labelled], form: Format, scenes: dict[str, Path], voxel_frames: int) -> dict[str, Any]:
    """mIoU on own points by both public rules, and on fixed voxels of the scenes at hand, in the common groups.

    Voxels are judged in at most ``voxel_frames`` frames of each scene, the first ones: a dense rig scans them. A label of 0
    is a miss by both rules; the devkit refuses it, for by its matrix it would raise the mean.
    """
    own = np.zeros((len(form.classes),) * 2, np.int64)
    fixed = np.zeros((len(COMMON),) * 2, np.int64)
    taken = dict.fromkeys(scenes, 0)
    clouds = 0
    for one in given:
        clouds += 1
        own += segmentation.confusion(one.truth, one.predicted, len(form.classes))
        if taken.get(one.scene, voxel_frames) < voxel_frames:
            taken[one.scene] += 1
            fixed += _voxels(one, form, Source.read(scenes[one.scene]))
    rules = {"semantickitti": segmentation.semantickitti(own), "nuscenes": segmentation.fixed(own)}
    return {
        "format": form.name,
        "clouds": clouds,
        "points": int(own[1:].sum()),
        "unlabelled": int(own[1:, 0].sum()),
        "own_miou": {name: rule.mean for name, rule in rules.items()},
        "iou_by_class": _named(form.classes, rules["nuscenes"].by_class),
        "voxel_frames_asked": voxel_frames,
        "voxel_frames": sum(taken.values()),
        "voxel_miou": segmentation.fixed(fixed).mean if fixed.any() else None,
        "voxel_iou_by_group": _named(COMMON, segmentation.fixed(fixed).by_class),
    }


def _voxels(one: Labelled, form: Format, source: Source) -> I64:
    (fixed,) = truth.truth_of(source, [one.frame])
    wanted = common_of(fixed.labels)
    keys, labels = majority(source.grid.keys(one.points()), form.groups(one.predicted), len(COMMON))
    place = np.searchsorted(keys, fixed.keys)
    there = np.append(keys, -1)[place] == fixed.keys
    seen = np.where(there, np.append(labels, 0)[place], 0)
    return segmentation.confusion(wanted[wanted > 0], seen[wanted > 0], len(COMMON))


def _named(names: tuple[str, ...], values: Any) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values) if np.isfinite(value)}


def shown(found: dict[str, Any]) -> str:
    """Text for a person to read."""
    if "ap" in found:
        errors = found["errors"]
        lines = [
            f"over the kinds that are there: mAP {found['mean_ap']:.3f}, ATE {errors['trans_err']:.3f} m, "
            f"ASE {errors['scale_err']:.3f}, AOE {errors['orient_err']:.3f} rad",
            f"NDS {found['nds']:.3f}, with AVE and AAE at 1: a network of single frames knows no velocity and no attribute",
        ]
        return "\n".join([*lines, *(f"  {name:22} AP {value:.3f}" for name, value in found["ap"].items())])
    both = found["own_miou"]
    lines = [
        f"{found['clouds']} clouds, {found['points']} points with a class of {found['format']}",
        f"mIoU on own points: {both['nuscenes']:.4f} (nuScenes: absent classes left out), "
        f"{both['semantickitti']:.4f} (SemanticKITTI: absent classes count 0)",
    ]
    lines += [f"  {name:22} {value:.4f}" for name, value in found["iou_by_class"].items()]
    if found["unlabelled"]:
        lines.insert(2, f"{found['unlabelled']} points have the label 0, which is a miss")
    if not found["voxel_frames_asked"]:
        return "\n".join([*lines, "no voxels: none were asked for"])
    if found["voxel_miou"] is None:
        return "\n".join([*lines, "no voxels: the scene files are not where they were when the data set was written"])
    lines.append(f"mIoU on fixed voxels, missed is wrong: {found['voxel_miou']:.4f} ({found['voxel_frames']} frames)")
    return "\n".join([*lines, *(f"  {name:22} {value:.4f}" for name, value in found["voxel_iou_by_group"].items())])


def main(arguments: list[str]) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="python -m sightline_evidence predictions", description=__doc__)
    parser.add_argument("predictions", type=Path, help="folder of labels, or a nuScenes detection result (.json)")
    parser.add_argument("--truth", type=Path, required=True, metavar="EXPORT", help="the data set that was exported")
    parser.add_argument("--layout", choices=["semantickitti", "nuscenes"], help="that of the export, if it must be a certain one")
    parser.add_argument("--split", default="val", choices=["train", "val", "test", "all"], help="scenes that count [val]")
    parser.add_argument("--voxel-frames", type=int, default=4, help="frames of each scene judged on fixed voxels [4]")
    parser.add_argument("--json", type=Path, help="file to write the numbers to")
    given = parser.parse_args(arguments)
    if given.voxel_frames < 0:
        parser.error(f"--voxel-frames: is {given.voxel_frames}; give 0 or more")
    export = Export.read(given.truth)
    if given.layout not in (None, export.layout):
        raise ValueError(f"{given.truth}: the layout is {export.layout}, not {given.layout}; leave --layout out")
    if given.predictions.suffix == ".json":
        if export.layout != "nuscenes":
            raise ValueError(f"{given.truth}: a detection result needs an export with --layout nuscenes")
        found = export.detection(given.predictions, given.split)
    elif not given.predictions.is_dir():
        raise ValueError(f"{given.predictions}: is not there; give a folder of labels or a .json of boxes")
    else:
        clouds = export.labelled(given.predictions, given.split)
        scenes = export.scene_files() if given.voxel_frames else {}
        found = judge(clouds, export.format, scenes, given.voxel_frames)
    if given.json:
        write_json(given.json, found)
    print(shown(found))
    return 0
