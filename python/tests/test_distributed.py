"""Scores from many actors are those of one process, whoever dies meanwhile."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

ray = pytest.importorskip("ray")

import sightline  # noqa: E402
from sightline import Scene, distributed  # noqa: E402

from .conftest import SMALL  # noqa: E402


@pytest.fixture(scope="module")
def scenes() -> list[Scene]:
    other = SMALL | {"name": "finer", "roi": SMALL["roi"] | {"voxel": [0.25, 0.25, 0.25]}}
    return [Scene.from_dict(scene, backend="cpu") for scene in (SMALL, other)]


@pytest.fixture(scope="module", autouse=True)
def cluster():
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    yield
    ray.shutdown()


def workers() -> list[int]:
    """Process numbers of the actors, not of the process that starts them."""
    found = subprocess.run(["pgrep", "-f", "^ray::_Worker"], capture_output=True, text=True)
    return [int(line) for line in found.stdout.split()]


def test_a_killed_worker_changes_no_byte_and_a_dead_driver_loses_none(
    scenes, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(distributed, "CHUNK_SECONDS", 0.1)
    poses = scenes[0].random_poses(1500, seed=3)
    one = [scene.score(poses) for scene in scenes]
    killed, told = [], []

    def progress(done) -> None:
        told.append(done)
        if done.done >= done.total // 4 and not killed:
            killed.append(workers()[0])
            os.kill(killed[0], signal.SIGKILL)

    many = distributed.score(
        scenes, poses, actors=2, threads=1, checkpoint=tmp_path / "kept", progress=progress
    )
    assert many == one
    assert killed and told[-1].lost == 1 and told[-1].done == told[-1].total == 3000
    # A driver that comes after finds all but what is taken away here.
    chunks = sorted((tmp_path / "kept").glob("*/*.npz"))
    chunks[1].unlink()
    told.clear()
    again = distributed.score(
        scenes, poses, actors=2, threads=1, checkpoint=tmp_path / "kept", progress=told.append
    )
    assert again == one
    assert told[0].done > 1500 and told[-1].done == 3000
    with pytest.raises(ValueError, match=r"was begun with other inputs \(poses\)"):
        distributed.score(scenes, poses + 0.01, checkpoint=tmp_path / "kept")


def test_phases_and_guards_are_those_of_one_process(tmp_path) -> None:
    body = [{"class": "vehicle", "box": {"min": [-2, -1, 0], "max": [2, 1, 1.4]}}]
    scenes = [Scene.from_dict(SMALL | {"ego": {"body": body}}, backend="cpu")]
    poses = scenes[0].random_poses(40, seed=3)
    phases = np.where(np.arange(40)[:, None] % 2, 0.05, np.nan)
    one = [scene.score(poses, phases=phases) for scene in scenes]
    kept = tmp_path / "kept"
    assert distributed.score(scenes, poses, phases=phases, actors=1, threads=1, checkpoint=kept) == one
    assert any("self_hit" in words for guards in one[0].guards for words in guards)
    with pytest.raises(ValueError, match=r"was begun with other inputs \(phases\)"):
        distributed.score(scenes, poses, checkpoint=kept)
    with pytest.raises(ValueError, match=r"phases: have the shape \[2\], where N is 40 and L is 1;"):
        distributed.score(scenes, poses, phases=[0.0, 0.0])


def test_searches_and_programs_are_spread(scenes) -> None:
    found = distributed.optimize(scenes[:1], seeds=(1, 2), actors=2, threads=1, evaluations=12)
    alone = sightline.optimize(scenes[0], seed=2, evaluations=12)
    assert [len(row) for row in found] == [2]
    assert found[0][1].best == alone.best
    score = ["score", "scenes/placements.json", "--frames", "1", "--backend", "cpu"]
    good, bad = distributed.run([["score", "scenes/highway.json", *score[1:]], score], actors=2, threads=1)
    assert good.code == 0 and "Ours-seg" in good.stdout
    assert bad.code == 2 and bad.stderr.startswith("sightline: ")


def test_what_is_wrong_is_said(scenes) -> None:
    with pytest.raises(ValueError, match="scenes: are none"):
        distributed.score([], np.zeros((1, 1, 6)))
    with pytest.raises(ValueError, match="is no score; there are near_gain"):
        distributed.optimize(scenes[:1], objective="gain", actors=1)


POSES = np.zeros((2, 1, 6))


@pytest.mark.parametrize(
    ("poses", "named"),
    [
        (np.zeros((2, 4, 5)), {}),
        (np.zeros(6), {}),
        (np.zeros((3, 17, 6)), {}),
        (np.where(np.arange(12).reshape(2, 1, 6) == 8, np.nan, 0.0), {}),
        (np.full((1, 6), np.inf), {}),
        (POSES.astype(complex), {}),
        (POSES.astype(bool), {}),
        (POSES.astype(str), {}),
        ([[1, 2], [3]], {}),
        (None, {}),
        (POSES, {"sensors": ["a", "b"]}),
        (POSES, {"phases": [0.0, 0.0]}),
        (POSES, {"phases": [1j]}),
        (POSES, {"phases": [[0.0], [np.inf]]}),
        (POSES, {"phases": [[0.0], [0.0, 1.0]]}),
    ],
)
def test_poses_are_refused_as_by_one_process(scenes, monkeypatch, tmp_path, poses, named) -> None:
    monkeypatch.setattr(distributed, "_pool", None)
    with pytest.raises(ValueError) as alone:
        scenes[0].score(poses, **named)
    with pytest.raises(ValueError) as spread:
        distributed.score(scenes, poses, checkpoint=tmp_path / "kept", **named)
    assert str(spread.value) == str(alone.value)
    assert not (tmp_path / "kept").exists()


def test_poses_of_any_real_type_are_taken(scenes) -> None:
    for poses in ([[0, 0, 2, 0, 0, 0]], np.float32([[[0, 0, 1.5, 0, 0, 0]]] * 2), np.zeros((0, 1, 6))):
        one = [scene.score(poses) for scene in scenes]
        assert distributed.score(scenes, poses, actors=1, threads=1) == one


def test_a_worker_that_dies_again_and_again_is_given_up(scenes, monkeypatch) -> None:
    class Dying(distributed._Worker):
        """Ends as a process does that the system kills; pickled by value, for it is local."""

        def optimize(self, scene, settings):
            os._exit(1)

    monkeypatch.setattr(distributed, "_Worker", Dying)
    told: list[distributed.Progress] = []
    with pytest.raises(RuntimeError, match=r"^optimize\(0, {'seed': 1}\): its worker was lost 5 times, .*fewer"):
        distributed.optimize(scenes[:1], actors=1, threads=1, progress=told.append)
    assert not told


def test_workers_that_die_before_they_stand_are_given_up(scenes, monkeypatch) -> None:
    class Stillborn(distributed._Worker):
        """Has not the memory that its scenes need."""

        def ready(self):
            os._exit(1)

    monkeypatch.setattr(distributed, "_Worker", Stillborn)
    with pytest.raises(RuntimeError, match="^workers: none is left; the last place lost 5 .*start fewer workers"):
        distributed.score(scenes, scenes[0].random_poses(20), actors=2, threads=1)


def test_workers_that_come_up_do_the_work_of_one_that_does_not(scenes, monkeypatch, tmp_path) -> None:
    class First(distributed._Worker):
        """Stands if no other does yet."""

        def ready(self):
            try:
                (tmp_path / "stands").mkdir()
            except FileExistsError:
                os._exit(1)
            super().ready()

    monkeypatch.setattr(distributed, "_Worker", First)
    monkeypatch.setattr(distributed, "CHUNK_SECONDS", 0.05)
    poses = scenes[0].random_poses(300, seed=2)
    told: list[distributed.Progress] = []
    spread = distributed.score(scenes, poses, actors=2, threads=1, progress=told.append)
    assert spread == [scene.score(poses) for scene in scenes]
    assert told[-1].workers == 1


def test_a_scene_that_differs_elsewhere_is_refused(tmp_path, monkeypatch) -> None:
    file = tmp_path / "small.json"
    file.write_text(json.dumps(SMALL))
    scene = Scene.load(file, backend="cpu")
    put = ray.put

    def put_then_change(value):
        file.write_text(json.dumps(SMALL | {"rate": 7}))
        return put(value)

    monkeypatch.setattr(distributed.ray, "put", put_then_change)
    with pytest.raises(ValueError, match="^.*small.json: is not the file that the scene was read from"):
        distributed.score([scene], scene.random_poses(20), actors=1, threads=1)


HUNGRY = """
import resource, sys, sightline
scene = sightline.Scene.load("scenes/industrial-yard.json", backend="cpu", frames=1)
scene.psog
now = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (now + (int(sys.argv[1]) << 20),) * 2)
try:
    scene.score(scene.random_poses(64))
except (MemoryError, OSError) as error:
    print(repr(error))
"""


def test_a_process_without_memory_ends_with_a_sentence() -> None:
    """Python's MemoryError, or the end of the process with the library's sentence: never a crash."""
    said = set()
    for megabytes in (0, 20, 60):
        child = subprocess.run(
            [sys.executable, "-c", HUNGRY, str(megabytes)],
            capture_output=True, text=True, timeout=120,
        )  # fmt: skip
        assert child.returncode in (0, 2), child.stderr
        said.add(child.stdout or child.stderr)
    assert sum("memory" in words.lower() for words in said) >= 2, said
