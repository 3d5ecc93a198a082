"""``optimize … --confirm learned`` on a folder that holds a run: of the same scenes and objective, or refused."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from sightline import _confirmed


def finished(folder: Path, scene: Path, objective: str = "near_gain") -> Path:
    """What is compared of a finished run."""
    folder.mkdir()
    settings = {"scene": str(scene), "search": {"objective": objective}}
    (folder / "result.json").write_text(json.dumps({"settings": settings}))
    inputs = [{"file": str(scene), "sha256": hashlib.sha256(scene.read_bytes()).hexdigest()}]
    (folder / "checkpoint.json").write_text(json.dumps({"inputs": inputs}))
    return folder


def test_the_result_of_another_search_is_not_confirmed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, other = tmp_path / "s.json", tmp_path / "t.json"
    scene.write_text("{}")
    other.write_text("{ }")
    run = finished(tmp_path / "run", scene)
    start = ["optimize", "--mirror", str(scene), "--seed", "3"]
    assert _confirmed._difference(run, start) is None
    assert _confirmed._difference(run, [*start, "--objective=near_gain"]) is None
    for words, says in (
        (["optimize", str(other)], "holds a run of"),
        ([*start, str(other)], "holds a run of"),
        ([*start, "--objective", "m_sog"], "holds a run for near_gain, not for m_sog; give another --out"),
        ([*start, "--near-weight", "0.1"], "holds a run for near_gain, not for information_gain"),
    ):
        assert _confirmed.optimize([*words, "--out", str(run), "--confirm", "learned"]) == 2
        told = capsys.readouterr().err
        assert told.startswith("sightline: --confirm learned: ") and says in told and told.count("\n") == 1
    scene.write_text("{}\n")
    assert "as that was then" in (_confirmed._difference(run, start) or "")
