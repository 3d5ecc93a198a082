"""Finalists of a search, judged by a learner: who is judged, what is said, and the command from end to end."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is not installed")
pytest.importorskip("sklearn")
pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
from sightline_evidence import confirm
from sightline_evidence.__main__ import main
from sightline_evidence.confirm import Candidate
from sightline_evidence.learners import unet


def placed(name: str, z: float) -> dict[str, Any]:
    return {"name": name, "lidars": [{"x": 0.0, "y": 0.0, "z": z}]}


def finished(folder: Path) -> Path:
    """Makes the folder that a search of eight finalists leaves."""
    best = {"placement": placed("optimized", 2.8), "objective": 9.0}
    baselines = [
        {"placement": placed("Low", 2.2), "objective": 5.0, "violations": []},
        {"placement": placed("High", 2.79), "objective": 7.0, "violations": []},
        {"placement": placed("Bad", 2.9), "objective": 8.0, "violations": ["outside"]},
        {"placement": placed("Blind", 2.0), "objective": None, "violations": []},
    ]
    finalists = [
        {"placement": placed("g", z), "confirmed": {"value": value} if value else None}
        for z, value in ((2.3, 3.0), (2.8, 9.0), (2.79, 7.0), (2.6, 6.0), (2.5, None), (2.7, 8.0), (2.4, 4.0))
    ]
    folder.mkdir(parents=True, exist_ok=True)
    result = {"objective": "information_gain", "best": best, "baselines": baselines}
    (folder / "result.json").write_text(json.dumps(result))
    state = {"inputs": [{"file": "/x/body.obj"}, {"file": "/x/scene.json"}]}
    state["state"] = {"run": {"levels": {"finalists": finalists}}}  # type: ignore[assignment]
    (folder / "checkpoint.json").write_text(json.dumps(state))
    return folder


def test_five_best_and_the_best_baseline_that_is_allowed(tmp_path: Path) -> None:
    objective, found = confirm.candidates(finished(tmp_path))
    assert objective == "information_gain"
    # The best stands among the finalists, and so does the baseline: once is enough.
    assert [one.poses[0, 2] for one in found] == [2.8, 2.7, 2.6, 2.4, 2.3, 2.79]
    assert [one.kind for one in found] == ["found"] * 5 + ["baseline"] and found[-1].name == "High"
    assert confirm.scene_of(tmp_path) == Path("/x/scene.json")
    (tmp_path / "result.json").write_text(json.dumps({"objective": "x", "best": None}))
    with pytest.raises(ValueError, match="result.json: the search found no placement"):
        confirm.candidates(tmp_path)
    (tmp_path / "result.json").write_text(json.dumps({"objective": "x", "settings": {"vehicle": "car.json"}}))
    with pytest.raises(ValueError, match="result.json: is of a vehicle"):
        confirm.candidates(tmp_path)


def test_nets_are_those_of_the_scene_and_the_settings(small_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = json.loads(small_file.read_text())
    other = tmp_path / "other.json"
    other.write_text(json.dumps({**own, "name": "other"}))
    name = confirm.taught_with(small_file)
    assert confirm.taught_with(other) == name and len(name) == 12
    names = {name}
    for change in ({"lidar": {**own["lidar"], "channels": 8}}, {"mount": {**own["mount"], "max": [1, 1, 3]}}, {"ego": {}}):
        other.write_text(json.dumps({**own, **change}))
        names.add(confirm.taught_with(other))
    monkeypatch.setattr(confirm, "SETTINGS", unet.Settings(steps=2))
    names.add(confirm.taught_with(small_file))
    sensor = tmp_path / "sensor.json"
    other.write_text(json.dumps({**own, "lidar": {"file": "sensor.json"}}))
    for text in ("{}", "{ }"):
        sensor.write_text(text)
        names.add(confirm.taught_with(other))
    assert len(names) == 7


@pytest.mark.parametrize(
    ("lead", "spread", "says"),
    [
        (-0.1, 0.0, "Take `a`: it is first by gain and by the learner."),
        (0.1, 0.01, "Take `b`: the learner gets"),
        (0.01, 0.2, "Take `a`, first by gain: that the learner gets"),
    ],
)
def test_one_sentence_says_which(lead: float, spread: float, says: str) -> None:
    rng = np.random.default_rng(2)
    given = [Candidate(name, "found", 1.0, np.zeros((1, 6))) for name in "ab"]
    # Worlds differ more than placements; differences are taken within worlds.
    worlds = rng.normal(0.4, 0.3, (2, 8))
    noise = rng.normal(0, spread, (2, 8))
    found = confirm.verdict("gain", given, np.stack([worlds, worlds + lead + noise - noise.mean()]))
    assert found["says"].startswith(says)
    assert found["says"] in confirm.table(found) and confirm.table(found).count("| a |") == 1


def test_worlds_have_the_lidar_the_mount_and_the_body_of_the_scene(small_file: Path, tmp_path: Path) -> None:
    world = confirm._like(small_file, "street", 601, "test", tmp_path)
    ours, made = json.loads(small_file.read_text()), world.source().described
    assert made["mount"] == ours["mount"] and made["lidar"] == ours["lidar"]
    assert made["ego"]["body"] == ours["ego"]["body"] and made["ego"].get("route") != ours["ego"]["route"]
    assert confirm._like(small_file, "street", 601, "test", tmp_path).sha256 == world.sha256


def test_the_command_judges_with_a_learner_that_is_given(
    small_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(confirm, "TEST", (("highway", 601),))
    monkeypatch.setattr(confirm, "FRAMES", 1)
    few = unet.Settings(steps=1, width=8, cell=8)
    grid = unet.coarse(confirm._like(small_file, "highway", 601, "test", tmp_path / "w").source().grid, 8)
    high, wide = grid.shape[:2]
    nothing = unet.Target(
        np.ones((high, wide), np.uint8), np.zeros((3, high, wide), np.float32),
        np.zeros(0, np.int64), np.zeros((0, unet.BOX), np.float32),
    )  # fmt: skip
    net = tmp_path / "net.pt"
    unet.train(lambda step: unet.Sample(unet.image(grid, np.zeros((0, 3))), nothing), 1, few, net)
    run = tmp_path / "run"
    words = ["optimize", str(small_file), "--out", str(run), "--evaluations", "12", "--method", "cma"]
    assert subprocess.run([sys.executable, "-m", "sightline", *words], check=False).returncode == 0
    assert main(["confirm", str(run), "--learner", str(net)]) == 0
    printed = capsys.readouterr().out
    assert "| best |" in printed and "(baseline)" in printed and "Take `" in printed
    kept = json.loads((run / "learned.json").read_text())
    assert kept["worlds"] == ["highway-601"] and kept["learners"] == [str(net)]
    assert 2 <= len(kept["candidates"]) <= 6 and kept["says"] in printed


def test_a_folder_without_a_result_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["confirm", str(tmp_path / "none")]) == 2
    assert "result.json" in capsys.readouterr().err
