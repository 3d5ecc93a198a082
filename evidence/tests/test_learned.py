"""The stage of the U-Net on a study of seconds: its units are those of a second learner, and what is there is kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="torch is not installed")
pytest.importorskip("sklearn")
pytest.importorskip("nuscenes", reason="nuscenes-devkit is not installed")
from sightline_evidence import agreement, cost, learned
from sightline_evidence.correlate import Interval
from sightline_evidence.files import read_json, write_json
from sightline_evidence.learners import unet
from sightline_evidence.plan import Plan

from .conftest import SMALL
from .tiny import study

NAMES = ["Center", "Line", "Square", "sky"]
FEW = unet.Settings(steps=12, width=8, cell=4)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    out = tmp_path_factory.mktemp("learned")
    plan = study(out, SMALL, NAMES)
    learned.FRAMES, frames = 1, learned.FRAMES
    learned.carry_out(plan, out, ["Line"], FEW, jobs=2)
    learned.FRAMES = frames
    return plan, out


def test_units_are_as_of_the_trees(run: tuple[Plan, Path]) -> None:
    plan, out = run
    units = sorted(path.stem for path in (out / "learned" / "units").iterdir())
    assert units == sorted(f"{name}-{seed}" for name in NAMES for seed in learned.SEEDS)
    unit = read_json(out / "learned" / "units" / "Center-2.json")
    assert (unit["placement"], unit["seed"]) == ("Center", 2)
    assert set(unit["scenes"]) == {world.name for world in plan.of("test")}
    for scene in unit["scenes"].values():
        assert set(scene["metrics"]) == {"birds_eye_miou", "centre_recall", "centre_ap"}
        assert 0 < scene["metrics"]["birds_eye_miou"] < 1 and scene["detail"]["chance_miou"] > 0
    told = read_json(out / "learned" / "seed-1.json")
    assert told["steps"] == 12 and len(told["looks"]["birds_eye_miou"]) == unet.LOOKS
    assert {"right", "shuffled", "chance"} == set(read_json(out / "learned" / "shuffled-labels.json"))
    assert read_json(out / "learned" / "anew" / "Line-1.json")["placement"] == "Line"


def test_nothing_is_done_twice(run: tuple[Plan, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    plan, out = run
    monkeypatch.setattr(learned, "FRAMES", 1)
    before = {path: path.stat().st_mtime_ns for path in (out / "learned").rglob("*.*")}
    learned.carry_out(plan, out, ["Line"], FEW, jobs=1)
    assert {path: path.stat().st_mtime_ns for path in (out / "learned").rglob("*.*")} == before
    with pytest.raises(ValueError, match="--anew: the plan has no placement Lime; it has .*Line"):
        learned.carry_out(plan, out, ["Lime"], FEW, jobs=1)


def test_other_settings_and_other_versions_are_refused(
    run: tuple[Plan, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, out = run
    monkeypatch.setattr(learned, "FRAMES", 1)
    kept = read_json(out / "learned" / "plan.json")
    assert kept["study"] == plan.sha256 and kept["settings"]["steps"] == 12 and kept["seeds"] == list(learned.SEEDS)
    with pytest.raises(ValueError, match="plan.json: settings is .* now it is .*; delete .*learned to learn anew"):
        learned.carry_out(plan, out, [], unet.Settings(steps=13, width=8, cell=4), jobs=1)
    for key in ("engine", "torch", "study"):
        write_json(tmp_path / "plan.json", {**kept, key: "other"})
        with pytest.raises(ValueError, match=f"plan.json: {key} is other, now it is"):
            learned.settled(plan, tmp_path, FEW)
    (tmp_path / "plan.json").unlink()
    (tmp_path / "seed-1.pt").touch()
    with pytest.raises(ValueError, match="holds nets whose settings were not recorded"):
        learned.settled(plan, tmp_path, FEW)


def test_agreement_is_one_of_equal_orders_and_knows_what_is_missing() -> None:
    rng = np.random.default_rng(1)
    ours = rng.random((30, 1)) + 0.01 * rng.random((30, 6))
    assert agreement.agreement(ours, 3 * ours + 1).value == pytest.approx(1)
    assert agreement.agreement(ours, -ours).high < -0.9
    other = agreement.agreement(ours, rng.random((30, 6)))
    assert other.low < 0 < other.high
    theirs = 3 * ours
    theirs[:5] = np.nan
    assert agreement.agreement(ours, theirs).value == pytest.approx(1)
    theirs[2:] = np.nan
    assert np.isnan(agreement.agreement(ours, theirs).value)


def test_tables_and_costs_come_from_the_folder(run: tuple[Plan, Path], tmp_path: Path) -> None:
    plan, out = run
    for layout in plan.placements:
        # Trees that order the placements just as the U-Net does, and a score that does the opposite.
        unit = read_json(out / "learned" / "units" / f"{layout.name}-1.json")
        for scene in unit["scenes"].values():
            scene["metrics"]["objects_5"] = scene["metrics"]["centre_recall"]
        write_json(out / "units" / f"{layout.name}-1.json", unit)
    write_json(out / "learned" / "units" / "Center-2.json", read_json(out / "learned" / "units" / "Center-1.json"))
    assert "| trees `birds_eye_miou` | U-Net, shared `birds_eye_miou` |" in agreement.table(plan, out)
    values = agreement.metric_of(plan, out / "units", "birds_eye_miou")
    for number, world in enumerate(plan.of("test")):
        write_json(out / "scores" / f"{world.name}.json", {"mean_height": (-values[:, number]).tolist()})
    spent = {"nothing": 0.0, "score": 0.5, "boxes": 1.0, "trees": 16.0}
    ways = {way.name: way for way in cost.ways(plan, out, spent)}
    assert set(ways) == {"mean height", "trees", "U-Net, shared", "U-Net, anew"}
    assert np.isnan(ways["U-Net, shared"].maps.value) and ways["trees"].seconds == 16
    assert ways["mean height"].maps.value == pytest.approx(-ways["trees"].maps.value)
    assert b"<svg" in cost.chart(list(ways.values()))


def test_points_in_boxes_cost_what_their_score_takes(run: tuple[Plan, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    plan, out = run
    looked: list[int] = []
    monkeypatch.setattr(cost.sightline, "set_threads", lambda count: None)
    monkeypatch.setattr(cost.run, "unit", lambda *_: None)
    monkeypatch.setattr(cost.candidates, "look", lambda scene, ground, rig: looked.append(scene.frames))
    spent = cost.measured(plan, out)
    # Once to warm up and once by the clock, in each frame that the scores are means over, in two scenes.
    frames = min(cost.FRAMES, plan.of("test")[0].scene().frames)
    assert len(looked) == 2 * 2 * frames and set(spent) == {"nothing", "score", "boxes", "trees"}


def test_the_bend_is_where_dearer_work_adds_little() -> None:
    def way(name: str, seconds: float, value: float, placements: int = 40) -> cost.Way:
        interval = Interval(value, value - 0.1, value + 0.1)
        return cost.Way(name, seconds, interval, Interval(0, 0, 0), placements, float("nan"), 0)

    ways = [way("height", 0, 0.5), way("gain", 0.1, 0.88), way("boxes", 1, 0.3), way("trees", 16, 0.91)]
    assert cost.bend(ways) == (
        "The curve bends at gain: ρ 0.88 with the map of the U-Net, shared for 0.1 CPU-seconds; what is dearer adds 0.03 at most."
    )
    ways[3] = way("trees", 16, 0.97)
    assert cost.bend(ways).startswith("The curve bends at trees")
    assert cost.table(ways).count("\n") == 5
    # Three placements that happen to stand in the same order tell nothing.
    ways.append(way("a net a placement", 160, 1.0, placements=3))
    assert cost.bend(ways).startswith("The curve bends at trees")
    assert b"a net a placement" not in cost.chart(ways) and b"trees" in cost.chart(ways)
