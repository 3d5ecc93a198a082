"""What a search through trees wins is tested beside the published optimum."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("lightgbm", reason="lightgbm is not installed")
from sightline.evidence import direct, run, win
from sightline.evidence.files import write_json

from . import tiny
from .conftest import SMALL


def test_what_is_found_is_tested_and_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(win, "POSES", (12, 8))
    plan = tiny.study(tmp_path, SMALL, ["Ours-seg", "low-front"])
    with pytest.raises(ValueError, match="Ours-seg-1.json: is not there"):
        win.carry_out(plan, tmp_path, 1, 2)
    (ours,) = [one for one in plan.placements if one.name == "Ours-seg"]
    write_json(tmp_path / "units" / "Ours-seg-1.json", run.unit(plan, ours, 1, tmp_path))
    found = win.carry_out(plan, tmp_path, 1, 2)
    assert list(found) == ["direct-trees-box", "direct-trees-low"]
    assert found["direct-trees-box"]["search"]["start"] == "Ours-seg" and found["direct-trees-low"]["search"]["start"] == "low-front"
    assert all(list(of["less_published"]) == list(direct.METRICS) for of in found.values())
    if not found["direct-trees-box"]["search"]["taken"]:
        # Ours-seg again, with other phases.
        assert abs(found["direct-trees-box"]["less_published"]["birds_eye_miou"]["value"]) < 0.2
    assert win.carry_out(plan, tmp_path, 1, 2) == found
    assert "direct-trees-low" in win.table(found)
