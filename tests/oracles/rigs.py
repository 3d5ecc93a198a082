"""Rigs written by `sightline rig export` read by the tools of others, and real rigs read by both.

    python3 -m venv oracles && oracles/bin/pip install pyyaml transforms3d xacro==2.1.1 yourdfpy==0.0.60 carla==0.9.16
    oracles/bin/python tests/oracles/rigs.py target/release/sightline [../shared/data]

60 random rigs are in all attitudes, some at gimbal lock, with `base_link` moved. Optical centres in the ego frame from
each format are held against those of the placement. Readers are yourdfpy's forward kinematics (URDF; Autoware's YAML
through xacro), PyYAML, ElementTree and transforms3d, and carla's Transform, whose matrices are left-handed and of
`f32`. Then `rig import` of Autoware's files, 60 written by PyYAML and, where the data lie, those of the Lexus, against
transforms3d. Prints the largest differences in metres and radians; ends with 1 where one is above 1e-9 (CARLA: 1e-5).
"""
import ast, json, os, subprocess, sys, tempfile
import xml.etree.ElementTree as ElementTree
import numpy as np
import xacro, yaml, yourdfpy
from transforms3d.affines import compose
from transforms3d.euler import euler2mat

HEIGHTS = {"VLP-16": 0.0377, "VLS-128": 0.06611, None: 0.0}
FIELDS = "x y z roll pitch yaw".split()
JOINT = """<link name="%s"/><joint name="%s_joint" type="fixed"><parent link="%s"/><child link="%s"/>
<origin xyz="${c['x']} ${c['y']} ${c['z']}" rpy="${c['roll']} ${c['pitch']} ${c['yaw']}"/></joint>"""
MIRROR = np.diag([1.0, -1, 1, 1])


def matrix(pose):
    x, y, z, *angles = (float(pose[k]) for k in FIELDS)
    return compose([x, y, z], euler2mat(*angles, "sxyz"), [1] * 3)


def up(height):
    return compose([0, 0, height], np.eye(3), [1] * 3)


def random_rig(rng, n):
    lidars = []
    for k in range(1 + n % 16):
        pose = dict(zip(FIELDS, [*rng.uniform(-3, 3, 3), *rng.uniform(-np.pi, np.pi, 3)]))
        if rng.random() < 0.15:
            pose["pitch"] = rng.choice([-1, 1]) * np.pi / 2
        lidars.append(dict(pose) | ({"sensor": s} if (s := rng.choice(["VLP-16", "VLS-128", None])) else {}))
    return lidars


def urdf(path, frames):
    robot = yourdfpy.URDF.load(path, load_meshes=False, build_scene_graph=True)
    return [robot.get_transform(frame, "base_link") for frame in frames]


def by_xacro(folder, frames):
    """Both files through xacro's load_yaml, as Autoware's own description reads them."""
    body = ""
    for file, parent in (("sensors", "base_link"), ("sensor_kit", "sensor_kit_base_link")):
        path = f"{folder}/{file}_calibration.yaml"
        body += f'<xacro:property name="f{file}" value="${{xacro.load_yaml(\'{path}\')[\'{parent}\']}}"/>'
        for name in yaml.safe_load(open(path))[parent]:
            joint = JOINT % (name, name, parent, name)
            body += joint.replace("c['", f"f{file}['{name}']['")
    text = f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base_link"/>{body}</robot>'
    with open(f"{folder}/r.urdf.xacro", "w") as file:
        file.write(text)
    with open(f"{folder}/r.urdf", "w") as file:
        file.write(xacro.process_file(f"{folder}/r.urdf.xacro").toxml())
    return urdf(f"{folder}/r.urdf", frames)


def by_yaml(folder, frames):
    files = [yaml.safe_load(open(f"{folder}/{f}_calibration.yaml")) for f in ("sensors", "sensor_kit")]
    base, kit = files[0]["base_link"], files[1]["sensor_kit_base_link"]
    kit_pose = matrix(base["sensor_kit_base_link"])
    return [kit_pose @ matrix(kit[f]) if f in kit else matrix(base[f]) for f in frames]


def sdf(path, frames):
    links = {link.get("name"): link.find("pose") for link in ElementTree.parse(path).iter("link")}
    assert all(links[f].get("relative_to") == "base_link" for f in frames)
    return [matrix(dict(zip(FIELDS, links[f].text.split()))) for f in frames]


def launch(path, frames):
    found = {}
    for node in ast.walk(ast.parse(open(path).read())):
        if isinstance(node, ast.keyword) and node.arg == "arguments":
            words = ast.literal_eval(node.value)
            told = dict(zip(words[::2], words[1::2]))
            assert told["--frame-id"] == "base_link"
            found[told["--child-frame-id"]] = matrix({k: told[f"--{k}"] for k in FIELDS})
    return [found[f] for f in frames]


def carla_api(path, frames):
    import carla
    found = {}
    for s in json.load(open(path)):
        turn = carla.Rotation(pitch=s["pitch"], yaw=s["yaw"], roll=s["roll"])
        place = carla.Transform(carla.Location(s["x"], s["y"], s["z"]), turn)
        found[s["id"]] = MIRROR @ np.array(place.get_matrix()) @ MIRROR
    return [found[f] for f in frames]


def carla_bridge(path, frames):
    found = {}
    for s in json.load(open(path))["objects"][0]["sensors"]:
        p = s["spawn_point"]
        found[s["id"]] = matrix(p | {k: np.radians(p[k]) for k in FIELDS[3:]})
    return [found[f] for f in frames]


# Name, `--format`, reader, whether poses are those of feet.
WAYS = [
    ("URDF, yourdfpy", "urdf", urdf, True),
    ("Autoware, xacro and yourdfpy", "autoware", by_xacro, True),
    ("Autoware, PyYAML and transforms3d", "autoware", by_yaml, True),
    ("SDF, ElementTree and transforms3d", "sdf", sdf, True),
    ("ROS 2 launch, ast and transforms3d", "ros2-launch", launch, True),
    ("CARLA, carla.Transform", "carla", carla_api, False),
    ("CARLA ROS bridge, transforms3d", "carla-objects", carla_bridge, False),
]


def apart(found, wanted):
    """Largest distance and largest angle between two lists of poses."""
    assert len(found) == len(wanted) > 0
    metres, radians = 0.0, 0.0
    for a, b in zip(found, wanted):
        metres = max(metres, np.linalg.norm(a[:3, 3] - b[:3, 3]))
        turn = np.linalg.norm(a[:3, :3] - b[:3, :3])
        radians = max(radians, 2 * np.arcsin(min(1.0, turn / np.sqrt(8))))
    return metres, radians


class Table:
    def __init__(self):
        self.rows = {}

    def add(self, name, found, wanted):
        metres, radians = apart(found, wanted)
        n, m, r = self.rows.get(name, (0, 0.0, 0.0))
        self.rows[name] = (n + len(wanted), max(m, metres), max(r, radians))

    def print(self):
        bad = False
        for name, (n, m, r) in self.rows.items():
            print(f"{name:42} {n:5} LiDARs  {m:.1e} m  {r:.1e} rad")
            bad |= max(m, r) > (1e-5 if "carla.T" in name else 1e-9)
        return bad


def exports(program, table):
    rng = np.random.default_rng(1)
    for n in range(60):
        lidars, base = random_rig(rng, n), rng.uniform(-2, 2, 3)
        frames = [f"lidar_{k}" for k in range(len(lidars))]
        wanted = [matrix(lidar) for lidar in lidars]
        with tempfile.TemporaryDirectory() as root:
            file = f"{root}/placements.json"
            json.dump({"placements": [{"name": "rig", "lidars": lidars}]}, open(file, "w"))
            at = "--base-link=" + ",".join(map(str, base))
            for name, form, reader, feet in WAYS:
                out = f"{root}/{form}"
                subprocess.run([program, "rig", "export", f"{file}:rig", "--format", form, at, "--quiet", "--out", out],
                               check=True)
                found = reader(out, frames)
                ego = compose(base, np.eye(3), [1] * 3)
                found = [ego @ f @ up(HEIGHTS[l.get("sensor")] if feet else 0) for f, l in zip(found, lidars)]
                table.add(name, found, wanted)


def read(program, folder, models, base):
    """Optical centres that `rig import` reads from Autoware's two files, and those of PyYAML and transforms3d."""
    at = "--base-link=" + ",".join(map(str, base))
    named = [word for frame, model in models.items() for word in ("--sensor", f"{frame}={model}")]
    told = subprocess.run([program, "rig", "import", folder, at, "--quiet", *named], check=True, capture_output=True)
    lidars = json.loads(told.stdout)["placements"][0]["lidars"]
    assert sorted(lidar["sensor"] for lidar in lidars) == sorted(models.values())
    ego = compose(base, np.eye(3), [1] * 3)
    wanted = {model: [] for model in HEIGHTS}
    for foot, model in zip(by_yaml(folder, models), models.values()):
        wanted[model].append(ego @ foot @ up(HEIGHTS[model]))
    found = [matrix(lidar) for lidar in lidars]
    # The order of the files is no matter: each is compared with the nearest of its model.
    return found, [min(wanted[l["sensor"]], key=lambda w: abs(w - f).max()) for f, l in zip(found, lidars)]


def imports(program, rigs, table):
    rng = np.random.default_rng(2)
    for n in range(60):
        feet = {f"lidar_{k}": {f: float(lidar[f]) for f in FIELDS} for k, lidar in enumerate(random_rig(rng, n))}
        kit = {f: float(random_rig(rng, 0)[0][f]) for f in FIELDS}
        with tempfile.TemporaryDirectory() as folder:
            for file, tree in (("sensors", {"base_link": {"sensor_kit_base_link": kit}}),
                               ("sensor_kit", {"sensor_kit_base_link": feet})):
                with open(f"{folder}/{file}_calibration.yaml", "w") as out:
                    yaml.safe_dump(tree, out)
            models = {frame: rng.choice(["VLP-16", "VLS-128"]) for frame in feet}
            table.add("Autoware read, a kit turned at random", *read(program, folder, models, rng.uniform(-2, 2, 3)))
    for which in ("before", "after"):
        folder = f"{rigs}/lexus/{which}"
        if not os.path.isdir(folder):
            print(f"no {folder}: left out")
            continue
        models = {f"velodyne_{side}_base_link": "VLP-16" for side in ("left", "right", "rear")}
        models["velodyne_top_base_link"] = "VLS-128"
        table.add(f"Lexus {which} read", *read(program, folder, models, [-1.395, 0, 0]))


def main(program, data):
    table = Table()
    exports(program, table)
    imports(program, f"{data}/rigs", table)
    sys.exit(int(table.print()))


main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else os.environ.get("SIGHTLINE_DATA", "../shared/data"))
