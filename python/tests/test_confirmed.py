"""``optimize … --confirm learned`` on a folder that holds a run: goes on, or refuses what the run is not of."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from sightline import _confirmed

from .conftest import SMALL

SETTINGS = {
    "objective": "near_gain", "method": "both", "evaluations": 180, "population": None, "delta": None, "seed": 3,
    "frames": "on-demand", "starts": [], "target": None,
    "baselines": [{"name": "a", "lidars": [{"x": 0.0, "y": 0.0, "z": 1.5}]}],
}  # fmt: skip


def begun(folder: Path, scene: Path, stopped: str | None = "budget", **changed: Any) -> Path:
    """What is compared of a run."""
    folder.mkdir()
    if stopped:
        (folder / "result.json").write_text(json.dumps({"stopped": stopped}))
    rules = {"equal_height": False, "symmetric": False, "fixed": []}
    state = {"begun": {"scene": str(scene), "mirror": True, "rules": rules, **changed}, "run": {"settings": SETTINGS}}
    inputs = [{"file": str(scene), "sha256": hashlib.sha256(scene.read_bytes()).hexdigest()}]
    (folder / "checkpoint.json").write_text(json.dumps({"inputs": inputs, "state": state}))
    return folder


def difference(run: Path, words: list[str]) -> str | None:
    return _confirmed.difference(run, *_confirmed.read(words))


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "s.json"
    path.write_text("{}")
    return path


def test_the_result_of_another_search_is_not_confirmed(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other, placed = tmp_path / "t.json", tmp_path / "b.json"
    other.write_text("{ }")
    placed.write_text(json.dumps({"placements": SETTINGS["baselines"]}))
    run = begun(tmp_path / "run", scene)
    start = ["optimize", "--mirror", str(scene), "--seed", "3"]
    same = ["--objective=near_gain", "--method", "both", "--fidelity", "auto", "--evaluations=180", "--baselines", str(placed), "--threads", "2"]
    assert difference(run, start) is None and difference(run, [*start, *same]) is None
    for words, says in (
        (["optimize", str(other)], "holds a run of"),
        ([*start, str(other)], "holds a run of"),
        ([*start, "--objective", "m_sog"], "holds a run with --objective near_gain, not m_sog; give another --out"),
        ([*start, "--near-weight", "0.1"], "holds a run with --near-weight null, not 0.1"),
        (["optimize", str(scene)], "holds a run with --mirror true, not false"),
        ([*start, "--symmetric"], "--symmetric false, not true"),
        ([*start, "--fix", "z=2.5"], '--fix [], not [["z", 2.5]]'),
        (["optimize", "--mirror", str(scene), "--seed=4"], "--seed 3, not 4"),
        ([*start, "--frames", "5"], "on-demand, not"),
        ([*start, "--delta", "0.2"], "--delta null, not"),
        ([*start, "--condition", "fog:mor=50"], "--condition [], not"),
        ([*start, "--evaluations", "12"], "--evaluations 180, not 12"),
        ([*start, "--method", "cma"], "--method both, not cma"),
        ([*start, "--baselines", "scenes/placements.json"], "holds a run with --baselines"),
        ([*start, "--vehicle", "scenes/vehicles/car.json"], "learners know scenes with one `lidar` and one `mount` as yet"),
    ):
        assert _confirmed.optimize([*words, "--out", str(run), "--confirm", "learned"]) == 2, says
        told = capsys.readouterr().err
        assert told.startswith("sightline: --confirm learned: ") and says in told and told.count("\n") == 1
    scene.write_text("{}\n")
    assert "as that was then" in (difference(run, start) or "")


def test_conditions_are_those_that_are_named(scene: Path, tmp_path: Path) -> None:
    run = begun(tmp_path / "run", scene, conditions=["fog:mor=50,albedo=0.5"], near_weight=0.1)
    start = ["optimize", "--mirror", str(scene), "--near-weight", "0.1"]
    assert difference(run, [*start, "--condition", "fog:mor=50.0"]) is None
    for other in ("fog:mor=40", "snow", "fog:mor=50,mode=x"):
        assert "--condition" in (difference(run, [*start, "--condition", other]) or "")
    assert "--condition" in (difference(run, start) or "")
    run = begun(tmp_path / "of-a-vehicle", scene, vehicle="car.json")
    assert "of the vehicle car.json" in (difference(run, start) or "")


def test_what_was_interrupted_goes_on(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    class Program:
        def __init__(self, words: list[str]) -> None:
            asked.append(words[3:])

        def wait(self) -> int:
            # Ctrl-C is heard by both.
            if len(asked) == 1 and not interrupted:
                interrupted.append(True)
                raise KeyboardInterrupt
            return 130

    interrupted: list[bool] = []
    monkeypatch.setattr(subprocess, "Popen", Program)
    words = ["optimize", str(scene), "--threads", "2", "--seed", "3", "--quiet", "--time=9"]
    _, options = _confirmed.read(words)
    assert _confirmed.search(tmp_path / "new", words, options) == 130
    run = begun(tmp_path / "run", scene, stopped="interrupted")
    assert not _confirmed.is_searched(run) and _confirmed.search(run, words, options) == 130
    assert asked == [
        [*words, "--out", str(tmp_path / "new")],
        ["optimize", "--resume", str(run), "--threads", "2", "--quiet", "--time", "9"],
    ]
    (run / "result.json").unlink()
    assert not _confirmed.is_searched(run)
    assert _confirmed.is_searched(begun(tmp_path / "whole", scene, stopped="time limit"))


SEARCH = """
import sys
from pathlib import Path
from sightline import _confirmed
words, run = sys.argv[2:], Path(sys.argv[1])
sys.exit(_confirmed.search(run, words, _confirmed.read(words)[1]))
"""


def test_ctrl_c_ends_a_generation_and_the_same_command_goes_on(tmp_path: Path) -> None:
    scene, run = tmp_path / "small.json", tmp_path / "run"
    scene.write_text(json.dumps(SMALL))
    words = ["optimize", str(scene), "--method", "cma", "--evaluations", "3000", "--threads", "1"]
    command = [sys.executable, "-c", SEARCH, str(run), *words]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True)
    while process.poll() is None and not (run / "checkpoint.json").is_file():
        time.sleep(0.01)
    # As a terminal does: to the whole group.
    os.killpg(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130 and "Traceback" not in told
    assert not _confirmed.is_searched(run)
    assert subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0
    assert _confirmed.is_searched(run)
