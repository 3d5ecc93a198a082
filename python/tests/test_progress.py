"""How far long calls are: bars, records of logging, functions; nothing where nobody asked."""

from __future__ import annotations

import fcntl
import logging
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

import numpy as np
import pytest

import sightline
from sightline import Progress, _progress

from .conftest import POSE


def of_work(seen: list[Progress], work: str) -> list[Progress]:
    """Steps of one kind of work, which rise to the last of them."""
    steps = [step for step in seen if step.work == work]
    assert steps and steps == sorted(steps, key=lambda step: step.done)
    assert steps[-1].done == steps[-1].total and all(0 <= step.done <= step.total for step in steps)
    return steps


def test_a_function_is_told_to_the_last_placement(scene) -> None:
    seen: list[Progress] = []
    poses = scene.random_poses(60)
    told = scene.score(poses, progress=seen.append)
    steps = of_work(seen, "placements")
    assert steps[-1].total == 60
    assert len(steps) < 3 or 0 < steps[1].seconds_left < 60
    assert told == scene.score(poses, progress=False)


@pytest.mark.parametrize(
    ("call", "work", "total"),
    [
        (lambda scene, seen: sightline.Suite([scene]).score(scene.random_poses(3), progress=seen), "placements", 3),
        (lambda scene, seen: scene.sweep(POSE, "0.pitch", [0.0, 5.0], progress=seen), "values", 3),
        (lambda scene, seen: scene.losses([[*POSE[0][:2], z, *POSE[0][3:]] for z in (2.0, 2.5)], progress=seen), "parts of the scores", 1),
        (lambda scene, seen: scene.verify(POSE, sample=10, progress=seen), "placements compared", 1),
    ],
)  # fmt: skip
def test_every_long_call_tells_of_its_steps(small, call, work: str, total: int) -> None:
    seen: list[Progress] = []
    call(small, seen.append)
    assert of_work(seen, work)[-1].total == total


def test_rays_are_counted(small, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(_progress, "DELAY", 0.0)
    caplog.set_level("INFO", "sightline")
    rays = np.zeros((4_000_000, 6), dtype=np.float32)
    rays[:, 2], rays[:, 3] = 1.0, 1.0
    begun = time.monotonic()
    small.cast_rays(rays, normals=True)
    # A look is taken each tenth of a second.
    assert time.monotonic() - begun < 0.3 or any("rays: " in record.message and " of 4000000, " in record.message for record in caplog.records)


def test_a_recording_counts_scans(small, tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    seen: list[Progress] = []
    placements = [sightline.Placement(POSE, name="low"), sightline.Placement(POSE, name="high")]
    small.to_mcap(placements, tmp_path / "a.mcap", progress=seen.append)
    assert [(step.work, step.done, step.total) for step in seen] == [("scans", k, 4) for k in range(5)]
    seen.clear()
    small.to_mcap(placements, tmp_path / "a.mcap", frames=[1], progress=seen.append)
    assert seen[-1].done == seen[-1].total == 2


def test_a_search_and_a_front_tell_of_each_kind_of_work(scene) -> None:
    seen: list[Progress] = []
    result = sightline.optimize(scene, evaluations=24, progress=seen.append)
    assert result.best is not None
    works = [step.work for step in seen]
    assert len(set(works)) > 1 and all(works)
    assert {step.done <= step.total for step in seen} == {True}


def test_an_exception_of_the_function_ends_the_call(scene) -> None:
    def enough(_: Progress) -> None:
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        scene.score(scene.random_poses(10_000), progress=enough)
    with pytest.raises(RuntimeError, match="enough") as caught:
        sightline.optimize(scene, evaluations=100_000, progress=enough)
    assert caught.value.result.best is not None


@pytest.mark.parametrize("wrong", [3, "yes", [True]])
def test_other_arguments_are_refused(small, tmp_path: Path, wrong: object) -> None:
    for call in (
        lambda: small.score(POSE, progress=wrong),
        lambda: sightline.optimize(small, progress=wrong),
        lambda: small.to_mcap(sightline.Placement(POSE), tmp_path / "a.mcap", progress=wrong),
    ):
        with pytest.raises(ValueError, match="progress: is .*; give True, False, None or a function"):
            call()
    assert list(tmp_path.iterdir()) == []


def told(progress: object, at: list[float], monkeypatch: pytest.MonkeyPatch) -> _progress.Reporter:
    """A reporter by a clock that stands still: ``at[0]`` is its time."""
    monkeypatch.setattr(time, "monotonic", lambda: at[0])
    return _progress.Reporter(progress)


def test_records_come_after_two_seconds_and_every_ten(monkeypatch, caplog) -> None:
    at = [100.0]
    monkeypatch.setattr(_progress, "_is_watched", lambda: False)
    reporter = told(None, at, monkeypatch)
    with caplog.at_level(logging.INFO, "sightline"):
        for seconds in range(25):
            at[0] = 100.0 + seconds
            reporter("placements", 4 * seconds, 120)
        reporter.close()
    assert [(record.name, record.levelname) for record in caplog.records] == [("sightline", "INFO")] * 4
    assert [record.getMessage() for record in caplog.records] == [
        "placements: 8 of 120, 7 %, 28 s left",
        "placements: 48 of 120, 40 %, 18 s left",
        "placements: 88 of 120, 73 %, 8 s left",
        "placements: ended after 24 s",
    ]


def test_short_calls_and_false_say_nothing(monkeypatch, caplog) -> None:
    at = [0.0]
    monkeypatch.setattr(_progress, "_is_watched", lambda: False)
    with caplog.at_level(logging.INFO, "sightline"):
        for progress, end in ((None, 1.9), (False, 60.0)):
            at[0] = 0.0
            reporter = told(progress, at, monkeypatch)
            at[0] = end
            reporter("placements", 1, 2)
            reporter.close()
    assert not caplog.records


def test_time_left_is_that_of_the_work_under_way(monkeypatch) -> None:
    at, seen = [0.0], []
    reporter = told(seen.append, at, monkeypatch)
    for seconds, work, done in ((10, "first", 5), (20, "second", 0), (22, "second", 20)):
        at[0] = float(seconds)
        reporter(work, done, 100)
    assert seen == [
        Progress(5, 100, 10.0, 190.0, "first"),
        Progress(0, 100, 0.0, None, "second"),
        Progress(20, 100, 2.0, 8.0, "second"),
    ]


LONG = """
import logging, signal
import sightline
signal.signal(signal.SIGINT, signal.default_int_handler)
if {log}:
    logging.basicConfig(level="INFO")
scene = sightline.Scene.load("scenes/industrial-yard.json", backend="cpu", frames=4)
poses = scene.random_poses(50_000)
scene.score(poses[:1])
print("begun", flush=True)
try:
    scene.score(poses)
except KeyboardInterrupt:
    print("stopped", flush=True)
"""


class Child:
    """A process that scores for minutes; its stderr is ``said``."""

    def __init__(self, *, log: bool = False, terminal: bool = False) -> None:
        self.said, theirs = pty.openpty() if terminal else os.pipe()
        if terminal:
            # Rows and columns; without columns tqdm draws no bar.
            fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
        command = [sys.executable, "-c", LONG.format(log=log)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=theirs, text=True)
        os.close(theirs)
        assert self.process.stdout.readline() == "begun\n"

    def read_until(self, text: str) -> str:
        """Stderr up to a text, which must come within a minute."""
        said, end = "", time.monotonic() + 60
        while text not in said:
            assert select.select([self.said], [], [], max(end - time.monotonic(), 0))[0], said
            said += os.read(self.said, 1000).decode(errors="replace")
        return said

    def interrupt(self) -> float:
        """Seconds from Ctrl-C to the exception."""
        os.kill(self.process.pid, signal.SIGINT)
        sent = time.monotonic()
        assert self.process.stdout.readline() == "stopped\n"
        return time.monotonic() - sent

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        os.close(self.said)


def test_by_default_nothing_is_printed_and_ctrl_c_is_heard_within_a_second() -> None:
    with Child() as child:
        time.sleep(3.0)
        assert child.interrupt() < 1.0
        child.process.wait(60)
        assert os.read(child.said, 1000) == b""


def test_an_application_that_logs_reads_how_far_a_call_is() -> None:
    with Child(log=True) as child:
        text = child.read_until(" of 50000, ")
        lines = text.splitlines()
        assert all(line.startswith("INFO:sightline:") for line in lines), text
        assert lines[-1].startswith("INFO:sightline:placements: "), text
        assert child.interrupt() < 1.0


def test_a_terminal_gets_a_bar() -> None:
    pytest.importorskip("tqdm")
    with Child(terminal=True) as child:
        assert "placements:" in child.read_until("/50000")
        assert child.interrupt() < 1.0


def test_a_bar_that_is_asked_for_needs_tqdm(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(ImportError, match=r"pip install 'sightline-lidar\[progress\]'"):
        _progress.Reporter(True)
    assert _progress.Reporter(None)._bars is None


def test_sentences_on_the_engine_go_to_the_log(small, caplog) -> None:
    with caplog.at_level(logging.INFO, "sightline"):
        sightline.optimize(small, evaluations=8)
    assert "computing on cpu: host processor" in [record.getMessage() for record in caplog.records]
