"""Reads exports with readers that do not install by themselves: their own code, nothing of it here.

    others.py [--kitti DIR] [--nuscenes DIR]
              [--semantic-kitti-api CHECKOUT] [--openpcseg CHECKOUT] [--mmdetection3d [CHECKOUT]]

DIR: an export of `--layout semantickitti` (`--ideal` for semantic-kitti-api: walls are held against planes) or of
`--layout nuscenes --with-camera-stubs`. torch and compiled packages are replaced by empty modules (`stubs.py`).
Needs nuscenes-devkit==1.2.0, mmengine==0.10.7, terminaltables, scipy, "numpy<2", "shapely<2.1"; without a CHECKOUT
the package mmdet3d==1.4.0, installed without what it depends on.
"""

import argparse
import contextlib
import importlib
import io
import os
import re
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import numpy as np
from stubs import stand_in

TRAIN = {f"{n:02d}" for n in range(11)} - {"08"}
BUILDING = 50


def scans_of(kitti, numbers):
    """All scans of some sequences."""
    return sorted(f for f in Path(kitti, "sequences").glob("*/velodyne/*.bin") if f.parts[-3] in numbers)


def plane_distances(points, others):
    """How far points lie from the plane through the others next to them, where those lie in one plane."""
    from scipy.spatial import cKDTree

    _, near = cKDTree(others).query(points, 12)
    near = others[near]
    middle = near.mean(1, keepdims=True)
    _, sizes, axes = np.linalg.svd(near - middle, full_matrices=False)
    flat = (sizes[:, 2] < 2e-5) & (sizes[:, 1] > 0.1) & (np.linalg.norm(near - points[:, None], axis=2).max(1) < 1)
    return np.abs(np.einsum("nd,nd->n", points - middle[:, 0], axes[:, 2]))[flat]


def semantic_kitti_api(checkout, kitti):
    """`generate_sequential.py` merges four scans; `evaluate_semantics.py` takes the labels as predictions."""
    with tempfile.TemporaryDirectory() as out:
        run = [sys.executable, "generate_sequential.py", "-d", kitti, "-o", out, "-s", "4"]
        subprocess.run(run, cwd=checkout, check=True, stdout=subprocess.DEVNULL)
        apart = []
        for folder in sorted(Path(kitti, "sequences").iterdir()):
            for file in sorted(folder.glob("velodyne/*.bin"))[3:]:
                count = file.stat().st_size // 16
                merged = Path(out, "sequences", folder.name)
                points = np.fromfile(merged / "velodyne" / file.name, np.float32).reshape(-1, 4)[:, :3].astype(float)
                labels = np.fromfile(merged / "labels" / f"{file.stem}.label", np.uint32) & 0xFFFF
                assert len(points) == len(labels) > count, file
                now = np.arange(len(points)) < count
                wall = labels == BUILDING
                if (wall & now).any() and (wall & ~now).sum() > 12:
                    apart.append(plane_distances(points[wall & now], points[wall & ~now]))
        apart = np.concatenate(apart or [np.zeros(0)])
        assert len(apart), "no walls as thin as a micrometre: is the export one of `--ideal`?"
        print(f"semantic-kitti-api generate_sequential.py -s 4: {len(apart)} points of walls, 99 % within "
              f"{np.quantile(apart, 0.99):.0e} m of the plane of the other scans'")
        assert np.quantile(apart, 0.99) < 1e-5

        truth = Path(out, "truth", "sequences", "08")
        truth.mkdir(parents=True)
        (truth / "predictions").symlink_to(Path(kitti, "sequences", "08", "labels"))
        run = [sys.executable, "evaluate_semantics.py", "-d", kitti, "-p", truth.parents[1], "-s", "valid"]
        told = subprocess.run(run, cwd=checkout, check=True, capture_output=True, text=True).stdout
    accuracy = float(re.search(r"Acc avg ([\d.]+)", told)[1])
    ious = {name: float(iou) for name, iou in re.findall(r"IoU class \d+ \[(.*?)\] = ([\d.]+)", told)}
    occur = {name: iou for name, iou in ious.items() if iou > 0}
    print(f"semantic-kitti-api evaluate_semantics.py -s valid: accuracy {accuracy}, IoU "
          f"{min(occur.values())} of the {len(occur)} classes that occur: {', '.join(occur)}")
    assert accuracy == 1 and min(occur.values()) == 1


class Settings(dict):
    """Entries as attributes."""

    __getattr__ = dict.__getitem__


def openpcseg(checkout, kitti):
    """`SemantickittiDataset` gives every scan, with LaserMix and PolarMix of its own in training."""
    packages = ("pcseg", "pcseg.data", "pcseg.data.dataset", "pcseg.data.dataset.semantickitti")
    bare = {package: str(Path(checkout, *package.split("."))) for package in packages}
    stand_in("torch", bare=bare)
    module = importlib.import_module("pcseg.data.dataset.semantickitti.semantickitti")
    scans = points = 0
    classes = set()
    root = str(Path(kitti, "sequences"))
    for training, augment in [(True, "NoAugment"), (False, "NoAugment"), (True, "GlobalAugment_LP")]:
        with contextlib.redirect_stdout(io.StringIO()):
            data = module.SemantickittiDataset(Settings(AUGMENT=augment), training, root_path=root)
        assert len(data.annos) == len(scans_of(kitti, TRAIN if training else {"08"})) > 0
        for index in range(len(data.annos)):
            scan = data[index]
            assert len(scan["xyzret"]) == len(scan["labels"]) and scan["xyzret"].shape[1] == 5
            if augment == "NoAugment":
                scans, points = scans + 1, points + len(scan["labels"])
                classes |= set(np.unique(scan["labels"]).tolist())
    print(f"OpenPCSeg SemantickittiDataset: {scans} scans, {points} points, classes {sorted(classes)}; those of training "
          "also by LaserMix or PolarMix")


def project(points, camera, with_depth=False):
    """Points of a camera's frame in its picture, and their depth."""
    seen = points @ np.asarray(camera).T
    return np.concatenate([seen[:, :2] / seen[:, 2:], seen[:, 2:]], 1)[:, : 3 if with_depth else 2]


class Boxes:
    """Boxes that stay as they are."""

    def __init__(self, boxes, box_dim, origin):
        self.tensor = boxes
        assert boxes.shape[1] == box_dim and np.isfinite(boxes).all() and origin == (0.5, 0.5, 0.5)

    def convert_to(self, _):
        return self


def beside(checkout):
    """Where tools and configurations lie: beside the package in a checkout, in it when it is installed."""
    installed = Path(checkout, "mmdet3d", ".mim")
    return installed if installed.exists() else Path(checkout)


def prepare_mmdetection3d(checkout):
    """Its files are imported from the checkout; what computes with tensors stays out."""
    os.environ["CUDA_VISIBLE_DEVICES"] = "0"  # else its log asks torch
    packages = ("mmdet3d", "mmdet3d.datasets", "mmdet3d.datasets.transforms")
    bare = {package: str(Path(checkout, *package.split("."))) for package in packages}
    tools = beside(checkout) / "tools"
    bare |= {"tools": str(tools), "tools.dataset_converters": str(tools / "dataset_converters")}
    stand_in("torch", "mmcv", "mmdet", "mmdet3d.structures", bare=bare)
    structures = importlib.import_module("mmdet3d.structures")
    structures.points_cam2img = project
    structures.LiDARInstance3DBoxes = Boxes
    structures.get_box_type = lambda kind: (Boxes, kind)
    return importlib.import_module("mmdet3d.datasets.transforms.loading")


def mmdetection3d_kitti(checkout, kitti, loading):
    """`SemanticKittiDataset` of each `semantickitti_infos_*.pkl`, by its own configuration, with points and labels."""
    from mmengine.config import Config

    base = Config.fromfile(beside(checkout) / "configs" / "_base_" / "datasets" / "semantickitti.py")
    dataset = importlib.import_module("mmdet3d.datasets.semantickitti_dataset")
    for split, numbers in [("train", TRAIN), ("val", {"08"}), ("test", {str(n) for n in range(11, 22)})]:
        given = dict(base.test_dataloader.dataset if split != "train" else base.train_dataloader.dataset)
        of_points, of_labels, *_ = (dict(step) for step in given["pipeline"])
        of_points.pop("type"), of_labels.pop("type")
        given.update(data_root=kitti, ann_file=f"semantickitti_infos_{split}.pkl", pipeline=[])
        given.pop("type")
        data = dataset.SemanticKittiDataset(**given)
        assert len(data) == len(scans_of(kitti, numbers))
        load, annotate = loading.LoadPointsFromFile(**of_points), loading.LoadAnnotations3D(**of_labels)
        annotate.backend_args = None  # its base class is a stub
        points, classes = 0, set()
        for index in range(len(data)):
            info = data.get_data_info(index)
            cloud = load._load_points(info["lidar_path"]).reshape(-1, info["num_pts_feats"])
            info = annotate._load_semantic_seg_3d(info)
            info = loading.PointSegClassMapping().transform(info)
            assert len(info["pts_semantic_mask"]) == len(cloud) > 0
            points += len(cloud)
            classes |= set(np.unique(info["pts_semantic_mask"]).tolist())
        print(f"mmdetection3d SemanticKittiDataset {split}: {len(data)} scans, {points} points, "
              f"classes {sorted(classes)}")


def mmdetection3d_nuscenes(checkout, nuscenes, loading):
    """`create_nuscenes_infos`, `update_nuscenes_infos` and `NuScenesDataset` of what they write."""
    first = importlib.import_module("tools.dataset_converters.nuscenes_converter")
    second = importlib.import_module("tools.dataset_converters.update_infos_to_v2")
    dataset = importlib.import_module("mmdet3d.datasets.nuscenes_dataset")
    second.mmengine.track_iter_progress = iter  # no bars
    version = next(d.name for d in sorted(Path(nuscenes).iterdir()) if d.name.startswith("v1.0"))
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as out:
        # Its second stage reads ./data/nuscenes, and both write beside what they read.
        root = Path(out, "data", "nuscenes")
        root.mkdir(parents=True)
        for entry in Path(nuscenes).iterdir():
            (root / entry.name).symlink_to(entry)
        os.chdir(out)
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                first.create_nuscenes_infos(str(root), "nuscenes", version)
            for split in ["test"] if version == "v1.0-test" else ["train", "val"]:
                file = root / f"nuscenes_infos_{split}.pkl"
                with contextlib.redirect_stdout(io.StringIO()):
                    second.update_nuscenes_infos(str(file), str(root))
                read_infos(dataset, loading, file, root / "lidarseg" / version, split)
        finally:
            os.chdir(here)


def points_in(box, cloud):
    """Number of points in a box x y z l w h yaw."""
    away = cloud[:, :3] - box[:3]
    along, left = np.cos(box[6]), np.sin(box[6])
    away = np.stack([away[:, 0] * along + away[:, 1] * left, away[:, 1] * along - away[:, 0] * left, away[:, 2]], 1)
    return (np.abs(away) <= box[3:6] / 2).all(1).sum()


def read_infos(dataset, loading, file, masks, split):
    """Loads one file of infos and everything that it points to."""
    with contextlib.redirect_stdout(io.StringIO()):
        data = dataset.NuScenesDataset(
            str(file.parent), file.name, data_prefix=dict(pts="samples/LIDAR_TOP", sweeps="sweeps/LIDAR_TOP", img=""),
            metainfo=dict(classes=dataset.NuScenesDataset.METAINFO["classes"]), test_mode=split == "test")
    load = loading.LoadPointsFromFile("LIDAR", load_dim=5, use_dim=5)._load_points
    boxes = inside = otherwise = points = pictures = 0
    sweeps, speeds = set(), [0.0]
    for index in range(len(data)):
        info = data.get_data_info(index)
        cloud = load(info["lidar_path"]).reshape(-1, info["num_pts_feats"])
        points += len(cloud)
        given = info.get("lidar_sweeps", [])
        sweeps.add(len(given))
        assert all(len(load(sweep["lidar_points"]["lidar_path"])) for sweep in given)
        pictures += sum(len(boxes) for boxes in info.get("cam_instances", {}).values())
        if "ann_info" in info:
            assert (masks / info["pts_semantic_mask_path"]).stat().st_size == len(cloud)
            known = info["ann_info"]
            boxes += len(known["num_lidar_pts"])
            for box, count in zip(known["gt_bboxes_3d"].tensor, known["num_lidar_pts"]):
                inside += count
                otherwise += abs(points_in(box, cloud) - count)  # where a street is steep: these boxes have a yaw alone
                speeds.append(np.hypot(*box[7:9]))
    print(f"mmdetection3d NuScenesDataset {split}, infos of version 2: {len(data)} samples, {points} points, "
          f"{min(sweeps)} to {max(sweeps)} sweeps, {boxes} boxes with {inside} points ({otherwise} counted otherwise), "
          f"up to {max(speeds):.1f} m/s, {pictures} boxes in pictures")
    assert len(data) and otherwise <= 0.02 * inside


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("kitti", "nuscenes", "semantic-kitti-api", "openpcseg"):
        parser.add_argument(f"--{name}", type=os.path.abspath)
    parser.add_argument("--mmdetection3d", type=os.path.abspath, nargs="?", const=sysconfig.get_path("purelib"))
    args = parser.parse_args()
    if args.kitti and args.semantic_kitti_api:
        semantic_kitti_api(args.semantic_kitti_api, args.kitti)
    if args.kitti and args.openpcseg:
        openpcseg(args.openpcseg, args.kitti)
    if args.mmdetection3d:
        loading = prepare_mmdetection3d(args.mmdetection3d)
        if args.kitti:
            mmdetection3d_kitti(args.mmdetection3d, args.kitti, loading)
        if args.nuscenes:
            mmdetection3d_nuscenes(args.mmdetection3d, args.nuscenes, loading)


if __name__ == "__main__":
    main()
