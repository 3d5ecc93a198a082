"""Reads a nuScenes export with nuscenes-devkit 1.2.0 and evaluates its truth against itself.

python nuscenes_set.py DIR [VERSION]
"""
import json, os, sys, tempfile
import numpy as np
from nuscenes import NuScenes
from nuscenes.eval.detection.config import config_factory
from nuscenes.eval.detection.evaluate import NuScenesEval
from nuscenes.eval.detection.utils import category_to_detection_name
from nuscenes.eval.lidarseg.evaluate import LidarSegEval
from nuscenes.utils.data_classes import LidarPointCloud
from nuscenes.utils.geometry_utils import points_in_box

root = sys.argv[1]
version = sys.argv[2] if len(sys.argv) > 2 else "v1.0-mini"
nusc = NuScenes(version=version, dataroot=root, verbose=False)
nusc.list_scenes()
nusc.list_lidarseg_categories(sort_by="count")

boxes = wrong = 0
speeds = []
for sample in nusc.sample:
    cloud, times = LidarPointCloud.from_file_multisweep(nusc, sample, "LIDAR_TOP", "LIDAR_TOP", nsweeps=10)
    assert cloud.nbr_points() and times.min() >= 0
    for channel in (c for c in sample["data"] if c.startswith("LIDAR_") and c != "LIDAR_TOP"):
        LidarPointCloud.from_file_multisweep(nusc, sample, channel, "LIDAR_TOP", nsweeps=3)
    token = sample["data"]["LIDAR_TOP"]
    path = nusc.get_sample_data_path(token)
    points = LidarPointCloud.from_file(path).points[:3]
    names = [s for s in sample["anns"]]
    for box in nusc.get_sample_data(token, selected_anntokens=names, use_flat_vehicle_coordinates=False)[1]:
        counted = int(points_in_box(box, points).sum())
        boxes += 1
        wrong += counted != nusc.get("sample_annotation", box.token)["num_lidar_pts"]
    speeds += [np.linalg.norm(nusc.box_velocity(a)[:2]) for a in sample["anns"]]
print(f"boxes {boxes}, of them counted otherwise by points_in_box: {wrong}")
print(f"speeds {np.nanmin(speeds):.3f} to {np.nanmax(speeds):.3f} m/s")
assert boxes and not wrong

eval_set = "mini_val" if version == "v1.0-mini" else "val"
from nuscenes.utils.splits import create_splits_scenes
val = set(create_splits_scenes()[eval_set])
results = {}
for sample in nusc.sample:
    if nusc.get("scene", sample["scene_token"])["name"] not in val:
        continue
    rows = []
    for token in sample["anns"]:
        ann = nusc.get("sample_annotation", token)
        name = category_to_detection_name(ann["category_name"])
        # The evaluator drops true boxes without points, but not predictions of them.
        if name is None or ann["num_lidar_pts"] == 0:
            continue
        attributes = [nusc.get("attribute", a)["name"] for a in ann["attribute_tokens"]]
        rows.append({"sample_token": sample["token"], "translation": ann["translation"], "size": ann["size"],
                     "rotation": ann["rotation"], "velocity": nusc.box_velocity(token)[:2].tolist(),
                     "detection_name": name, "detection_score": 1.0,
                     "attribute_name": attributes[0] if attributes else ""})
    results[sample["token"]] = rows
meta = dict(use_camera=False, use_lidar=True, use_radar=False, use_map=False, use_external=False)
with tempfile.TemporaryDirectory() as out:
    path = os.path.join(out, "results.json")
    json.dump({"meta": meta, "results": results}, open(path, "w"))
    evaluation = NuScenesEval(nusc, config_factory("detection_cvpr_2019"), path, eval_set, out, verbose=False)
    metrics, _ = evaluation.evaluate()
    present = {box.detection_name for boxes in evaluation.gt_boxes.boxes.values() for box in boxes}
    aps = {name: metrics.mean_dist_aps[name] for name in sorted(present)}
    print("AP", aps)
    assert aps and min(aps.values()) > 0.999

    # Truth as predictions, in the 16 classes of the challenge.
    folder = os.path.join(out, "lidarseg", eval_set)
    os.makedirs(folder)
    from nuscenes.eval.lidarseg.utils import LidarsegClassMapper
    mapper = LidarsegClassMapper(nusc)
    for sample in nusc.sample:
        if nusc.get("scene", sample["scene_token"])["name"] not in val:
            continue
        token = sample["data"]["LIDAR_TOP"]
        labels = np.fromfile(os.path.join(root, nusc.get("lidarseg", token)["filename"]), np.uint8)
        coarse = mapper.convert_label(labels)
        # The evaluator refuses predictions of `ignore`; those points do not count.
        np.where(coarse == 0, 1, coarse).astype(np.uint8).tofile(os.path.join(folder, f"{token}_lidarseg.bin"))
    os.makedirs(os.path.join(out, eval_set))
    json.dump({"meta": {**meta, "use_lidarseg": True}}, open(os.path.join(out, eval_set, "submission.json"), "w"))
    score = LidarSegEval(nusc, out, eval_set, verbose=False).evaluate()
    print("mIoU", score["miou"], {k: v for k, v in score["iou_per_class"].items() if v == v})
    assert score["miou"] > 0.999
print("nuscenes-devkit reads it, truth against itself is 1")
