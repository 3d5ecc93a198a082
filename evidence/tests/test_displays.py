"""The displays against plain loops over the records, and the page against the displays."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("scipy", reason="SciPy is not installed")
pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from sightline_evidence import displays

from .conftest import ROOT

FOLDER = ROOT / "evidence" / "runs"


def by_loops(name: str, score: str, metrics: tuple[str, ...], is_kept: Any) -> float:
    """Mean regret of a score's first placement, from the JSON with nothing of the package."""
    record = json.loads(gzip.decompress((FOLDER / displays.RUNS[name]).read_bytes()))
    pools = {one["name"]: one["pool"] for one in record["plan"]["placements"]}
    placements = [one for one in record["placements"] if pools[one["name"]] == "box" and is_kept(one["name"])]
    by_metric = []
    for metric in metrics:
        by_scene = []
        for scene in range(len(placements[0]["scores"][score])):
            found: list[tuple[float, float]] = []
            for one in placements:
                seeds = [row[scene] for row in one["by_seed_and_scene"][metric] if row[scene] is not None]
                found.append((one["scores"][score][scene], sum(seeds) / len(seeds) if seeds else np.nan))
            values = [value for _, value in found if not np.isnan(value)]
            best, middle = max(values, default=0), sum(values) / max(len(values), 1)
            top = max(at for at, _ in found)
            first = [value for at, value in found if at >= top - 1e-9 * abs(top) and not np.isnan(value)]
            by_scene.append((best - sum(first) / len(first)) / (best - middle) if first and best > middle else np.nan)
        by_metric.append(by_scene)
    return float(np.nanmean(np.nanmean(by_metric, axis=0)))


@pytest.fixture(scope="module")
def given() -> dict[str, Any]:
    return {name: displays.read(FOLDER / file) for name, file in displays.RUNS.items()}


def test_regret_is_that_of_plain_loops(given: dict[str, Any]) -> None:
    metrics = tuple(metric for group in displays.GROUPS.values() for metric in group)
    for name, run in given.items():
        for kept, is_kept in ((run.pool("box"), lambda _: True), (displays.without_optima(run), lambda x: not x.startswith("best-"))):
            found = displays.losses(run, kept)
            for score in ("near_gain", "information_gain", "mean_height"):
                for k, group in enumerate((*displays.GROUPS.values(), metrics)):
                    expected = by_loops(name, score, group, is_kept)
                    assert found.of(score, k).value == pytest.approx(expected, abs=1e-9), (name, score, group)


def test_a_score_against_itself_and_against_a_random_pick(given: dict[str, Any]) -> None:
    run = given["towns"]
    found = displays.losses(run, run.pool("box"))
    itself = found.less("near_gain", "near_gain", 0)
    assert (itself.value, itself.low, itself.high) == (0, 0, 0)
    assert found.less("near_gain", None, 0).value == pytest.approx(found.of("near_gain", 0).value - 1)


def test_optima_less_the_published_one_are_differences_of_means(given: dict[str, Any]) -> None:
    record = json.loads(gzip.decompress((FOLDER / "standard.json.gz").read_bytes()))
    of = {one["name"]: np.mean(one["by_seed_and_scene"]["ground_seen_3m"]) for one in record["placements"]}
    expected = (of["best-near_gain-1"] + of["best-near_gain-2"]) / 2 - of["Ours-seg"]
    found = displays.optima_less_published(given["standard"])["near_gain"]["ground_seen_3m"]
    assert found.value == pytest.approx(expected, abs=1e-12) and found.low < found.value < found.high


def test_the_page_has_the_tables_as_they_are_computed(given: dict[str, Any]) -> None:
    page = (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8").splitlines()
    lines = [line for line in displays.tables(given).splitlines() if line]
    assert len(lines) > 20
    for line in lines:
        assert line in page, line
    results = (ROOT / "docs" / "results.md").read_text(encoding="utf-8").splitlines()
    assert [line for line in displays.table_of_regret(given).splitlines() if line not in results] == []


def test_equal_placements_are_counted_without_the_published_one(given: dict[str, Any]) -> None:
    rows = [line.split("|")[1:-1] for line in displays.table_of_margin(given).splitlines()]
    metrics = [cell.strip() for cell in rows[0][1:]]
    counts = {name.strip(): dict(zip(metrics, (int(cell.split()[0]) for cell in cells))) for name, *cells in rows[2:]}
    for name, run in given.items():
        ours, kept = run.place("Ours-seg"), run.pool("box")
        for metric in (*displays.GROUPS["recognition (trees)"], *displays.GROUPS["near ground (geometry)"]):
            values = run.mean(metric).mean(axis=1)
            near = kept & (np.abs(values - values[ours]) <= displays.MARGIN)
            # An interval lies within the margin only where its value does.
            assert 0 < counts[name][metric] <= near.sum() - 1, (name, metric)
    assert counts["standard"]["voxel_miou"] == given["standard"].pool("box").sum() - 1
    assert counts["standard"]["ground_seen_3m"] < 10


def test_pictures_are_the_ones_kept_but_for_the_library_that_draws_them(given: dict[str, Any], tmp_path: Path) -> None:
    assert displays.main(["--runs", str(FOLDER), "--out", str(tmp_path)]) == 0
    for name in ("forest", "equivalence"):
        made = (tmp_path / f"{name}.svg").read_text(encoding="utf-8")
        kept = (ROOT / "docs" / "evidence" / f"{name}.svg").read_text(encoding="utf-8")
        assert made.count("<path") == kept.count("<path") > 50


def test_a_record_that_was_edited_is_refused(tmp_path: Path) -> None:
    record = json.loads(gzip.decompress((FOLDER / "towns.json.gz").read_bytes()))
    record["placements"].reverse()
    edited = tmp_path / "edited.json.gz"
    edited.write_bytes(gzip.compress(json.dumps(record).encode()))
    with pytest.raises(ValueError, match="its placements are not those of its plan"):
        displays.read(edited)
