"""The P-SOG of a small set in the layout of nuScenes, counted again with nuscenes-devkit's own transforms.

    python3.11 -m venv devkit && devkit/bin/pip install nuscenes-devkit==1.2.0 'numpy<2'
    devkit/bin/python tests/oracles/nuscenes_devkit.py target/release/sightline

Prints the number of voxels whose counts differ; ends with 1 if there are any that hold no point within 0.1 mm of a
face, which rounding may move: the transforms then differ by more than that.
"""
import json, os, subprocess, sys, tempfile
import numpy as np
from pyquaternion import Quaternion
from nuscenes.nuscenes import NuScenes
from nuscenes.utils.data_classes import LidarPointCloud

VOXEL, MIN, SHAPE = 0.5, np.array([-20.0, -20.0, -1.0]), (80, 80, 12)
NAMES = ["noise", "flat.driveable_surface", "flat.sidewalk", "static.manmade", "static.vegetation"]
OURS = {1: "road", 2: "sidewalk", 3: "building", 4: "vegetation"}


def write(root):
    rng = np.random.default_rng(1)
    turn = Quaternion(axis=[0, 0, 1], angle=-np.pi / 2) * Quaternion(axis=[1, 0, 0], angle=0.02)
    tables = {name: [] for name in "attribute visibility instance sample_annotation".split()}
    tables["scene"] = [dict(token="s", name="scene-0061", description="", log_token="l",
                            first_sample_token="k0", last_sample_token="k3", nbr_samples=4)]
    tables["log"] = [dict(token="l", location="boston-seaport", logfile="", vehicle="", date_captured="")]
    tables["map"] = [dict(token="m", log_tokens=["l"], filename="maps/m.png", category="semantic_prior")]
    tables["sensor"] = [dict(token="t", channel="LIDAR_TOP", modality="lidar")]
    tables["calibrated_sensor"] = [dict(token="c", sensor_token="t", translation=[0.94, 0.01, 1.84],
                                        rotation=list(turn), camera_intrinsic=[])]
    tables["category"] = [dict(token=f"c{i}", name=n, index=i, description="") for i, n in enumerate(NAMES)]
    for name in ("sample", "sample_data", "ego_pose", "lidarseg"):
        tables[name] = []
    for folder in ("v1.0-mini", "samples/LIDAR_TOP", "lidarseg/v1.0-mini", "maps"):
        os.makedirs(f"{root}/{folder}")
    open(f"{root}/maps/m.png", "w").close()
    for k in range(4):
        near = dict(prev=f"k{k-1}" if k else "", next=f"k{k+1}" if k < 3 else "", timestamp=10**15 + k * 500_000)
        tables["sample"].append(dict(token=f"k{k}", scene_token="s", **near))
        heading = Quaternion(axis=[0, 0, 1], angle=1.0 + 0.1 * k) * Quaternion(axis=[0, 1, 0], angle=0.01)
        tables["ego_pose"].append(dict(token=f"e{k}", translation=[411.3 + k, 1180.9 + 2 * k, 0.0],
                                       rotation=list(heading), timestamp=near["timestamp"]))
        scan, seg = f"samples/LIDAR_TOP/{k}.pcd.bin", f"lidarseg/v1.0-mini/d{k}_lidarseg.bin"
        tables["sample_data"].append(dict(token=f"d{k}", sample_token=f"k{k}", ego_pose_token=f"e{k}", filename=scan,
                                          calibrated_sensor_token="c", is_key_frame=True, fileformat="pcd", **near))
        tables["lidarseg"].append(dict(token=f"d{k}", sample_data_token=f"d{k}", filename=seg))
        points = rng.uniform([-25, -25, -3, 0, 0], [25, 25, 4, 255, 31], (20_000, 5)).astype("<f4")
        points.tofile(f"{root}/{scan}")
        rng.integers(0, len(NAMES), 20_000).astype("u1").tofile(f"{root}/{seg}")
    for name, rows in tables.items():
        json.dump(rows, open(f"{root}/v1.0-mini/{name}.json", "w"))


def moved(nusc, k, t):
    """Points and sensor of frame k in the ego frame of frame t, by the devkit's methods (map_pointcloud_to_image)."""
    data = [nusc.get("sample_data", f"d{i}") for i in (k, t)]
    ego = [nusc.get("ego_pose", d["ego_pose_token"]) for d in data]
    sensor = nusc.get("calibrated_sensor", data[0]["calibrated_sensor_token"])
    cloud = LidarPointCloud.from_file(f"{nusc.dataroot}/{data[0]['filename']}")
    both = LidarPointCloud(np.hstack([cloud.points.astype(float), np.zeros((4, 1))]))
    for pose in (sensor, ego[0]):
        both.rotate(Quaternion(pose["rotation"]).rotation_matrix)
        both.translate(np.array(pose["translation"]))
    both.translate(-np.array(ego[1]["translation"]))
    both.rotate(Quaternion(ego[1]["rotation"]).rotation_matrix.T)
    return both.points[:3, :-1].T, both.points[:3, -1]


def main(program):
    with tempfile.TemporaryDirectory() as root:
        write(root)
        nusc = NuScenes("v1.0-mini", root, verbose=False)
        out = f"{root}/out.npz"
        top = MIN + VOXEL * np.array(SHAPE)
        subprocess.run([program, "psog", "build", "--nuscenes", root, "--scenes", "scene-0061", "--out", out, "--voxel",
                        *["0.5"] * 3, "--roi-min", *map(str, MIN), "--roi-max", *map(str, top)], check=True)
        psog = np.load(out)
        names = bytes(psog["classes"]).decode().split("\n")
        ours = np.zeros((int(np.prod(SHAPE)), len(names)), int)
        ours[psog["index"]] = psog["counts"]
        theirs, unsure = np.zeros_like(ours), np.zeros(len(ours), bool)
        for t in range(4):
            votes = np.zeros_like(ours)
            for k in range(4):
                points, sensor = moved(nusc, k, t)
                labels = np.fromfile(f"{root}/lidarseg/v1.0-mini/d{k}_lidarseg.bin", "u1")
                ray = points - sensor
                cells = (points + 0.001 * ray / np.linalg.norm(ray, axis=1)[:, None] - MIN) / VOXEL
                inside = (cells >= 0).all(1) & (cells < SHAPE).all(1) & (labels > 0)
                index = np.ravel_multi_index(np.floor(cells[inside]).astype(int).T, SHAPE)
                near = (abs(cells[inside] - np.round(cells[inside])) < 1e-4 / VOXEL).any(1)
                unsure[index[near]] = True
                np.add.at(votes, (index, [names.index(OURS[i]) for i in labels[inside]]), 1)
            hit = votes.max(1) > 0
            theirs[np.flatnonzero(hit), votes[hit].argmax(1)] += 1
        differ = (ours != theirs).any(1)
        print(f"{(theirs.sum(1) > 0).sum()} voxels by the devkit, {(ours.sum(1) > 0).sum()} by sightline; "
              f"{differ.sum()} differ, {(differ & ~unsure).sum()} of them farther than 0.1 mm from a face")
        sys.exit(int((differ & ~unsure).any()))


main(sys.argv[1])
