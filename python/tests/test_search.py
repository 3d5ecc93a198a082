"""Searches: callbacks, results, Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import sightline
from sightline import Scene


def test_a_search_is_that_of_the_program(scene, tmp_path) -> None:
    whole = Scene.load("scenes/industrial-yard.json", backend="cpu")
    result = sightline.optimize(whole, evaluations=24, seed=3)
    done = subprocess.run(
        [
            sys.executable, "-m", "sightline", "optimize", "scenes/industrial-yard.json", "--backend", "cpu",
            "--evaluations", "24", "--seed", "3", "--out", str(tmp_path / "run"),
        ],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    theirs = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result.best.to_dict() == theirs["best"]["placement"]
    assert result.scores["near_gain"][0] == theirs["best"]["scores"]["near_gain"]
    assert result.record["best"]["objective"] == theirs["best"]["objective"]
    assert result.record["evaluations"] == theirs["evaluations"]
    assert [b.name for b in result.baselines] == [b["placement"]["name"] for b in theirs["baselines"]]


def test_callbacks_see_the_search_and_end_it(scene) -> None:
    seen = []

    def callback(event) -> bool:
        seen.append(event)
        if sum(event["event"] == "generation" for event in seen) == 2:
            raise StopIteration
        return False

    result = sightline.optimize(scene, evaluations=10_000, callback=callback)
    assert result.record["stopped"] == "interrupted" and result.record["generations"] <= 3
    assert {"note", "generation", "progress"} >= {event["event"] for event in seen}
    generation = next(event for event in seen if event["event"] == "generation")
    assert generation["best_so_far"] > 0 and generation["generation"] == 1


def test_an_exception_of_the_callback_comes_through_with_the_result(scene) -> None:
    def callback(event) -> None:
        if event["event"] == "generation":
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough") as caught:
        sightline.optimize(scene, evaluations=10_000, callback=callback)
    assert caught.value.result.best is not None


def test_others_work_meanwhile(scene) -> None:
    """The GIL is free: a thread of Python counts on while placements are scored."""
    poses, counted, ended = scene.random_poses(80, seed=2), [0], threading.Event()

    def count() -> None:
        while not ended.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    start = time.perf_counter()
    scene.score(poses)
    seconds = time.perf_counter() - start
    ended.set()
    thread.join()
    assert counted[0] > 20 * seconds


ENDLESS = """
import signal, sightline
# A shell that starts the tests in the background has Ctrl-C ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)
scene = sightline.Scene.load("scenes/industrial-yard.json", backend="cpu", frames=4)
poses = scene.random_poses(64)
scene.score(poses[:1])
print("begun", flush=True)
try:
    {work}
except KeyboardInterrupt as error:
    print("stopped", getattr(error, "result", None), flush=True)
"""


@pytest.mark.parametrize(
    ("work", "answer"),
    [
        ("while True: scene.score(poses)", "stopped None"),
        ("scene.score(scene.random_poses(1_000_000))", "stopped None"),
        ("sightline.optimize(scene, evaluations=1_000_000)", "stopped Result(best=Placement"),
    ],
)
def test_ctrl_c_ends_long_work(work: str, answer: str) -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", ENDLESS.format(work=work)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert child.stdout.readline() == "begun\n"
        time.sleep(1.0)
        os.kill(child.pid, signal.SIGINT)
        printed, _ = child.communicate(timeout=60)
        assert printed.startswith(answer)
    finally:
        child.kill()
        child.wait()


def test_a_budget_chooses_sensors() -> None:
    scene = Scene.load(
        "scenes/urban-crossing.json", vehicle="scenes/vehicles/car.json", frames=2, backend="cpu"
    )
    prices = sightline.Vehicle.load("scenes/vehicles/car.json").prices
    result = sightline.optimize(scene, evaluations=24, budget=14_000.0)
    cost = sum(prices[name or next(iter(prices))] for name in result.best.sensors)
    assert 0 < cost <= 14_000
    assert np.isfinite(result.scores["information_gain"]).all()


def test_a_requirement_out_of_reach_is_warned_of_and_recorded(tmp_path) -> None:
    vehicle = json.loads(Path("scenes/vehicles/car.json").read_text())
    vehicle["require"] = [{"target": "tyre", "from": 90, "within": 90, "beams": 100, "share": 1}]
    (tmp_path / "car.json").write_text(json.dumps(vehicle))
    scene = Scene.load("scenes/urban-crossing.json", vehicle=tmp_path / "car.json", frames=2, backend="cpu")
    with pytest.warns(sightline.DoubtWarning, match="OUT OF REACH: tyre at 90 m"):
        result = sightline.optimize(scene, evaluations=12, budget=5_000.0)
    equipped = result.record["settings"]["equipped"]
    assert equipped["out_of_reach"][0].startswith("tyre at 90 m, 100 beams: even") and equipped["open_mounts"]
    assert result.record["near_field"]["zone"]


def test_one_placement_is_one(scene, placements) -> None:
    with pytest.raises(ValueError, match="poses: are those of 2 placements; give one of them"):
        scene.scan(placements[:2])
    covered = scene.covered(placements[0])
    assert covered.dtype == np.uint64 and np.all(np.diff(covered.astype(np.int64)) > 0)


def test_a_front_trades_price_against_gain() -> None:
    scene = Scene.load(
        "scenes/urban-crossing.json", vehicle="scenes/vehicles/car.json", frames=2, backend="cpu"
    )
    works: list[str] = []
    front = sightline.front(
        scene,
        ["price", "near_gain"],
        budget=5_000.0,
        evaluations=0,
        callback=lambda event: works.append(event.get("work", "")),
    )
    prices = [values[0] for values in front.values]
    assert len(front) >= 2 and prices == sorted(prices) == front.prices
    assert 0 < prices[0] and prices[-1] <= 5_000
    gains = [values[1] for values in front.values]
    assert gains == sorted(gains)
    assert np.array_equal(scene.score(front.placements)["near_gain"], gains)
    assert np.array_equal(front.scores["near_gain"], gains)
    assert front.picks["best price"] == 0 and front.picks["best near_gain"] == len(front) - 1
    assert [point["name"] for point in front.record["front"]] == front.scores.names
    assert "choices of sensors along the front at most" in works
    with pytest.raises(ValueError, match="`gain` is no objective; there are price, sensors"):
        sightline.front(scene, ["price", "gain"])

    def stop(event: dict[str, object]) -> None:
        if event.get("work") == "choices of sensors along the front at most":
            raise StopIteration

    stopped = sightline.front(scene, ["price", "near_gain"], callback=stop)
    assert stopped.record["stopped"] == "interrupted"
