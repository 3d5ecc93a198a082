"""Sensor files of the vendors read by PyYAML, csv, json, NumPy and ouster-sdk, against `sightline sensor info`.

    python3 -m venv oracles && oracles/bin/pip install pyyaml numpy ouster-sdk==1.0.1
    oracles/bin/python tests/oracles/sensors.py target/release/sightline [../shared/data] [FOLDER…]

Every table, pattern and vendor's file under `sensors` of the data, and under further folders: checkouts of
ros-drivers/velodyne, HesaiTechnology/HesaiLidar_SDK_2.0, tier4/nebula, RoboSense-LiDAR/ros_rslidar and
RobotecAI/RGLGazeboPlugin hold such files. Tables are compared by elevations and azimuth offsets; patterns by every
direction that `sightline cast` sends out, a NumPy pattern also by a Livox CSV written from it; Ouster's files by both,
the directions with ouster-sdk's XYZLut. Prints a line a file, with the largest difference in degrees; ends with 1
where one is above 1e-9 (of directions, which are `f32`: 2e-5), and where only one side reads a file.
"""
import csv, io, json, os, subprocess, sys, tempfile
import numpy as np
import yaml

FAN, BEAMS = 1e-9, 2e-5


def unit(azimuth, elevation):
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], -1)


def degrees_apart(a, b):
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1))).max()


def velodyne(path):
    lasers = sorted(yaml.safe_load(open(path))["lasers"], key=lambda laser: laser["laser_id"])
    return np.degrees([[laser["vert_correction"], laser["rot_correction"]] for laser in lasers]).T


def hesai(path):
    text = open(path, encoding="utf-8-sig", newline="").read()
    rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text)) if row]
    titles = next(i for i, row in enumerate(rows) if "Elevation" in row)
    at = [rows[titles].index(name) for name in ("Elevation", "Azimuth")]
    lines = [row for row in rows[titles + 1:] if len(row) > max(at) and row[at[0]]]
    elevation, azimuth = np.array([[float(row[k]) for k in at] for row in lines]).T
    return elevation, -azimuth


def robosense(path):
    rows = [[float(cell) for cell in row if cell.strip()] for row in csv.reader(open(path)) if row]
    table = np.array(rows).T
    return table[0], -table[1] if len(table) > 1 else 0 * table[0]


def ours(path):
    table = json.load(open(path))
    elevation = np.array(table["elevation_deg"])
    return elevation, np.array(table.get("azimuth_offset_deg", 0 * elevation))


def ouster(path):
    """Altitudes, azimuths, and the directions of a turn in the order of ours, columns counter-clockwise."""
    from ouster.sdk import core
    info = core.SensorInfo(open(path).read())
    lut = core.XYZLut(info, use_extrinsics=False)
    shape = info.h, info.w
    far, near = (lut(np.full(shape, mm, np.uint32)) for mm in (20_000, 10_000))
    sent = (far - near) / np.linalg.norm(far - near, axis=-1, keepdims=True)
    # XYZLut answers in the sensor's frame, half a turn from that of the angles.
    sent = sent @ info.lidar_to_sensor_transform[:3, :3]
    columns = -np.arange(info.w) % info.w
    return np.array(info.beam_altitude_angles), -np.array(info.beam_azimuth_angles), sent[:, columns].reshape(-1, 3)


def numpy_pattern(path):
    azimuth, elevation = np.degrees(np.load(path).astype(float)).T
    return unit(azimuth, elevation)


def rgl(path):
    rays = np.fromfile(path, "<f4").reshape(-1, 3, 4).astype(float)[:, :, 2]
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def livox(path):
    azimuth, zenith = np.loadtxt(path, delimiter=",", skiprows=1).T[1:]
    return unit(azimuth, 90 - zenith)


def kind(path):
    """Who reads a file here: a name, or None for files that hold no angles."""
    name = os.path.basename(path)
    if name.endswith(".json"):
        keys = json.load(open(path))
        if "elevation_deg" in keys:
            return "table"
        if "beam_altitude_angles" in keys or "beam_intrinsics" in keys:
            return "Ouster"
        return "note" if "pattern" in keys.get("kind", "") else None
    if name.endswith((".yaml", ".yml")):
        return "Velodyne" if "\nlasers:" in "\n" + open(path, errors="replace").read() else None
    if name.endswith(".csv"):
        if name == "angle.csv":
            return "RoboSense"
        head = open(path, errors="replace").read(200)
        return "Hesai" if "Elevation" in head else "Livox" if "Zenith" in head else None
    return {".npy": "NumPy", ".mat3x4f": "RGL"}.get(os.path.splitext(name)[1])


class Ours:
    def __init__(self, program, root):
        self.program, self.root = program, root

    def info(self, path):
        told = subprocess.run([self.program, "sensor", "info", path, "--format", "json", "--quiet"],
                              capture_output=True, text=True)
        return json.loads(told.stdout) if told.returncode == 0 else None

    def directions(self, path):
        """Beams of a sensor that stands in the origin of the ego frame."""
        scene, placements, out = (f"{self.root}/{name}" for name in ("scene.json", "rig.json", "hits.npz"))
        box = {"min": [-8, -8, 0], "max": [8, 8, 2]}
        json.dump({"sightline": 1, "roi": {**box, "voxel": [1, 1, 1]},
                   "lidar": {"file": os.path.abspath(path), "range": 50},
                   "mount": {"min": [0, 0, 1], "max": [0, 0, 1], "lidars": 1},
                   "static": [{"class": "road", "plane": {"min": [-9, -9], "max": [9, 9], "z": 0}}]}, open(scene, "w"))
        json.dump({"placements": [{"name": "a", "lidars": [{"x": 0, "y": 0, "z": 1}]}]}, open(placements, "w"))
        subprocess.run([self.program, "cast", scene, placements, "--backend", "cpu", "--quiet", "--out", out],
                       check=True, stdout=subprocess.DEVNULL)
        return np.load(out)["direction"].astype(float)


TABLES = {"table": ours, "Velodyne": velodyne, "Hesai": hesai, "RoboSense": robosense, "Ouster": ouster}
PATTERNS = {"NumPy": numpy_pattern, "RGL": rgl, "Livox": livox}


def check(program, path, form):
    """How many channels or beams, the largest difference, and whether that is well."""
    info = program.info(path)
    if form == "note":
        return "a note about a pattern, refused" if info is None else "a note about a pattern, READ", info is None
    if info is None:
        return "NOT READ by sightline", False
    if form in TABLES:
        elevation, azimuth, *sent = TABLES[form](path)
        found = np.array(info["elevation_deg"]), np.array(info["azimuth_offset_deg"])
        if found[0].shape != elevation.shape:
            return f"{len(found[0])} channels, {len(elevation)} by the other", False
        most = max(abs(found[0] - elevation).max(), abs(found[1] - azimuth).max())
        said, well = f"{len(elevation)} channels, {most:.1e}°", most <= FAN
        if sent:
            most = degrees_apart(program.directions(path), sent[0])
            said, well = f"{said}; {len(sent[0])} beams, {most:.1e}°", well and most <= BEAMS
        return said, well
    wanted, found = PATTERNS[form](path), program.directions(path)
    if wanted.shape != found.shape:
        return f"{len(found)} beams, {len(wanted)} by the other", False
    most = degrees_apart(found, wanted)
    return f"{len(wanted)} beams, {most:.1e}°", most <= BEAMS


def main(program, data, *folders):
    bad, passed_over = 0, 0
    with tempfile.TemporaryDirectory() as root:
        program = Ours(program, root)

        def line(path, form, name):
            said, well = check(program, path, form)
            print(f"{name:48} {form:10} {said}{'' if well else '   <-- differs'}")
            return not well

        for folder in (f"{data}/sensors", *folders):
            for where, _, names in sorted(os.walk(folder)):
                for name in sorted(names):
                    path = os.path.join(where, name)
                    form = kind(path)
                    if form is None:
                        passed_over += 1
                        continue
                    bad += line(path, form, os.path.relpath(path, folder)[-48:])
                    if form == "NumPy":
                        azimuth, elevation = np.degrees(np.load(path).astype(float)).T
                        rows = np.stack([np.linspace(0, 0.1, len(azimuth), endpoint=False), azimuth, 90 - elevation], 1)
                        pattern = f"{root}/pattern.csv"
                        np.savetxt(pattern, rows, "%.9g", ",", header="Time/s,Azimuth/deg,Zenith/deg", comments="")
                        bad += line(pattern, "Livox", f"{name[:-4]} as CSV")
    print(f"{bad} differ; {passed_over} other files passed over")
    sys.exit(int(bad > 0))


main(sys.argv[1], *(sys.argv[2:] or [os.environ.get("SIGHTLINE_DATA", "../shared/data")]))
