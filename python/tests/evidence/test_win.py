"""What there is to win, after a study of seconds: searched, tested, told against the published optimum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from sightline.evidence import designs, direct, files, run, stage, win
from sightline.evidence.plan import Plan

from . import tiny
from .conftest import SMALL


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("win")


@pytest.fixture(scope="module")
def plan(out: Path) -> Plan:
    return tiny.study(out, SMALL, ["Ours-seg", "low-front"])


def here(name: str, tasks: list[stage.Task], jobs: int) -> None:
    for path, work, given in tasks:
        if not files.is_whole(path):
            files.write_json(path, work(*given))


def test_searches_are_tested_against_the_published_optimum(
    plan: Plan, out: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # All in this process, with fewer random ones.
    monkeypatch.setattr(stage, "carry_out", here)
    monkeypatch.setattr(direct, "DRAWN", 2)
    with pytest.raises(ValueError, match="Ours-seg-1.json: is not there; run the study"):
        win.carry_out(plan, out, 2, 1)
    (ours,) = [one for one in plan.placements if one.name == "Ours-seg"]
    published = run.unit(plan, ours, 1, out)
    files.write_json(out / "units" / "Ours-seg-1.json", published)
    monkeypatch.setitem(designs.DESIGNS, tiny.DESIGN.name, tiny.DESIGN)
    words = ["--out", str(out), "--scenes", str(out), "--exchanges", "2", "--jobs", "1"]
    assert win.main(words) == 0
    said = capsys.readouterr()
    assert "search-low, 2 of 2 exchanges, 0 s left" in said.err
    result = files.read_json(out / "win" / "win.json")
    assert list(result) == ["direct-trees-box", "direct-trees-low"]
    low = {"direct-trees-box": 0, "direct-trees-low": 2}
    for name, of in result.items():
        searched = files.read_json(out / "win" / f"search-{name.removeprefix('direct-trees-')}.json")
        assert (np.array(searched["poses"])[:, 2] < 1.5).sum() == low[name]
        assert of["search"]["value"] >= max(of["search"]["starts"].values()) and of["search"]["exchanges"] == 2
        tested = files.read_json(out / "win" / f"{name}-1.json")["scenes"]
        for metric in direct.METRICS:
            less = [tested[scene]["metrics"][metric] - published["scenes"][scene]["metrics"][metric] for scene in tested]
            assert of["less_published"][metric]["value"] == pytest.approx(np.mean(less), abs=1e-12), metric
        assert f"| {name} | {max(of['search']['starts'].values()):.2f} (" in said.out.replace("−", "-")
    # Low ones see the ground beside them that four in the mount do not.
    assert result["direct-trees-low"]["less_published"]["ground_seen_3m"]["low"] > 0
    # What is there is not done again, and comes out the same; a search of another length is not that one.
    assert win.main(words) == 0
    again = capsys.readouterr()
    assert again.out == said.out and again.err == ""
    tasks = win._searches(plan, out, 3)
    assert [path.stem for path, _, _ in tasks] == ["search-box", "search-low"]
    assert not any(path.exists() or (out / "win" / f"direct-trees-{path.stem[7:]}-1.json").exists() for path, _, _ in tasks)
    assert all((out / "win" / f"{path.stem}.known.json").exists() for path, _, _ in tasks)
