"""Data sets that ``sightline scan --layout semantickitti|nuscenes`` wrote, with predictions for them, read file by file."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ._types import F64, I64
from .labels import KITTI_CLASS, NUSCENES, SEMANTICKITTI, Format
from .truth import Source


@dataclass(frozen=True)
class Labelled:
    """A cloud with its true and its predicted classes ``[P]``."""

    #: Name of the scene, and the frame in it.
    scene: str
    frame: int
    truth: I64
    predicted: I64
    #: Reads the points ``[P, 3]``, ego frame, metres.
    points: Callable[[], F64]


@dataclass(frozen=True)
class Export:
    """An exported data set, as its ``dataset.json`` describes it."""

    root: Path
    described: dict[str, Any]

    @staticmethod
    def read(root: Path) -> Export:
        """Reads a folder that is whole."""
        path = root / "dataset.json"
        try:
            described = json.loads(path.read_text(encoding="utf-8"))
            layout, complete = described["settings"]["layout"], described["complete"]
        except FileNotFoundError as error:
            raise ValueError(f"{path}: is not there; give the folder that `sightline scan --layout` wrote") from error
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError(f"{path}: is no description of a data set ({error}); write the data set anew") from error
        if layout not in ("semantickitti", "nuscenes"):
            raise ValueError(f"{path}: the layout is {layout}; scan with --layout semantickitti or nuscenes")
        if not complete:
            raise ValueError(f"{path}: the data set is not whole; let `sightline scan` finish it")
        return Export(root, described)

    @property
    def layout(self) -> str:
        """``semantickitti`` or ``nuscenes``."""
        found: str = self.described["settings"]["layout"]
        return found

    @property
    def format(self) -> Format:
        """Its classes."""
        return SEMANTICKITTI if self.layout == "semantickitti" else NUSCENES

    @cached_property
    def provenance(self) -> dict[str, Any]:
        """The call that wrote it: scenes, vehicle, placement."""
        found: dict[str, Any] = json.loads(self.described["settings"]["provenance"])
        return found

    def scene_files(self) -> dict[str, Path]:
        """Scene files by name, those that are where they were when the set was written; refuses those that have changed."""
        names = [scene["name"] for scene in self.described["scenes"]]
        found = {name: Path(file) for name, file in zip(names, self.provenance["scenes"]) if Path(file).is_file()}
        known = {one["sha256"] for one in self.described["settings"]["files"]}
        for path in found.values():
            # The scene before what it names: a changed one may not even open.
            for file in itertools.chain([path], (Path(one) for one in _named_by(path))):
                if hashlib.sha256(file.read_bytes()).hexdigest() not in known:
                    raise ValueError(
                        f"{file}: is not as it was when the data set was written, so that its voxels are not those of the scans; "
                        "put it back, or judge no voxels with --voxel-frames 0"
                    )
        return found

    def labelled(self, predictions: Path, split: str) -> Iterator[Labelled]:
        """All clouds of a split, or of ``all``, with their predictions."""
        chosen = [scene for scene in self.described["called"] if split in ("all", scene["split"])]
        if not chosen:
            there = ", ".join(sorted({scene["split"] for scene in self.described["called"]}))
            raise ValueError(f"{self.root}: has no scene of the split {split}; it has {there}, and all takes all")
        frames = {scene["name"]: scene["frames"] for scene in self.described["scenes"]}
        read = self._kitti if self.layout == "semantickitti" else self._nuscenes
        for scene in chosen:
            yield from read(predictions, scene["scene"], scene["name"], frames[scene["scene"]])

    def _kitti(self, predictions: Path, scene: str, name: str, frames: list[int]) -> Iterator[Labelled]:
        sequence = self.root / "sequences" / name
        middle = np.mean([[lidar[key] for key in "xyz"] for lidar in self.provenance["placement"]["lidars"]], axis=0)
        for number, frame in enumerate(frames):
            path = sequence / "labels" / f"{number:06}.label"
            truth = _kitti_classes(path, None)
            mine = predictions / "sequences" / name
            # semantic-kitti-api reads predictions; a copy of the truth has labels.
            folder = mine / "predictions" if (mine / "predictions").is_dir() else mine / "labels"
            found = _kitti_classes(folder / path.name, len(truth))
            cloud = sequence / "velodyne" / f"{number:06}.bin"
            yield Labelled(scene, frame, truth, found, lambda cloud=cloud: _cloud(cloud, 4) + middle)  # type: ignore[misc]

    @cached_property
    def _devkit(self) -> Any:
        try:
            from nuscenes import NuScenes
        except ImportError as error:
            raise ImportError(
                "nuScenes' tables are read by nuscenes-devkit, which is not there (Python 3.10 to 3.12): "
                "pip install 'sightline-evidence[nuscenes]'"
            ) from error
        return NuScenes(version=self.version, dataroot=str(self.root), verbose=False)

    @property
    def version(self) -> str:
        """Version of a nuScenes set: ``v1.0-mini`` or another."""
        return next(path.name for path in sorted(self.root.glob("v1.0-*")) if path.is_dir())

    def _nuscenes(self, predictions: Path, scene: str, name: str, frames: list[int]) -> Iterator[Labelled]:
        from nuscenes.eval.lidarseg.utils import LidarsegClassMapper
        from pyquaternion import Quaternion

        devkit, every = self._devkit, self.described["settings"]["keyframe_every"]
        mapper = LidarsegClassMapper(devkit)
        record = next(record for record in devkit.scene if record["name"] == name)
        token, number = record["first_sample_token"], 0
        while token:
            sample = devkit.get("sample", token)
            cloud = sample["data"]["LIDAR_TOP"]
            fine = _bytes(self.root / devkit.get("lidarseg", cloud)["filename"], None)
            truth = np.asarray(mapper.convert_label(fine)).astype(np.int64)
            found = _nuscenes_classes(_one_of(predictions, f"{cloud}_lidarseg.bin"), len(truth))
            placed = devkit.get("calibrated_sensor", devkit.get("sample_data", cloud)["calibrated_sensor_token"])
            turn, move = Quaternion(placed["rotation"]).rotation_matrix, np.array(placed["translation"])
            file = Path(devkit.get_sample_data_path(cloud))
            yield Labelled(
                scene, frames[number * every], truth, found,
                lambda file=file, turn=turn, move=move: _cloud(file, 5) @ turn.T + move,  # type: ignore[misc]
            )  # fmt: skip
            token, number = sample["next"], number + 1

    def detection(self, results: Path, split: str) -> dict[str, Any]:
        """nuScenes' detection metrics of a result file, by the devkit on this set."""
        from nuscenes.eval.detection.config import config_factory
        from nuscenes.eval.detection.evaluate import NuScenesEval

        devkit = self._devkit
        eval_set = f"mini_{split}" if self.version == "v1.0-mini" else split
        try:
            judge = NuScenesEval(
                devkit, config_factory("detection_cvpr_2019"), str(results), eval_set, str(results.parent), verbose=False
            )
        except (AssertionError, KeyError, ValueError, TypeError) as error:
            raise ValueError(f"{results}: is no result of the split {eval_set} for nuscenes-devkit: {error}") from error
        metrics, _ = judge.evaluate()
        names = sorted({box.detection_name for boxes in judge.gt_boxes.boxes.values() for box in boxes})
        if not names:
            raise ValueError(f"{self.root}: has no box of nuScenes' ten kinds in the split {eval_set}; take another --split")
        ap = {name: float(metrics.mean_dist_aps[name]) for name in names}
        # Kinds that are not there have errors of 1 in the devkit; some kinds have no heading, which is NaN.
        errors = {
            error: float(np.nanmean([metrics.get_label_tp(name, error) for name in names]))
            for error in ("trans_err", "scale_err", "orient_err")
        }
        mean = float(np.mean(list(ap.values())))
        # Errors of velocity and attribute are 1, the worst: a network of single frames knows neither.
        nds = (5 * mean + sum(1 - min(1.0, error) for error in errors.values())) / 10
        return {"ap": ap, "mean_ap": mean, "nds": nds, "errors": errors}


def _named_by(scene: Path) -> list[str]:
    return sorted(map(str, Source.read(scene).open().files))


def _cloud(file: Path, columns: int) -> F64:
    return np.fromfile(file, np.float32).reshape(-1, columns)[:, :3].astype(np.float64)


def _bytes(path: Path, points: int | None) -> I64:
    return _labels(path, points, np.dtype(np.uint8))


def _labels(path: Path, points: int | None, kind: np.dtype[Any]) -> I64:
    if not path.is_file():
        raise ValueError(f"{path}: is not there; every cloud of the split needs a file of labels")
    size = path.stat().st_size
    if points is not None and size != points * kind.itemsize:
        raise ValueError(
            f"{path}: has {size} bytes, {points * kind.itemsize} are needed for the {points} points of the cloud; "
            f"write one {kind} a point in the order of the points"
        )
    return np.fromfile(path, kind).astype(np.int64)


def _kitti_classes(path: Path, points: int | None) -> I64:
    # The upper half of a label is the instance.
    raw = _labels(path, points, np.dtype("<u4")) & 0xFFFF
    table = np.full(65536, -1, np.int64)
    table[list(KITTI_CLASS)] = list(KITTI_CLASS.values())
    return _known(path, raw, table[raw], "a label of semantic-kitti.yaml; predictions hold its raw labels, not class numbers")


def _nuscenes_classes(path: Path, points: int) -> I64:
    found = _bytes(path, points)
    return _known(path, found, np.where(found < len(NUSCENES.classes), found, -1), "one of the 16 classes of the challenge, nor 0")


def _known(path: Path, raw: I64, classes: I64, what: str) -> I64:
    if (classes < 0).any():
        place = int(np.argmax(classes < 0))
        raise ValueError(f"{path}: point {place} has the label {raw[place]}, which is not {what}")
    return classes


def _one_of(folder: Path, name: str) -> Path:
    """Path of a file that lies in the folder, or one or two below it, as in ``lidarseg/val``."""
    for pattern in (name, f"*/{name}", f"lidarseg/*/{name}"):
        found = sorted(folder.glob(pattern))
        if found:
            return found[0]
    return folder / name
