"""Labels of any network on an exported data set: the truth gets 1, an error lowers the classes that it touches."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn")
from sightline_evidence import predictions
from sightline_evidence.__main__ import main
from sightline_evidence.exported import Export
from sightline_evidence.labels import KITTI_CLASS, NUSCENES, SEMANTICKITTI

CLASS = {name: number for number, name in enumerate(SEMANTICKITTI.classes)}


def exported(layout: str, small_file: Path, folder: Path) -> Path:
    placement = folder / "one.json"
    pose = {"x": 0.3, "y": 0, "z": 2.5}
    placement.write_text(json.dumps({"placements": [{"name": "one", "lidars": [pose, {**pose, "x": -0.3}]}]}))
    command = [sys.executable, "-m", "sightline", "scan", str(small_file), "--placement", str(placement), "--layout", layout]
    rest = ["--out", str(folder / layout), "--splits", "0", "1", "0"]
    rest += ["--keyframe-every", "2"] if layout == "nuscenes" else []
    subprocess.run([*command, *rest], check=True, capture_output=True)
    return folder / layout


@pytest.fixture(scope="module")
def kitti(small_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return exported("semantickitti", small_file, tmp_path_factory.mktemp("kitti"))


@pytest.fixture
def predicted(kitti: Path, tmp_path: Path) -> list[Path]:
    """The truth as predictions, a file a cloud."""
    folder = tmp_path / "predicted" / "sequences" / "08" / "predictions"
    shutil.copytree(kitti / "sequences" / "08" / "labels", folder)
    return sorted(folder.iterdir())


def judged(kitti: Path, predicted: list[Path], voxel_frames: int = 0) -> dict:
    export = Export.read(kitti)
    clouds = export.labelled(predicted[0].parents[3], "val")
    return predictions.judge(clouds, export.format, export.scene_files(), voxel_frames)


def test_truth_is_1_and_a_placement_that_saw_little_is_not(kitti: Path, predicted: list[Path]) -> None:
    found = judged(kitti, predicted, voxel_frames=1)
    there = len(found["iou_by_class"])
    assert found["own_miou"] == {"nuscenes": 1.0, "semantickitti": pytest.approx(there / 19)}
    assert found["clouds"] == 3 and 4 <= there < 19 and found["voxel_frames"] == 1
    # Own points are all right, yet two LiDARs do not see every voxel of the truth; what they see lies where it is.
    assert 0.1 < found["voxel_miou"] < 0.9 and found["voxel_iou_by_group"]["road"] > 0.2


def test_a_flipped_label_lowers_its_classes_by_the_rule(kitti: Path, predicted: list[Path]) -> None:
    before = judged(kitti, predicted)["iou_by_class"]
    points = np.concatenate([np.fromfile(path, "<u4") & 0xFFFF for path in predicted])
    roads, poles = (points == 40).sum(), (points == 80).sum()
    labels = np.fromfile(predicted[0], "<u4")
    labels[np.flatnonzero((labels & 0xFFFF) == 40)[0]] = 80
    labels.tofile(predicted[0])
    after = judged(kitti, predicted)["iou_by_class"]
    assert after["road"] == pytest.approx((roads - 1) / roads, abs=1e-12)
    assert after["pole"] == pytest.approx(poles / (poles + 1), abs=1e-12)
    assert {name for name in before if after[name] != before[name]} == {"road", "pole"}


def test_unlabelled_predictions_are_misses(kitti: Path, predicted: list[Path]) -> None:
    labels = np.fromfile(predicted[0], "<u4")
    labels[np.flatnonzero((labels & 0xFFFF) == 40)] = 0
    labels.tofile(predicted[0])
    found = judged(kitti, predicted)
    there, missed = len(found["iou_by_class"]), int((labels == 0).sum())
    assert found["own_miou"]["nuscenes"] < 1 - 0.01 and found["own_miou"]["semantickitti"] < there / 19 - 0.01
    assert found["iou_by_class"]["road"] < 0.9 and 0 < found["unlabelled"] <= missed
    assert f"{found['unlabelled']} points have the label 0, which is a miss" in predictions.shown(found)


def test_voxels_are_those_of_the_scene_that_was_scanned(small_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "scene.json"
    shutil.copy(small_file, scene)
    root = exported("semantickitti", scene, tmp_path)
    words = ["predictions", str(root), "--truth", str(root)]
    scene.write_bytes(scene.read_bytes() + b"\n")
    assert main(words) == 2
    assert "scene.json: is not as it was when the data set was written" in capsys.readouterr().err
    assert main([*words, "--voxel-frames", "0"]) == 0
    assert "no voxels: none were asked for" in capsys.readouterr().out
    scene.unlink()
    assert main(words) == 0
    assert "no voxels: the scene files are not where they were" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main([*words, "--voxel-frames", "-1"])
    assert "--voxel-frames: is -1; give 0 or more" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda path: path.unlink(), "000001.label: is not there"),
        (lambda path: path.write_bytes(path.read_bytes()[:-4]), r"000001.label: has \d+ bytes, \d+ are needed for the \d+ points"),
        (lambda path: path.write_bytes(b"\x09\0\0\0" + path.read_bytes()[4:]), "000001.label: point 0 has the label 9, which is not"),
    ],
)
def test_what_is_wrong_is_named_with_its_file(kitti: Path, predicted: list[Path], spoil, says: str, capsys) -> None:
    spoil(predicted[1])
    assert main(["predictions", str(predicted[0].parents[3]), "--truth", str(kitti)]) == 2
    error = capsys.readouterr().err
    assert re.search(says, error) and error.startswith("error: ") and error.count("\n") == 1


def test_other_folders_are_refused(kitti: Path, tmp_path: Path, capsys) -> None:
    for arguments, says in (
        ([str(tmp_path), "--truth", str(tmp_path)], "dataset.json: is not there"),
        ([str(tmp_path), "--truth", str(kitti), "--layout", "nuscenes"], "the layout is semantickitti, not nuscenes"),
        ([str(tmp_path), "--truth", str(kitti), "--split", "train"], "has no scene of the split train"),
        ([str(tmp_path / "none"), "--truth", str(kitti)], "none: is not there"),
        ([str(tmp_path / "boxes.json"), "--truth", str(kitti)], "needs an export with --layout nuscenes"),
    ):
        assert main(["predictions", *arguments]) == 2
        assert says in capsys.readouterr().err


def test_classes_are_those_of_the_public_files() -> None:
    assert len(SEMANTICKITTI.classes) == 20 and len(NUSCENES.classes) == 17
    assert KITTI_CLASS[252] == KITTI_CLASS[10] == CLASS["car"] and KITTI_CLASS[60] == CLASS["road"]
    assert len(KITTI_CLASS) == 34


def test_lidarseg_and_boxes_as_the_devkit_reads_them(small_file: Path, tmp_path: Path) -> None:
    pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
    from nuscenes import NuScenes
    from nuscenes.eval.detection.utils import category_to_detection_name
    from nuscenes.eval.lidarseg.utils import LidarsegClassMapper

    root = exported("nuscenes", small_file, tmp_path)
    devkit = NuScenes("v1.0-mini", str(root), verbose=False)
    mapper, folder = LidarsegClassMapper(devkit), tmp_path / "mine" / "lidarseg" / "mini_val"
    assert tuple(mapper.coarse_name_2_coarse_idx_mapping) == NUSCENES.classes
    folder.mkdir(parents=True)
    boxes = {}
    for sample in devkit.sample:
        cloud = sample["data"]["LIDAR_TOP"]
        fine = np.fromfile(root / devkit.get("lidarseg", cloud)["filename"], np.uint8)
        mapper.convert_label(fine).astype(np.uint8).tofile(folder / f"{cloud}_lidarseg.bin")
        boxes[sample["token"]] = [
            {**{key: a[key] for key in ("sample_token", "translation", "size", "rotation")},
             "velocity": [0.0, 0.0], "detection_name": category_to_detection_name(a["category_name"]),
             "detection_score": 1.0, "attribute_name": ""}
            for a in (devkit.get("sample_annotation", token) for token in sample["anns"])
            if a["num_lidar_pts"]
        ]  # fmt: skip
    export = Export.read(root)
    found = predictions.judge(export.labelled(tmp_path / "mine", "val"), export.format, export.scene_files(), 1)
    assert found["own_miou"]["nuscenes"] == 1.0 and found["clouds"] == 2
    assert 0.1 < found["voxel_miou"] < 0.9
    result = tmp_path / "boxes.json"
    meta = dict.fromkeys(("use_camera", "use_radar", "use_map", "use_external"), False)
    result.write_text(json.dumps({"meta": {**meta, "use_lidar": True}, "results": boxes}))
    perfect = export.detection(result, "val")
    assert set(perfect["ap"]) == {"car", "pedestrian"} and min(perfect["ap"].values()) > 0.999
    # Ten parts: five are of the mAP, three of the errors that are none, and two of velocity and attribute, at their worst.
    assert perfect["nds"] == pytest.approx(0.8, abs=1e-3) and max(perfect["errors"].values()) < 1e-6
    says = predictions.shown(perfect)
    assert "mAP 1.000, ATE 0.000 m, ASE 0.000, AOE 0.000 rad" in says and "NDS 0.800, with AVE and AAE at 1" in says
    # A prediction of 0 is a miss; by the devkit's matrix alone it would not count.
    file = next(folder.iterdir())
    np.zeros(file.stat().st_size, np.uint8).tofile(file)
    missed = predictions.judge(export.labelled(tmp_path / "mine", "val"), export.format, {}, 0)
    assert missed["own_miou"]["nuscenes"] < 0.7 and missed["unlabelled"] > 100
    boxes.popitem()
    result.write_text(json.dumps({"meta": {**meta, "use_lidar": True}, "results": boxes}))
    with pytest.raises(ValueError, match="boxes.json: is no result of the split mini_val"):
        export.detection(result, "val")
