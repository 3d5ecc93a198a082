"""A driver that is killed loses only what was in hand; the same call goes on to the same bytes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ray = pytest.importorskip("ray")

import sightline  # noqa: E402
from sightline import Placement, Result, Scene, distributed  # noqa: E402

from .conftest import SMALL  # noqa: E402

SCORE = "distributed.score([scene], scene.random_poses(20_000, seed=1), **more)"
SEARCH = "distributed.optimize([scene], seeds=range(1, 9), evaluations=12, **more)"

DRIVER = """
import sys
import ray
from sightline import Scene, distributed
address, file, folder, call = sys.argv[1:]
ray.init(address=address, log_to_driver=False, logging_level="ERROR")
distributed.CHUNK_SECONDS = 0.05
scene = Scene.load(file, backend="cpu")
tell = lambda told: print(told.done, flush=True)
more = dict(actors=2, threads=1, checkpoint=folder, progress=tell)
eval(call)
"""


@pytest.fixture(scope="module", autouse=True)
def cluster():
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    yield
    ray.shutdown()


@pytest.fixture
def scene(tmp_path) -> Scene:
    file = tmp_path / "small.json"
    file.write_text(json.dumps(SMALL))
    return Scene.load(file, backend="cpu")


def killed(call: str, folder: Path, least: int) -> int:
    """Runs a call in a process of its own, kills that with ``least`` done, and returns what it said was done."""
    address = ray.get_runtime_context().gcs_address
    driver = [sys.executable, "-c", DRIVER, address, str(folder / "small.json"), str(folder / "kept"), call]
    child = subprocess.Popen(driver, stdout=subprocess.PIPE, text=True)
    try:
        done = next((int(line) for line in child.stdout if int(line) >= least), 0)
        os.kill(child.pid, signal.SIGKILL)
    finally:
        child.kill()
        child.communicate()
    assert done >= least and child.returncode == -signal.SIGKILL
    return done


def gone_on(call: str, folder: Path, scene: Scene, done: int):
    """Repeats the call here, which does again nothing that was done."""
    before = {file: file.stat().st_mtime_ns for file in folder.glob("kept/*/*.npz")}
    told: list[distributed.Progress] = []
    more = dict(actors=2, threads=1, checkpoint=folder / "kept", progress=told.append)
    found = eval(call, {"distributed": distributed, "scene": scene, "more": more})
    assert told and told[0].done > done and told[-1].done == told[-1].total
    assert before and all(file.stat().st_mtime_ns == time for file, time in before.items())
    return found


def content(result: Result) -> tuple:
    """All but how fast it was, and on how many threads."""
    record = {key: value for key, value in result.record.items() if key not in ("rate", "timings", "threads")}
    return result.best, result.baselines, result.scores, result.history, record


def test_scores_of_a_killed_driver_are_gone_on_with(scene, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(distributed, "CHUNK_SECONDS", 0.05)
    done = killed(SCORE, tmp_path, least=4_000)
    assert done < 20_000
    assert gone_on(SCORE, tmp_path, scene, done) == [scene.score(scene.random_poses(20_000, seed=1))]


def test_searches_of_a_killed_driver_are_gone_on_with(scene, tmp_path) -> None:
    done = killed(SEARCH, tmp_path, least=1)
    assert done < 8
    found = gone_on(SEARCH, tmp_path, scene, done)
    alone = [sightline.optimize(scene, seed=seed, evaluations=12) for seed in range(1, 9)]
    assert [[content(result) for result in row] for row in found] == [[content(result) for result in alone]]


def test_a_checkpoint_of_other_searches_is_refused(scene, tmp_path) -> None:
    # NaN stands for the LiDAR of the two that is not locked.
    start = Placement([[0.0, 0, 1.6, 0, 0, 0]] * 2, phases=[0.1, float("nan")])
    more = dict(actors=1, threads=1, evaluations=12, baselines=[start], checkpoint=tmp_path / "kept")
    first = distributed.optimize([scene], seeds=[1], **more)
    told: list[distributed.Progress] = []
    again = distributed.optimize([scene], seeds=[1], progress=told.append, **more)
    # Bits are the same, those of the record's seconds too, and nothing was searched again.
    assert again[0][0].record == first[0][0].record and content(again[0][0]) == content(first[0][0])
    assert again[0][0].baselines == [start] and not told
    changes = (({"seeds": [2]}, "seeds"), ({"evaluations": 24}, "settings"), ({"baselines": []}, "settings"))
    for change, named in changes:
        with pytest.raises(ValueError, match=rf"was begun with other inputs \({named}\); give them, or another folder"):
            distributed.optimize([scene], **({"seeds": [1]} | more | change))
    with pytest.raises(ValueError, match=r"was begun with other inputs \(.*poses"):
        distributed.score([scene], scene.random_poses(20), checkpoint=tmp_path / "kept")
    with pytest.raises(ValueError, match="callback: cannot travel"):
        distributed.optimize([scene], callback=print)


def test_commands_that_could_not_be_done_are_tried_again(tmp_path) -> None:
    info, absent = ["scene", "info", "scenes/highway.json"], ["scene", "info", str(tmp_path / "late.json")]
    more = dict(actors=1, checkpoint=tmp_path / "kept")
    good, bad = distributed.run([info, absent], **more)
    assert (good.code, bad.code) == (0, 2)
    (tmp_path / "late.json").write_text(json.dumps(SMALL))
    told: list[distributed.Progress] = []
    again = distributed.run([info, absent], progress=told.append, **more)
    assert again[0] == good and again[1].code == 0 and again[1].arguments == absent
    assert [(at.done, at.total) for at in told] == [(2, 2)]
    with pytest.raises(ValueError, match=r"was begun with other inputs \(commands\)"):
        distributed.run([info], **more)


def test_a_plan_that_was_cut_off_is_begun_again(tmp_path) -> None:
    folder = tmp_path / "kept"
    folder.mkdir()
    (folder / "plan.part").write_text("{")
    assert distributed.run([["--version"]], actors=1, checkpoint=folder)[0].code == 0
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "notes.txt").touch()
    with pytest.raises(ValueError, match="is not empty and no checkpoint; give a new folder"):
        distributed.run([["--version"]], checkpoint=tmp_path / "full")
