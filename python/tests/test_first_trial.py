"""Faults that a newcomer met, one test each, and those of their kind."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import sightline
from sightline import Scene

CAR = "scenes/vehicles/car.json"

FORKED = """
import multiprocessing, sys
from concurrent.futures import ProcessPoolExecutor
import numpy as np
import sightline

scene = sightline.Scene.load("scenes/highway.json", backend="cpu", frames=2)
poses = scene.random_poses(4)
own = scene.score(poses)["near_gain"]

def score(k):
    scan = next(scene.scan(poses[k], frames=[0]))
    return scene.score(poses[k : k + 1])["near_gain"][0], len(scan), len(scene.psog.entropy())

with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")) as pool:
    found = list(pool.map(score, range(4)))
assert [gain for gain, _, _ in found] == own.tolist(), found
assert all(points > 1000 and voxels for _, points, voxels in found), found
"""


def test_a_fork_after_work_scores_and_scans(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", FORKED], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]


FORKED_OFTEN = """
import os, time
from sightline import Scene

scene = Scene.load("scenes/highway.json", backend="cpu", frames=1)
poses = scene.random_poses(1)
scene.score(poses)
child = os.fork()
if child == 0:
    for _ in range(40):
        scene.score(poses)
    # Threads of calls end soon after them.
    for _ in range(100):
        left = len(os.listdir("/proc/self/task"))
        if left < 20:
            os._exit(0)
        time.sleep(0.05)
    os._exit(1)
os._exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""


def test_calls_of_a_fork_leave_no_threads() -> None:
    done = subprocess.run([sys.executable, "-c", FORKED_OFTEN], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]


FORKED_AT_WORK = """
import os, sys, threading, time
import sightline


def scores(scene):
    poses = scene.random_poses(3000)
    scene.score(poses[:1])
    return lambda few: scene.score(poses[:1] if few else poses)


def casts(scene):
    # Six frames in turn: none of them is among the four that are kept.
    ray = [[0, 0, 2, 1, 0, 0]]
    return lambda few: [scene.cast_rays(ray, frame=k % 6) for k in range(1 if few else 100_000)]


scene = sightline.Scene.load("scenes/highway.json", backend="cpu", frames=2)
work = {"scores": scores, "casts": casts}[sys.argv[1]](scene)
busy = threading.Thread(target=work, args=(False,), daemon=True)
busy.start()
time.sleep(0.3)
child = os.fork()
if child == 0:
    try:
        work(True)
        # Between two casts nothing is held: such a fork may work.
        os._exit(1 if sys.argv[1] == "scores" else 0)
    except RuntimeError as error:
        os._exit(0 if "`spawn`" in str(error) else 2)
code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
os._exit(code)
"""


@pytest.mark.parametrize("work", ["scores", "casts"])
def test_a_fork_while_the_scene_is_at_work_is_told_what_to_do(work: str) -> None:
    done = subprocess.run([sys.executable, "-c", FORKED_AT_WORK, work], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize("name", ["highway", "urban-crossing", "residential", "industrial-yard"])
def test_random_poses_keep_the_least_distance(name: str) -> None:
    poses = Scene.load(f"scenes/{name}.json").random_poses(2000)
    places = poses[:, :, :3]
    apart = [np.linalg.norm(places[:, a] - places[:, b], axis=1) for a, b in combinations(range(4), 2)]
    assert np.min(apart) >= 0.2
    # The mount is still drawn from as a whole.
    assert np.ptp(places[..., 0]) > 1


def test_random_poses_keep_out_of_boxes(small) -> None:
    _, described, *_ = small.__reduce__()[1]
    mount = described["mount"] | {"keep_out": [{"min": [-0.5, -0.5, 1.5], "max": [0.5, 0.0, 2.0]}]}
    scene = Scene.from_dict(described | {"mount": mount})
    y = scene.random_poses(500)[:, 0, 1]
    assert y.min() >= 0 and y.max() > 0.4
    with pytest.raises(ValueError, match="widen the mount, or lower min_distance"):
        mount = described["mount"] | {"lidars": 16, "min_distance": 0.95}
        Scene.from_dict(described | {"mount": mount}).random_poses(1)


def test_poses_of_several_models_need_their_names() -> None:
    scene = Scene.load("scenes/highway.json", vehicle=CAR, frames=1, backend="cpu")
    space = scene.space()
    poses = scene.random_poses(2)
    with pytest.raises(ValueError, match="LiDAR 0 names no sensor, and the vehicle has 3 models"):
        scene.score(poses)
    beams = sum(len(scene.sensors[name]) for name in space.sensors)
    assert scene.score(poses, sensors=space.sensors)["beams"].tolist() == [beams] * 2


def test_small_degrees_are_doubted(scene) -> None:
    poses = sightline.published()[0].poses
    poses[:, 4] = 5
    with pytest.warns(sightline.DoubtWarning, match="pitch = 5 rad is 286°"):
        scene.score(poses)


def test_scores_are_no_array_and_a_table_of_columns(scene, placements) -> None:
    pandas = pytest.importorskip("pandas")
    scores = scene.score(placements[:3])
    with pytest.raises(TypeError, match=r'take one, scores\["near_gain"\]'):
        np.asarray(scores)
    with pytest.raises(TypeError):
        np.array([scores, scores], dtype=float)
    one = {name: values for name, values in scores.items() if values.ndim == 1}
    assert pandas.DataFrame(one)["near_gain"].tolist() == scores["near_gain"].tolist()


@pytest.mark.parametrize(
    "call",
    [
        "scene.random_poses(-1)", "scene.space().random(-1)", "scene.mesh(-1)", "scene.scan(POSE, frames=[-1])",
        "scene.scan(POSE, frames=-1)", "Scene.load('scenes/highway.json', frames=-1)",
        "scene.tolerance(POSE, steps=-1)", "scene.tolerance(POSE, steps=10**40)", "scene.raycaster(-1)",
        "sightline.optimize(scene, frames=-1)", "sightline.optimize(scene, evaluations=0)",
    ],
)  # fmt: skip
def test_negative_counts_are_value_errors(small, call: str) -> None:
    names = {"scene": small, "POSE": [[0, 0, 1.5, 0, 0, 0]], "Scene": Scene, "sightline": sightline}
    with pytest.raises(ValueError):
        eval(call, names)


def test_missing_files_have_number_and_name(tmp_path: Path) -> None:
    missing = str(tmp_path / "nowhere.json")
    for read in (Scene.load, sightline.read_placements, sightline.Vehicle.load, sightline.Sensor.load, sightline.Psog.load):
        with pytest.raises(FileNotFoundError) as raised:
            read(missing)
        assert (raised.value.errno, raised.value.filename) == (errno.ENOENT, missing), read
        assert "cannot be read" in str(raised.value) or "No such file" in str(raised.value)
    with pytest.raises(FileNotFoundError) as raised:
        Scene.load("scenes/highway.json").beams_on([[0, 0, 2, 0, 0, 0]], [missing], [10], [0])
    assert (raised.value.errno, raised.value.filename) == (errno.ENOENT, missing)
    for read in (Scene.load, sightline.read_placements):
        with pytest.raises(IsADirectoryError) as raised:
            read(tmp_path)
        assert raised.value.filename == str(tmp_path)


def test_a_file_that_another_one_names_is_named(tmp_path: Path, small) -> None:
    _, described, *_ = small.__reduce__()[1]
    flat = {key: described[key] for key in ("sightline", "roi", "lidar", "mount")} | {"psog": {"file": "gone.npz"}}
    with pytest.raises(FileNotFoundError) as raised:
        Scene.from_dict(flat, folder=tmp_path).psog
    assert raised.value.filename == str(tmp_path / "gone.npz")


def test_a_result_counts_all_that_was_looked_at(small) -> None:
    result = sightline.optimize(small, evaluations=30, tolerance=None)
    drawn, swapped = (method["evaluations"] for method in result.record["methods"][:2])
    assert swapped > 0 and f"cma-es {drawn}, swaps {swapped}" in repr(result)


def test_frames_mean_how_many_or_which(small) -> None:
    few = Scene.load("scenes/highway.json", frames=4)
    assert few.frames == 20 and few.scored_frames == [0, 5, 10, 15]
    assert repr(few) == "Scene('highway', 20 frames, scores over 4)".replace("'", '"')
    assert small.scored_frames == [0, 1] and "scores" not in repr(small)
    assert repr(sightline.Suite([small, small])) == "Suite(2 scenes: small, small; 4 frames)"
    assert repr(sightline.Suite(few)) == "Suite(1 scene: highway; 20 frames, scores over 4)"
    poses = [[0, 0, 1.5, 0, 0, 0]]
    scanned = [[scan.frame for scan in small.scan(poses, frames=frames)] for frames in (None, 1, 2, [1], [1, 0])]
    assert scanned == [[0, 1], [0], [0, 1], [1], [1, 0]]
    assert sightline.optimize(small, evaluations=12, frames=1, tolerance=None).best is not None


def test_one_default_seed(small) -> None:
    pose, snow = [[0, 0, 1.5, 0, 0, 0]], ["snow:rate=2"]
    default, one = (next(small.scan(pose, conditions=snow, **seed)) for seed in ({}, {"seed": 1}))
    assert default.xyz.tobytes() == one.xyz.tobytes()
    assert (small.random_poses(5) == small.random_poses(5, seed=1)).all()
    assert (small.random_poses(5) == small.space().random(5)).all()


def test_alternating_frames_are_each_cast_into() -> None:
    """More frames than are kept, in turns: each ray meets what it meets in a scene that was asked for one frame."""
    turns = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    ones = np.ones_like(turns)
    rays = np.column_stack([0 * ones, 0 * ones, 2 * ones, np.cos(turns), np.sin(turns), -0.05 * ones])

    def met(scene: Scene, frame: int) -> bytes:
        return scene.cast_rays(rays, frame=frame)["t_hit"].tobytes()

    alone = [met(Scene.load("scenes/highway.json", backend="cpu"), frame) for frame in range(6)]
    assert len(set(alone)) == 6
    scene = Scene.load("scenes/highway.json", backend="cpu")
    for frame in [0, 1, 0, 1, 2, 3, 4, 5, 0, 5, 1]:
        assert met(scene, frame) == alone[frame]


def test_scans_have_signed_labels(small) -> None:
    scan = next(small.scan([[0, 0, 1.5, 0, 0, 0]], conditions=["snow:rate=10"], frames=[0]))
    labels = scan.labels()
    assert labels.dtype == np.int64 and labels.min() == -1
    assert ((labels == -1) == (scan.class_id == 65535)).all()
    known = labels >= 0
    assert (labels[known] == scan.class_id[known]).all() and (scan.labels(ignore=255) == 255).sum() == (~known).sum()


def test_the_examples_say_how_they_are_called() -> None:
    done = subprocess.run([sys.executable, "python/examples/quickstart.py"], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("usage: ") and "Traceback" not in done.stderr
