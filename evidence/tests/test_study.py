"""The smallest whole study, which can fail: controls must lose, shuffled scores and labels must tell nothing."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from sightline_evidence import correlate, files, plan, present, restore, run, summary, tables, trial, truth
from sightline_evidence.__main__ import main
from sightline_evidence.designs import DESIGNS
from sightline_evidence.layouts import Layout

from . import tiny
from .conftest import SMALL


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("study")


@pytest.fixture(scope="module")
def result(out: Path) -> dict[str, Any]:
    return run.carry_out(tiny.study(out, SMALL), out, os.cpu_count() or 1, time.monotonic())


def means(result: dict[str, Any], metric: str) -> dict[str, float]:
    return {placement["name"]: placement["metrics"][metric] for placement in result["placements"]}


def test_gamed_placements_rank_last(result: dict[str, Any]) -> None:
    for metric in ("voxel_miou", "voxel_1m_miou", "birds_eye_miou"):
        values = means(result, metric)
        gamed = [values.pop(name) for name in ("sky", "cabin", "stacked")]
        four = [value for name, value in values.items() if not name.startswith("count-")]
        assert max(gamed) < min(four), metric
    assert all(result["checks"]["gamed_rank_last"].values())


def test_a_score_that_is_shuffled_tells_nothing(result: dict[str, Any]) -> None:
    pool = result["pools"]["all but the gamed"]["metrics"]["voxel_1m_miou"]["scores"]
    assert pool["shuffled"]["spearman"]["low"] < 0 < pool["shuffled"]["spearman"]["high"]
    assert pool["covered"]["spearman"]["low"] > 0
    # It picks a random placement, of which the regret is 1.
    assert result["checks"]["shuffled_is_random"]["all but the gamed"] is True
    assert "interval of the regret of `shuffled` holds 1: four in the mount " in tables.tables(result)


def test_shuffled_labels_do_not_beat_chance(result: dict[str, Any]) -> None:
    found = result["checks"]["shuffled-labels"]
    assert found["shuffled"] < found["chance"] + 0.05 < found["right"]
    assert [name for name in result["checks"]["learnt"]["not_learnt"] if not name.startswith("cabin")] == []


def test_one_more_lidar_is_better(result: dict[str, Any]) -> None:
    # With one frame a world, metrics within 1 m of a point follow the noise of the learner.
    for metric in ("voxel_miou", "ground_seen_10m"):
        found = result["checks"]["one_more_lidar"][metric]
        one, two = found["means"]
        assert two > one and found["steps"][0]["value"] == pytest.approx(two - one), metric


def test_the_plan_stood_before_and_is_in_the_result(result: dict[str, Any], out: Path) -> None:
    kept = json.loads((out / "plan.json").read_text())
    assert result["plan_sha256"] == kept["plan_sha256"] == plan.digest(result["plan"])
    first = min(path.stat().st_mtime for path in (out / "units").iterdir())
    assert (out / "plan.json").stat().st_mtime < first


def test_tables_and_figure(result: dict[str, Any], out: Path) -> None:
    present.write(result, out)
    text = (out / "tables.md").read_text()
    assert "`information_gain`" in text and "gamed placements rank last" in text and "nan" not in text
    picture = (out / "figure.svg").read_bytes()
    present.write(result, out)
    assert picture == (out / "figure.svg").read_bytes() and b"</svg>" in picture


def test_what_is_published_has_what_correlations_are_made_of(result: dict[str, Any], out: Path) -> None:
    present.write(result, out)
    record = files.read_json(out / "record.json.gz")
    pools = {placement["name"]: placement["pool"] for placement in result["placements"]}
    box = [placement for placement in record["placements"] if pools[placement["name"]] == "box"]
    found = result["pools"]["four in the mount"]["metrics"]["voxel_1m_miou"]["scores"]
    metric = np.array([placement["by_seed_and_scene"]["voxel_1m_miou"] for placement in box]).mean(axis=(1, 2))
    for score in ("near_gain", "covered", "shuffled"):
        values = np.array([placement["scores"][score] for placement in box]).mean(axis=1)
        assert correlate.spearman(values, metric) == pytest.approx(found[score]["spearman"]["value"], abs=1e-3), score
    assert record["plan"] == result["plan"] and "detail" not in record["placements"][0]


def test_parts_are_means_over_scenes_less_the_published_optimum(result: dict[str, Any], out: Path) -> None:
    details = {name: files.read_json(out / "units" / f"{name}-1.json")["scenes"] for name in ("Ours-seg", "Center")}

    def less(read: Callable[[dict[str, Any]], float]) -> float:
        each = {name: [read(scene["detail"]) for scene in scenes.values()] for name, scenes in details.items()}
        return float(np.mean(np.array(each["Center"]) - each["Ours-seg"]))

    parts = result["parts"]["parts"]
    road = parts["IoU within 1 m"]["road"]["Center"]
    assert road["value"] == pytest.approx(less(lambda detail: detail["iou_by_class_1m"]["road"])) and road["value"] != 0
    far = parts["mIoU within 1 m, ring"]["10 to 20 m"]["Center"]["value"]
    assert far == pytest.approx(less(lambda detail: detail["miou_by_ring_1m"][1])) and far != 0
    kinds = parts["objects ≥ 5 points"]
    share = np.mean([np.divide(*scene["detail"]["objects"]["vehicle_5"]) for scene in details["Ours-seg"].values()])
    assert kinds["vehicle"]["Ours-seg"]["value"] == pytest.approx(share)
    # The world has none of these.
    assert "cyclist" not in kinds and "barrier" not in parts["IoU within 1 m"]


def test_lists_of_numbers_stand_on_a_line(tmp_path: Path) -> None:
    value = {"table": [[1.5, float("nan"), -2e-7], [3]], "text": "[1,\n 2]", "empty": [], "mixed": [1, "a"]}
    files.write_json(tmp_path / "some.json", value)
    assert files.read_json(tmp_path / "some.json") == files.finite(value)
    assert "[1.5, null, -2e-07]" in (tmp_path / "some.json").read_text()


def test_what_is_there_of_a_run_that_was_cut_short(result: dict[str, Any], out: Path, tmp_path: Path) -> None:
    shutil.copytree(out, tmp_path / "cut")
    (tmp_path / "cut" / "units" / "Line-1.json").unlink()
    (tmp_path / "cut" / "units" / "Center-1.json").write_text("{")
    found = summary.of(plan.read(tiny.DESIGN, tmp_path / "cut", out), tmp_path / "cut")
    assert sorted(found["missing_units"]) == ["Center-1", "Line-1"]
    assert {"Line", "Center"} & set(means(found, "voxel_miou")) == set()
    kept = set(means(result, "voxel_miou")) - {"Line", "Center"}
    assert {name: means(result, "voxel_miou")[name] for name in kept} == means(found, "voxel_miou")
    assert "2 units are missing, 2 of seed 1: Center-1, Line-1" in tables.tables(found)
    for unit in (tmp_path / "cut" / "units").glob("*.json"):
        unit.unlink()
    with pytest.raises(ValueError, match="no unit yet"):
        summary.of(plan.read(tiny.DESIGN, tmp_path / "cut", out), tmp_path / "cut")


def test_another_learner_stands_beside(result: dict[str, Any], out: Path, tmp_path: Path) -> None:
    """One that sees as the trees do agrees with them wholly."""
    shutil.copytree(out, tmp_path / "run")
    (tmp_path / "run" / "learned" / "units").mkdir(parents=True)
    for unit in (tmp_path / "run" / "units").glob("*.json"):
        shutil.copy(unit, tmp_path / "run" / "learned" / "units" / unit.name)
    found = summary.of(plan.read(tiny.DESIGN, tmp_path / "run", out), tmp_path / "run")
    agreed = found["agreement"]["unet_birds_eye_miou, box"]
    assert agreed["value"] == pytest.approx(1) and agreed["of"] == 11
    # Earlier programs did not write its settings down.
    assert found["checks"]["second_learner"] == "settings not recorded"
    assert "second learner: settings not recorded" in tables.tables(found)
    regret = found["pools"]["four in the mount"]["regret"]
    assert "unet_birds_eye_miou" in regret["metrics"]
    of = regret["scores"]["covered"]["by_metric"]
    assert of["unet_birds_eye_miou"] == of["birds_eye_miou"]


def test_a_changed_plan_or_scene_is_refused(result: dict[str, Any], out: Path, tmp_path: Path) -> None:
    assert plan.read(tiny.DESIGN, out, out).sha256 == result["plan_sha256"]
    kept = json.loads((out / "plan.json").read_text())
    kept["plan"]["seeds"] = [2]
    (tmp_path / "plan.json").write_text(json.dumps(kept))
    with pytest.raises(ValueError, match="changed after it was hashed"):
        plan.read(tiny.DESIGN, tmp_path, out)
    (tmp_path / "plan.json").write_text("{")
    with pytest.raises(ValueError, match="cannot be read"):
        plan.read(tiny.DESIGN, tmp_path, out)
    kept["plan_sha256"] = plan.digest(kept["plan"])
    (tmp_path / "plan.json").write_text(json.dumps(kept))
    with pytest.raises(ValueError, match="seeds is"):
        plan.read(tiny.DESIGN, tmp_path, out)
    shutil.copy(out / "plan.json", tmp_path / "plan.json")
    shutil.copytree(out / "worlds", tmp_path / "worlds")
    assert plan.read(tiny.DESIGN, tmp_path, out).sha256 == result["plan_sha256"]
    scene = sorted((tmp_path / "worlds").iterdir())[0]
    scene.write_bytes(scene.read_bytes() + b" ")
    with pytest.raises(ValueError, match="tiny-0.json: is not the file that the plan was made with"):
        plan.read(tiny.DESIGN, tmp_path, out)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{}", "cannot be read"),
        ("[]", "cannot be read"),
        ('{"plan": {}}', "cannot be read"),
        ('{"plan": [], "plan_sha256": ""}', "was changed after it was hashed"),
        (None, "is not there; run a study"),
        ("unknown", "the design unknown is none of quick"),
    ],
)
@pytest.mark.parametrize("command", ["tables", "learned", "cost"])
def test_a_plan_that_is_none_is_a_sentence(
    command: str, text: str | None, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if command == "learned":
        pytest.importorskip("torch", reason="torch is not installed")
    if text == "unknown":
        record = {"design": "unknown"}
        text = json.dumps({"plan": record, "plan_sha256": plan.digest(record)})
    if text is not None:
        (tmp_path / "plan.json").write_text(text)
    assert main([command, "--out", str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and says in told and told.count("\n") == 1


def test_a_placement_that_meets_nothing_has_no_own_points(tmp_path: Path) -> None:
    """Below the ground plane: a learner that is there says nothing of it, and that is no error."""
    ready = tiny.study(tmp_path, SMALL, ["Center"])
    world, (center,) = ready.of("test")[0], ready.placements
    deep = Layout("deep", "box", np.array([[0.0, 0, -3, 0, 0, 0]]))
    targets = truth.cached(world.source(), world.sha256, world.frames, tmp_path / "truth")
    scans = trial.frames_of(world, deep, 1)
    assert [len(scan.xyz) for scan in scans] == [0]
    learner = trial.learn(trial.frames_of(ready.of("train")[0], center, 1), 1, ready.learner)
    for judged in (trial.judge(world, targets, scans, one) for one in (learner, None)):
        assert judged["metrics"]["voxel_miou"] == 0 and judged["metrics"]["ground_seen_10m"] == 0
        assert np.isnan([judged["metrics"]["own_miou"], judged["metrics"]["own_miou_semantickitti"], judged["detail"]["ece_15_bins"]]).all()


KILLED = """
import json, sys, time
sys.path.insert(0, {tests!r})
from pathlib import Path
import tiny
from sightline_evidence import plan, run
if __name__ == "__main__":
    out = Path({out!r})
    ready = plan.read(tiny.DESIGN, out, out)
    run.carry_out(ready, out, 2, time.monotonic())
"""


def test_killed_and_run_again_is_the_same(result: dict[str, Any], out: Path, tmp_path: Path) -> None:
    """SIGKILL in the middle of the units, twice; the last run gives the bytes of one that never stopped."""
    few = ["Center", "Line", "Ours-seg"]
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    expected = run.carry_out(tiny.study(whole, SMALL, few), whole, 2, time.monotonic())
    tiny.study(broken, SMALL, few)
    script = KILLED.format(tests=str(Path(__file__).parent), out=str(broken))
    file = tmp_path / "killed.py"
    file.write_text(script)
    for least in (1, 3):
        process = subprocess.Popen([sys.executable, str(file)], stderr=subprocess.DEVNULL)
        while process.poll() is None and len(list((broken / "units").glob("*.json"))) < least:
            time.sleep(0.05)
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert not (broken / "result.json").exists()
    again = run.carry_out(plan.read(tiny.DESIGN, broken, broken), broken, 2, time.monotonic())
    for found in (expected, again):
        del found["times"]
    assert json.dumps(files.finite(expected), sort_keys=True) == json.dumps(files.finite(again), sort_keys=True)


def test_a_run_is_restored_from_what_was_kept(
    result: dict[str, Any], out: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(DESIGNS, "tiny", tiny.DESIGN)
    scenes, kept = Path("scenes").resolve(), tmp_path / "record.json.gz"
    kept.write_bytes(present.record(result))
    again = tmp_path / "again"
    shutil.copytree(out / "worlds", again / "worlds")
    assert main(["restore", str(kept), "--out", str(again)]) == 0
    assert "other than in the record: nothing" in capsys.readouterr().err
    found = run.so_far(again)
    assert found["plan_sha256"] == result["plan_sha256"] and found["missing_units"] == []
    # A record keeps four digits of a metric, and a regret divides by the spread of three placements that hardly differ.
    for pool, of in result["pools"].items():
        for score, regret in of["regret"]["scores"].items():
            assert found["pools"][pool]["regret"]["scores"][score]["mean"]["value"] == pytest.approx(regret["mean"]["value"], abs=1e-2)
    assert main(["restore", str(kept), "--out", str(again)]) == 2
    assert "holds a run already" in capsys.readouterr().err
    assert main(["restore", "nowhere.json", "--out", str(tmp_path / "none")]) == 2
    assert capsys.readouterr().err == "error: nowhere.json: no such file or directory; check the path\n"
    # Another world than that of the record, a record that was changed, one of means alone.
    other = tmp_path / "other"
    shutil.copytree(out / "worlds", other / "worlds")
    world = sorted((other / "worlds").glob("*.json"))[0]
    world.write_text(world.read_text().replace('"vegetation"', '"building"'), encoding="utf-8")
    assert main(["restore", str(kept), "--out", str(other)]) == 2
    assert f"{kept}: " in (said := capsys.readouterr().err) and "is not the file that the plan was made with" in said
    assert not (other / "plan.json").exists()
    record = files.read_json(kept)
    record["plan"]["seeds"] = [7]
    with pytest.raises(ValueError, match="was changed"):
        restore.restore(record, tmp_path / "changed", scenes, None)
    record = files.read_json(kept)
    del record["placements"][0]["by_seed_and_scene"]
    with pytest.raises(ValueError, match="means alone"):
        restore.restore(record, tmp_path / "means", scenes, None)


def test_a_run_with_towns_is_not_restored_without_their_maps(tmp_path: Path) -> None:
    record = files.read_json(Path("evidence/runs/standard.json.gz"))
    with pytest.raises(ValueError, match="maps Town01, Town06, Town03, Town04; give their folder with --xodr"):
        restore.restore(record, tmp_path / "run", Path("scenes"), None)
    (tmp_path / "Town01.xodr").touch()
    with pytest.raises(ValueError, match="holds no Town06.xodr"):
        restore.restore(record, tmp_path / "run", Path("scenes"), tmp_path)
    assert not (tmp_path / "run").exists()
