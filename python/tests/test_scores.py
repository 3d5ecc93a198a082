"""Scores are those of the program, to the bit, however placements come."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import sightline
from sightline import Scene, Scores


def program(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sightline", *arguments], capture_output=True, text=True, timeout=300
    )


def test_scores_are_those_of_the_program(scene, placements) -> None:
    done = program(
        "score", "scenes/industrial-yard.json", "scenes/placements.json",
        "--frames", "4", "--backend", "cpu", "--format", "json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    theirs = json.loads(done.stdout)["scores"]
    ours = scene.score(placements)
    assert ours.names == [row["name"] for row in theirs]
    for column in ("m_sog", "m_sog_scaled", "information_gain", "near_gain_2", "near_gain_3", "s_mig", "covered", "beams",
                   "hit_share"):
        assert ours[column].tolist() == [row[column] for row in theirs], column
    detection = ours["detection.information_gain"].tolist()
    assert detection == [row["detection"]["information_gain"] for row in theirs]
    counts = [[row["covered_by_class"][name] for name in ours.classes] for row in theirs]
    assert ours["covered_by_class"].tolist() == counts
    assert ours["unique_share"].tolist() == [row["unique_share"] for row in theirs]


def test_placements_that_look_at_the_own_vehicle_are_told_as_the_program_tells_them(tmp_path: Path) -> None:
    low = sightline.Placement([[0.0, 0.0, 1.2, 0.0, 0.0, 0.0]], name="low")
    high = sightline.Placement([[0.0, 0.0, 2.4, 0.0, 0.0, 0.0]], name="high")
    (tmp_path / "two.json").write_text(json.dumps({"placements": [low.to_dict(), high.to_dict()]}))
    done = program(
        "score", "scenes/industrial-yard.json", str(tmp_path / "two.json"),
        "--frames", "1", "--backend", "cpu", "--format", "json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    theirs = [row["guards"] for row in json.loads(done.stdout)["scores"]]
    scene = Scene.load("scenes/industrial-yard.json", backend="cpu", frames=1)
    ours = scene.score([low, high]).guards
    assert ours == theirs
    assert any("self_hit" in words for words in ours[0]) and not any("self_hit" in words for words in ours[1])
    # The near field is there where it is asked for, and lower mounts see less of it.
    near = scene.score([low, high], near_field=True)
    assert near["near_field"][0] < near["near_field"][1] <= 1 and "near_ring" in near and "near_field" not in scene.score(low)
    # Many placements are not looked at unless that is asked for.
    many = np.repeat(low.poses[None], 65, axis=0)
    assert not any("self_hit" in words for guards in scene.score(many).guards for words in guards)
    assert any("self_hit" in words for words in scene.score(many, self_hits=True).guards[64])
    assert not any("self_hit" in words for words in scene.score(low, self_hits=False).guards[0])


def test_arrays_of_any_layout_give_the_same_bits(scene, placements) -> None:
    poses = np.stack([placement.poses for placement in placements])
    expected = scene.score(placements)
    strided = np.zeros((22, 4, 12))
    strided[::2, :, ::2] = poses
    frozen = poses.copy()
    frozen.flags.writeable = False
    for given in (poses, np.asfortranarray(poses), strided[::2, :, ::2], frozen, poses.tolist(), poses[::-1][::-1]):
        assert scene.score(given)["information_gain"].tobytes() == expected["information_gain"].tobytes()
    # A pose in f32 is another pose; it is taken as it is.
    single = scene.score(poses.astype(np.float32))
    widened = scene.score(poses.astype(np.float32).astype(np.float64))
    assert single == widened
    whole = scene.score(np.zeros((1, 2, 6), dtype=np.int32) + [0, 0, 2, 0, 0, 0])
    assert whole["information_gain"][0] > 0


def test_chunks_change_nothing(scene) -> None:
    poses = scene.random_poses(40, seed=5)
    together = scene.score(poses)
    parts = Scores.concatenate(scene.score(poses[k : k + 13]) for k in range(0, 40, 13))
    parts.names = together.names
    assert together == parts
    assert together != scene.score(poses[::-1])


def test_a_placement_that_covers_nothing_has_no_scores(scene) -> None:
    scores = scene.score([[0, 0, -50, 0, 0, 0]])
    assert np.isnan(scores["information_gain"][0])
    assert scores.guards[0]


def test_scores_become_tables(scene, placements) -> None:
    scores = scene.score(placements)
    frame = scores.to_pandas()
    assert list(frame.index) == [placement.name for placement in placements]
    assert frame["information_gain"].to_numpy().tolist() == scores["information_gain"].tolist()
    assert f"covered_by_class.{scores.classes[0]}" in frame
    with pytest.raises(KeyError, match="`gain` is no score; there are m_sog"):
        scores["gain"]


def test_a_suite_is_the_mean_of_its_scenes(scene, placements) -> None:
    other = Scene.load("scenes/highway.json", backend="cpu", frames=3)
    together = sightline.Suite([scene, other]).score(placements)
    shares = [one.score(placements)["information_gain_share"] for one in (scene, other)]
    np.testing.assert_allclose(together["information_gain_share"], np.mean(shares, axis=0), rtol=1e-12)


def test_what_workers_need_is_pickled(scene, placements) -> None:
    expected = scene.score(placements)
    assert pickle.loads(pickle.dumps(scene)).score(placements) == expected
    assert pickle.loads(pickle.dumps(expected)) == expected
    assert pickle.loads(pickle.dumps(placements)) == placements
    mixed = sightline.Placement([[0, 0, 2, 0, 0, 0]] * 2, name="mixed", sensors=["a", ""])
    assert pickle.loads(pickle.dumps(mixed)) == mixed
    locked = sightline.Placement([[0, 0, 2, 0, 0, 0]] * 2, phases=[0.01, np.nan])
    assert pickle.loads(pickle.dumps(locked)) == locked and locked != mixed
    psog = pickle.loads(pickle.dumps(scene.psog))
    assert psog.counts.tobytes() == scene.psog.counts.tobytes()
    vehicle = sightline.Vehicle.load("scenes/vehicles/car.json")
    assert pickle.loads(pickle.dumps(vehicle)).name == vehicle.name


def test_a_scene_whose_file_has_changed_is_refused(tmp_path: Path, small) -> None:
    _, text, *_ = small.__reduce__()[1]
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(text))
    sent = pickle.dumps(Scene.load(file))
    file.write_text(json.dumps(text | {"name": "other"}))
    with pytest.raises(ValueError, match="is not the file that the scene was read from"):
        pickle.loads(sent)


def test_a_vehicle_names_its_models() -> None:
    scene = Scene.load(
        "scenes/urban-crossing.json", vehicle="scenes/vehicles/car.json", frames=1, backend="cpu"
    )
    vehicle = sightline.Vehicle.load("scenes/vehicles/car.json")
    assert set(scene.sensors) == set(vehicle.sensors) == set(vehicle.prices)
    model = next(iter(vehicle.sensors))
    scores = scene.score([[0, 0, 2, 0, 0, 0]], sensors=[model])
    assert scores["beams"][0] == len(vehicle.sensors[model])
    with pytest.raises(ValueError, match="nope"):
        scene.score([[0, 0, 2, 0, 0, 0]], sensors=["nope"])


def test_phases_lock_lidars_as_a_placement_file_does(scene) -> None:
    pose, step = [0.3, 0.2, 2.3, 0.1, 0.0, 0.2], 2 * np.pi / 250
    free, locked = sightline.Placement([pose] * 2), sightline.Placement([pose] * 2, phases=[np.nan, 0.4 * step])
    assert "phase" not in locked.to_dict()["lidars"][0] and locked.to_dict()["lidars"][1]["phase"] == 0.4 * step
    assert np.isnan(locked.phases[0]) and locked.phases[1] == 0.4 * step and np.isnan(free.phases).all()
    # Beams of a locked LiDAR are turned about its own axis, in casts and scores.
    turned = scene.cast(locked)["direction"].reshape(2, -1, 3)
    plain = scene.cast(free)["direction"].reshape(2, -1, 3)
    assert (turned[0] == plain[0]).all() and (turned[1] != plain[1]).any()
    expected = scene.score([free, locked])
    assert expected["information_gain"][0] < expected["information_gain"][1]
    poses = np.array([[pose] * 2] * 2)
    both = scene.score(poses, phases=[[np.nan, np.nan], [np.nan, 0.4 * step]])
    assert both["information_gain"].tobytes() == expected["information_gain"].tobytes()
    one = scene.score(poses, phases=[np.nan, 0.4 * step])
    assert (one["information_gain"] == expected["information_gain"][1]).all()
    suite = sightline.Suite([scene])
    assert suite.score(poses[:1], phases=[np.nan, 0.4 * step])["information_gain"][0] == one["information_gain"][0]
    with pytest.raises(ValueError, match=r"phases: have the shape \[3\], where N is 2 and L is 2"):
        scene.score(poses, phases=[0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="phase = inf is not usable"):
        scene.score(poses, phases=[0.0, np.inf])
    with pytest.raises(ValueError, match="phases: a Placement has its own"):
        scene.score(locked, phases=[0.0, 0.0])


def test_the_engine_agrees_with_the_reference(scene, placements) -> None:
    found = scene.verify(placements[:2], sample=2000)
    assert found["passed"] and found["cpu_against_f64"]["beams"] > 0
    assert found["gpu_against_cpu"]["beams"] == 2 * 4 * 4000


def test_a_device_gives_the_same_bits(placements) -> None:
    def scores(backend: str) -> Scores:
        scene = Scene.load("scenes/highway.json", frames=1, backend=backend)
        return scene.score(placements[:2])

    try:
        on_device = scores("gpu")
    except OSError as error:
        # Where a device has to be there, its absence is a fault.
        assert not os.environ.get("EXPECT_ADAPTER"), error
        pytest.skip(str(error))
    assert on_device == scores("cpu")


def test_arrays_are_handed_on_without_a_copy(scene, placements) -> None:
    column = scene.score(placements)["information_gain"]
    assert np.shares_memory(np.from_dlpack(column), column)
    scan = next(scene.scan(placements[0]))
    assert np.shares_memory(np.from_dlpack(scan.xyz), scan.xyz) and scan.xyz.flags.c_contiguous


def test_the_program_answers(tmp_path: Path) -> None:
    assert "Usage: sightline" in program("--help").stdout
    wrong = program("score", "nowhere.json", "scenes/placements.json")
    assert wrong.returncode == 2 and wrong.stderr.startswith("sightline: nowhere.json: ")


AWAY = """
import pickle, sys
scene, suite, sensor, vehicle, space = pickle.load(sys.stdin.buffer)
poses = [[0, 0, 2, 0, 0, 0]]
names = ["spinning-32"]
print(scene.score(poses, sensors=names)["near_gain"][0], suite.score(poses, sensors=names)["near_gain"][0],
      len(sensor), vehicle.name, space.dim)
"""


def test_pickles_are_read_in_another_folder(tmp_path: Path) -> None:
    scene = Scene.load("scenes/highway.json", vehicle="scenes/vehicles/car.json", frames=1, backend="cpu")
    vehicle, sensor = sightline.Vehicle.load("scenes/vehicles/car.json"), scene.sensors["spinning-32"]
    sent = pickle.dumps((scene, sightline.Suite([scene]), sensor, vehicle, scene.space()))
    done = subprocess.run([sys.executable, "-c", AWAY], input=sent, capture_output=True, cwd=tmp_path, timeout=100)
    assert done.returncode == 0, done.stderr.decode()
    poses, names = [[0, 0, 2, 0, 0, 0]], ["spinning-32"]
    gain = scene.score(poses, sensors=names)["near_gain"][0]
    told = [gain, gain, len(sensor), vehicle.name, scene.space().dim]
    assert done.stdout.decode().split() == [str(value) for value in told]


def test_tensors_that_need_gradients_and_those_of_dlpack_alone_are_poses(scene) -> None:
    poses = scene.random_poses(2)

    class Graph:
        """Like a tensor of PyTorch that needs a gradient: NumPy takes it once it is detached."""

        def __array__(self, *_, **__):
            raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")

        def detach(self):
            return poses

    class Exported:
        """Like a tensor of Open3D or JAX: memory by DLPack, and no `__array__`."""

        def __dlpack__(self, **options):
            return poses.__dlpack__(**options)

        def __dlpack_device__(self):
            return poses.__dlpack_device__()

    expected = scene.score(poses)
    assert scene.score(Graph()) == expected and scene.score(Exported()) == expected
