"""Tests of the benchmark: `python3 -m pytest benches/searches`; the last one needs module and program."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import random
import sys
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benches.searches import ours, peers, table  # noqa: E402
from benches.searches.bench import Bench, LeftOut, lidars  # noqa: E402
from benches.searches.__main__ import main, parsed  # noqa: E402
from benches.searches.front import Place, Scored, equipped, volume  # noqa: E402
from benches.searches.figure import drawn, steps  # noqa: E402
from benches.searches.problems import Mount, Space, mount_of, partners, problems, space_of  # noqa: E402
from benches.searches.records import Absent, BestKnown, Store  # noqa: E402
from benches.searches.scoring import Budget, Spent, confirmed, cost  # noqa: E402
from benches.searches.variants import START, level, or_start, paired, variants  # noqa: E402

BOX = Mount((-1, -2, 1, -0.1, 0, 0), (1, 2, 1, 0.3, 0, 0))
PROGRAM = Path(os.environ.get("SIGHTLINE", problems(Path())["uc"].scenes[0].parents[1] / "target/release/sightline"))


def test_quartiles_interpolate_between_ranks_and_put_the_unmet_last():
    assert table.quartiles([4.0, 1.0, 3.0, 2.0]) == (1.75, 2.5, 3.25)
    assert table.quartiles([7.0]) == (7.0, 7.0, 7.0)
    assert table.quartiles([table.UNMET, 1.0, 2.0]) == (table.UNMET, 1.0, 1.5)
    assert table.quantile([table.UNMET, table.UNMET], 0.5) == table.UNMET


def test_a_vehicle_that_is_made_is_written_and_named_without_its_folder(tmp_path):
    known = problems(tmp_path)
    if "lexus" not in known:
        pytest.skip("../shared is not there")
    lexus = known["lexus"]
    lexus.scenes[0].write_text("{}")  # Stands for the scene, which the program would make.
    ours.made(lexus, PROGRAM)
    vehicle = json.loads(lexus.vehicle.read_text())
    top = next(mount for mount in vehicle["mounts"] if mount["name"] == "top")
    assert (top["min"][0], top["max"][0]) == pytest.approx((0.7, 1.1))
    assert lexus.shown == ["street.json", "--vehicle", "lexus.json"]


def test_no_file_of_the_repository_is_made_anew(tmp_path):
    for problem in problems(tmp_path).values():
        assert not problem.vehicle_made or problem.vehicle.is_relative_to(tmp_path), problem.key
        assert not problem.made or problem.scenes[0].is_relative_to(tmp_path), problem.key
        assert problem.title, problem.key


def test_a_rig_of_variables_has_the_sensors_and_the_poses_that_they_say():
    places = [Place(("a", "b"), BOX, "roof"), Place(("c",), BOX, "nose")]
    rig = equipped(places, [0.5, 0.25, 0.5, 1.0, 0.49, 0.0, 0.0, 0.0])
    assert [sensor for sensor, _ in rig] == ["a"], "the second place stays empty below a half"
    # BOX has x, y and roll free.
    assert rig[0][1] == pytest.approx([-0.5, 0.0, 1.0, 0.3, 0.0, 0.0])
    assert [sensor for sensor, _ in equipped(places, [1.0, 0, 0, 0, 1.0, 0, 0, 0])] == ["b", "c"]


def test_a_hypervolume_is_the_share_of_the_rectangle_that_is_beaten():
    pytest.importorskip("moocore")
    assert volume([], 10.0) == 0.0
    # Two rectangles that overlap: half the price times 0.2, and the rest of the price to 0.8 times 0.6, less none twice.
    assert volume([(5.0, 0.2), (8.0, 0.6), (9.0, 0.5)], 10.0) == pytest.approx(0.5 * 0.2 + 0.2 * 0.4)


def test_rigs_that_break_a_rule_are_not_cast_and_miss_more_than_a_requirement_can():
    class Scene:
        def score(self, placements, sensors):
            assert (len(placements), sensors) == (1, ["a", "a"])
            table = {"near_gain": [0.5], "seen.ring": [0.25]}
            return type("Scores", (dict,), {"guards": [[]]})(table)

    vehicle = {"sensors": [{"name": "a", "price": 2}], "min_distance": 0.2, "require": [{"name": "ring", "share": 0.75}]}
    scored = Scored(Scene(), vehicle, 4)
    apart, close = (([("a", [0.0] * 6), ("a", [x, 0, 0, 0, 0, 0])]) for x in (0.5, 0.1))
    found = scored.all([apart, close, []])
    assert found[0] == (4.0, 0.5, 0.5) and scored.cast == 1
    assert found[1] == (4.0, 0.0, pytest.approx(10.1)) and found[2][0] == 0.0 and found[2][2] >= 10.0


def test_margins_are_of_the_peers_value_and_infinite_where_one_met_nothing():
    assert table.margin(1.1, 1.0) == pytest.approx(10.0)
    assert table.margin(-1.0, -2.0) == pytest.approx(50.0), "above the peer is above zero"
    assert (table.margin(1.0, None), table.margin(None, 1.0)) == (math.inf, -math.inf)
    assert table.margin(None, None) == 0.0


def test_rows_say_median_worst_spread_distance_and_who_met_all():
    row = table.own_row("o", [0.30, 0.32, 0.31], [1.0, 3.0, 2.0], 0.40)
    assert row == "| o | 31.000 | 30.000 | 6.45 | 22.50 | 3 of 3 | 2.0 |"
    assert "| unmet | – |" in table.own_row("o", [0.3, None, 0.3], [1.0], 0.4)
    row = table.peer_row("p", {1: 0.33, 2: 0.30, 3: 0.31}, {1: 0.30, 2: 0.40, 3: None}, [1.0], "5 × 4")
    assert row == "| p | 30.000 | +10.00 | -25.00 | 2 of 3 | 5 × 4 | 1.0 |"


def test_curves_have_quartiles_over_seeds_at_each_mark():
    runs = [[{"work": work, "cpu_seconds": work / 10, "value": seed * work} for work in (10, 20)] for seed in (1, 2, 3)]
    assert steps(runs) == [(10, 1.0, (15.0, 20.0, 25.0)), (20, 2.0, (30.0, 40.0, 50.0))]


def test_figures_are_drawn_or_say_what_is_missing(tmp_path, monkeypatch):
    points = [{"work": work, "cpu_seconds": work / 10, "value": 0.3} for work in (10, 20)]
    curves = {"optimize": [points], "met <nothing>": [[{**point, "value": None} for point in points]]}
    if importlib.util.find_spec("matplotlib"):
        assert drawn(tmp_path / "a.svg", "a scene", 0.31, curves) is None
        text = (tmp_path / "a.svg").read_text()
        ElementTree.fromstring(text)
        assert "a scene" in text and "optimize" in text and "met" in text
        assert drawn(tmp_path / "b.svg", "a scene", 0.31, curves) is None
        assert (tmp_path / "b.svg").read_text() == text, "no date, no chance"
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert drawn(tmp_path / "c.svg", "a scene", 0.31, curves).endswith("pip install matplotlib")
    assert not (tmp_path / "c.svg").exists()


def test_what_is_finished_is_not_run_again_and_other_settings_are_refused(tmp_path):
    ran = []

    def run():
        ran.append(1)
        return {"value": 0.5}

    store = Store(tmp_path)
    first = store.done("uc", "random", 1, {"work": 10}, run)
    assert Store(tmp_path).done("uc", "random", 1, {"work": 10}, run) == first
    assert len(ran) == 1 and [path.name for path in store.folder.iterdir()] == ["uc.random.1.json"]
    with pytest.raises(SystemExit, match="another --out"):
        store.done("uc", "random", 1, {"work": 20}, run)
    with pytest.raises(KeyboardInterrupt):
        store.done("uc", "random", 2, {}, lambda: (_ for _ in ()).throw(KeyboardInterrupt))
    assert store.get("uc", "random", 2) is None, "a run that was stopped leaves nothing"


def test_a_method_that_the_program_refuses_is_left_out_with_its_words(tmp_path, monkeypatch):
    args = parsed(["--methods", "swaps", "--seeds", "1", "--evaluations", "9", "--out", str(tmp_path)])
    args.best_known = tmp_path / "best.json"
    bench = Bench(args)
    monkeypatch.setattr(bench, "say", lambda *of: None)
    monkeypatch.setattr(ours, "made", lambda *of: None)

    def optimized(problem, seed, options, *of):
        if "swaps" in options:
            raise ours.Refused("sightline optimize …: exit code 2\nsightline: too many poses")
        return {"value": 0.5, "work": 1, "cpu_seconds": 1.0, "lidars": [], "command": "optimize"}

    monkeypatch.setattr(ours, "optimized", optimized)
    found = bench.measured(problems(tmp_path)["van"])
    assert list(found) == ["ours"]
    assert bench.notes == ["swaps is left out on van on a street: sightline: too many poses"]


def result_of(value):
    """A record of a run, as far as the benchmark reads it."""
    return {"value": value, "work": 100, "cpu_seconds": 1.0, "lidars": [], "mounts": None, "baseline": None,
            "search_frames": 4, "required": {}, "command": "optimize", "commit": "c"}


def kept(tmp_path, values, *told):
    """A benchmark with --kept of runs of uc whose values are by evaluations and seed."""
    store = Store(tmp_path)
    for (count, seed), value in values.items():
        store.done("uc", f"ours-{count}", seed, {"options": f"--evaluations {count}"}, lambda v=value: result_of(v))
    args = parsed(["--kept", "--seeds", "4", "--evaluations", "45,90", "--out", str(tmp_path), *told])
    args.best_known = tmp_path / "best.json"
    return Bench(args)


def test_more_evaluations_are_held_against_fewer_seed_by_seed(tmp_path):
    row = table.more_row("uc", 45, 90, {1: (0.30, 0.33), 2: (0.40, 0.39), 3: (0.30, 0.30)})
    assert row == "| uc | 90 against 45 | +0.00 | -2.50 | 1 of 3: 2 |"
    assert "| only 90 meets all | only 45 meets all | 1 of 3: 2 |" in \
        table.more_row("uc", 45, 90, {1: (None, 0.3), 2: (0.4, None), 3: (None, 0.3)})
    values = {(45, 1): 0.30, (90, 1): 0.33, (45, 2): 0.40, (90, 2): 0.39, (45, 3): 0.50}
    bench = kept(tmp_path, values)
    uc = problems(tmp_path)["uc"]
    assert bench.more(uc) == ["| urban-crossing | 90 against 45 | +3.75 | -2.50 | 1 of 2: 2 |"], "seed 3 has no 90"
    assert bench.more(problems(tmp_path)["hw"]) == []
    bench.args.options = ["--symmetric"]
    with pytest.raises(SystemExit, match="another --out"):
        bench.more(uc)


def test_kept_runs_give_table_and_figure_and_nothing_is_run(tmp_path, monkeypatch, capsys):
    kept(tmp_path, {(45, 1): 0.30, (90, 1): 0.33, (45, 2): 0.40})
    monkeypatch.setattr(ours, "called", lambda *of: pytest.fail("runs the program"))
    monkeypatch.setattr(peers, "lacking", lambda *of: pytest.fail("looks for a peer"))
    told = ["--kept", "--problems", "uc,hw,uc-fog", "--methods", "ours,swaps,random", "--seeds", "2", "--evaluations",
            "45,90", "--best-known", str(tmp_path / "best.json"), "--program", "/nowhere"]
    assert main([*told, "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert printed == (tmp_path / "table.md").read_text()
    assert "| `optimize`, 90 evaluations | 33.000 | 33.000 | 0.00 |" in printed and "90 against 45" in printed
    assert "## highway" not in printed and "highway, seeds that are there: ours 0, swaps 0, random 0" in printed
    assert "urban-crossing, seeds that are there: ours 1, swaps 0, random 0" in printed
    assert "Left out on urban-crossing in fog: swaps, random; `optimize` alone" in printed
    assert (tmp_path / "uc.svg").exists() == (importlib.util.find_spec("matplotlib") is not None)
    assert main([*told, "--out", str(tmp_path / "none")]) == 2
    assert "holds no results" in capsys.readouterr().err
    with pytest.raises(Absent, match="uc.random.1.json"):
        Store(tmp_path, kept=True).done("uc", "random", 1, {}, lambda: pytest.fail("runs"))


def test_a_peer_that_finds_no_start_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "lacking", lambda method: None)
    args = parsed(["--methods", "pycma-start", "--out", str(tmp_path)])
    args.best_known = tmp_path / "best.json"
    bench, uc = Bench(args), problems(tmp_path)["uc"]
    with pytest.raises(LeftOut, match="from the best baseline is left out on urban-crossing: no baseline fits"):
        bench.searched(uc, "pycma-start", 1, [result_of(0.3)] * 4)


RIG = [{"x": 0.1 * k, "y": 0.2 * k, "z": 2.4, "roll": 0.1, "pitch": 0.0, "yaw": 0.3} for k in range(1, 5)]


def test_rivals_of_variants_keep_the_rule_of_the_variant():
    assert [lidar["roll"] for lidar in level(RIG)[0]] == [0.0] * 4 and level(RIG)[0][1]["y"] == 0.4
    halves = paired(RIG)
    assert len(halves) == 6 and halves[0][:2] == RIG[:2]
    assert halves[0][2] == {"x": 0.1, "y": -0.2, "z": 2.4, "roll": -0.1, "pitch": 0.0, "yaw": -0.3}
    assert all(partners(half) == [None, None, 0, 1] for half in halves)
    both = or_start(RIG)
    assert both[0] == RIG and len(both) == 2 and len(both[1]) == 4


def test_every_variant_names_its_plain_relative_and_what_is_fair(tmp_path):
    known = problems(tmp_path)
    assert parsed(["--problems", "hw,variants"]).problems == ["hw", *variants(known)]
    assert set(parsed([]).problems) == set(known), "variants are run where they are named"
    for key, variant in variants(known).items():
        assert variant.key == key and variant.plain is known[variant.plain.key]
        assert variant.title and variant.fair and variant.arguments != variant.plain.arguments
        assert all(len(rival) == 4 for rival in variant.rivals(RIG)), key
    start = variants(known)["uc-inject"]
    assert start.shown[1:] == ["--inject", "benches/searches/start.json"] and str(START) in start.arguments


def test_rows_of_variants_say_who_is_behind():
    row = table.variant_row("v", "uc", "as it is", {1: (0.33, 0.30), 2: (0.39, 0.40), 3: (0.32, 0.32)})
    assert row == "| v | 33.000 | uc, as it is | 32.000 | +0.00 | -2.50 | 1 of 3 |"
    row = table.variant_row("v", "uc", "as it is", {1: (0.33, None)})
    assert row.endswith("| unmet | only the variant meets all | only the variant meets all | 0 of 1 |")
    assert table.percent(-math.inf) == "only theirs meets all"


def test_a_variant_stands_beside_what_its_relative_found(tmp_path, monkeypatch):
    args = parsed(["--seeds", "2", "--evaluations", "9,20", "--compare", "20", "--out", str(tmp_path)])
    args.best_known = tmp_path / "best.json"
    bench = Bench(args)
    monkeypatch.setattr(ours, "made", lambda *of: None)
    ran = []

    def optimized(problem, seed, options, *of):
        ran.append((problem.key, seed, *options))
        return {**result_of(0.30 if problem.plain else 0.40), "lidars": RIG}

    def scored(problem, placements, *of):
        assert (problem.key, placements) == ("uc-fix", level(RIG))
        return {"value": 0.32, "lidars": placements[0]}

    monkeypatch.setattr(ours, "optimized", optimized)
    monkeypatch.setattr(ours, "scored", scored)
    text = bench.run([variants(problems(tmp_path))["uc-fix"]])
    row = "| urban-crossing with roll fixed at 0 | 30.000 | urban-crossing, with every roll at 0 | 32.000 | -6.25 | -6.25 | 2 of 2 |"
    assert row in text and "20 evaluations. The relative's placement" in text
    assert [run for run in ran if run[0] == "uc"] == [("uc", seed, "--evaluations", "20") for seed in (1, 2)]
    best = json.loads(args.best_known.read_text())["uc-fix"]
    assert best["value"] == 0.32 and best["command"].endswith(
        "with every roll at 0, as a baseline of sightline optimize scenes/urban-crossing.json --fix roll=0")
    assert (tmp_path / "results/uc-fix.plain-20.2.json").exists()


@pytest.mark.parametrize(("code", "kind"), [(2, ours.Refused), (101, SystemExit)])
def test_only_exit_code_2_is_a_refusal(code, kind):
    says = f"import sys; print('no', file=sys.stderr); sys.exit({code})"
    with pytest.raises(SystemExit, match=f"exit code {code}\nno$") as ended:
        ours.called(Path(sys.executable), ["-c", says], (0,))
    assert ended.type is kind


def test_the_best_known_is_replaced_by_better_alone(tmp_path):
    best = BestKnown(tmp_path / "best.json")
    assert best.offer("uc", 0.5, [{"x": 1.0}], "a", "c")
    assert not best.offer("uc", 0.5 + 5e-10, [], "b", "c")
    assert not best.offer("uc", None, [], "b", "c"), "a broken rule"
    assert best.offer("uc", 0.5 + 2e-9, [], "d", "c")
    kept = json.loads((tmp_path / "best.json").read_text())["uc"]
    assert (kept["value"], kept["command"]) == (0.5 + 2e-9, "d")


def test_variables_span_the_box_and_fixed_fields_stay():
    space = Space([BOX, BOX])
    assert space.variables == 6
    assert space.poses([0] * 6) == [[-1, -2, 1, -0.1, 0, 0]] * 2
    assert space.poses([1, 1, 1, 0.5, 0.25, 0])[0] == [1, 2, 1, 0.3, 0, 0]
    assert space.poses([1, 1, 1, 0.5, 0.25, 0])[1] == pytest.approx([0, -1, 1, -0.1, 0, 0])
    assert space.poses([9] * 6) == space.poses([1] * 6), "clipped"
    assert space.poses([-9] * 6) == space.poses([0] * 6), "clipped"


def test_shares_undo_poses_and_refuse_what_does_not_fit():
    space = Space([BOX, BOX], min_distance=0.1)
    poses = space.poses([0.5, 0.25, 0.75, 0.0, 1.0, 0.5])
    assert space.shares(poses) == pytest.approx([0.5, 0.25, 0.75, 0.0, 1.0, 0.5])
    assert space.shares(poses[:1]) is None and space.shares([poses[0]] * 2) is None
    assert space.shares([poses[0], [3.0, *poses[1][1:]]]) is None, "outside of the box"


def test_missing_distance_is_summed_over_pairs():
    space = Space([BOX] * 3, min_distance=0.5)
    poses = [[0, 0, 0, 0, 0, 0], [0.3, 0, 0, 0, 0, 0], [0.3, 0.4, 0, 0, 0, 0]]
    assert space.missing(poses) == pytest.approx(0.2 + 0.1)
    assert space.missing([poses[0], poses[2]]) == 0.0, "half a metre apart is enough"


def test_symmetric_rigs_are_searched_by_half():
    lidars = [{"x": 1, "y": 0.5, "z": 2, "roll": 0.1, "yaw": 0.2}, {"x": 0, "y": 0.0, "z": 2},
              {"x": 1, "y": -0.5, "z": 2, "roll": -0.1, "yaw": -0.2}]
    assert partners(lidars) == [None, 1, 0]
    space = Space([BOX] * 3, partner=partners(lidars))
    left, middle, right = space.poses([0.5, 0.75, 1.0, 0.25])
    assert right == [left[0], -left[1], left[2], -left[3], left[4], -left[5]] and left[1] == 1.0
    assert middle == [-0.5, 0, 1, 0, 0, 0]


def test_upright_patches_stand_where_the_file_says():
    corners = [[2.0, 1.0, 0.4], [1.0, 2.0, 0.4], [1.0, 2.0, 0.8], [2.0, 1.0, 0.8]]
    mount = mount_of({"polygon": corners, "offset": [0.1, 0.1], "yaw": [-0.4, 0.4]})
    ends = [Space([mount]).poses([share, share, 0.5])[0] for share in (0.0, 1.0)]
    off = 0.1 * math.sqrt(0.5)
    assert ends[0] == pytest.approx([2 + off, 1 + off, 0.4, 0, 0, math.pi / 4])
    assert ends[1] == pytest.approx([1 + off, 2 + off, 0.8, 0, 0, math.pi / 4])
    with pytest.raises(ValueError, match="upright"):
        mount_of({"polygon": [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]})
    with pytest.raises(ValueError, match="keep_out"):
        mount_of({"min": [0, 0, 0], "max": [1, 1, 1], "keep_out": [{"min": [0, 0, 0]}]})


def test_every_problem_has_a_space():
    for key, problem in problems(Path()).items():
        if problem.vehicle is None:
            space = space_of(problem, [], None)
            assert (len(space.mounts), space.min_distance, space.variables) == (4, 0.2, 16), key
    car = problems(Path())["car"]
    space = space_of(car, [{"sensor": "a"}, {"sensor": "b"}], ["roof", "front-left"])
    assert (space.variables, space.sensors) == (5 + 4, ["a", "b"])


class Line:
    """A scene in which the gain is the x of the first LiDAR, over 2 of 4 frames."""

    frames = 2

    def costs(self, placements, sensors, required):
        return [-poses[0][0] for poses in placements]


class Whole(Line):
    """Over all frames high x gain less."""

    frames = 4

    def costs(self, placements, sensors, required):
        return [-min(poses[0][0], 0.8 - poses[0][0]) for poses in placements]


def budget_of(work, least=0.0):
    mount = Mount((0, 0, 0, 0, 0, 0), (1, 0, 0, 0, 0, 0))
    return Budget(Space([mount, mount], least), Line(), {}, work)


def test_a_budget_casts_no_more_than_its_work_and_nothing_that_breaks_a_rule():
    budget = budget_of(5 * 4 + 3, least=0.5)
    assert budget.costs([[0.0, 0.4], [0.6, 0.0]]) == [pytest.approx(1000.1), -0.6]
    assert [entry[2] for entry in budget.cast] == [4]
    with pytest.raises(Spent):
        budget.costs([[0.0, 1.0]] * 9)
    assert len(budget.cast) == 5 and budget.cast[-1][2] == 20
    asked = budget_of(4, least=0.5)
    with pytest.raises(Spent):
        for _ in range(201):
            asked.costs([[0.0, 0.0]])
    assert not asked.cast, "a search that never keeps the rules ends, too"


def test_finalists_are_confirmed_over_all_frames_at_each_mark():
    budget = budget_of(100)
    budget.costs([[0.1, 0.0], [0.3, 0.0], [0.9, 0.0]])
    points = confirmed(budget, Whole(), [2, 8, 12])
    assert [point["value"] for point in points] == [None, pytest.approx(0.3), pytest.approx(0.3)]
    assert [point["placements"] for point in points] == [0, 2, 3]
    assert points[2]["poses"][0][0] == pytest.approx(0.3), "0.9 is best over two frames, not over four"


def test_costs_rise_from_scores_over_requirements_and_guards_to_rules():
    unmet, doubted = cost(0.9, [], 0.01), cost(0.9, ["x"], 0.0)
    assert cost(0.9, [], 0.0) == -0.9 < unmet < doubted < 1000.0
    assert cost(math.nan, [], 0.0) >= doubted - 1
    assert ours.doubts(["blind_sector: behind", "self_hit: LiDAR 0"]) == ["self_hit: LiDAR 0"]


def test_a_result_counts_only_if_it_keeps_everything():
    scores = {"guards": ["blind_sector: behind", "redundant_lidar: LiDAR 1"], "requirements": [{"name": "tyre", "required": 0.9, "met": True}]}
    best = {"placement": {"lidars": [{}, {}]}, "scores": scores, "objective": 0.5, "violations": []}
    spent = {"levels": 1, "search": 2, "swaps": 3, "confirm": 4, "full": 1000}
    result = {"best": best, "fidelity": {"placement_frames": spent}, "methods": [{"poses_cast": 7}],
              "search_frames": 4, "frames": 4, "baselines": []}
    record = ours.record_of(result)
    assert (record["value"], record["work"], record["required"]) == (0.5, 20, {"tyre": 0.9})
    scores["requirements"][0]["met"] = False
    assert ours.record_of(result)["value"] is None
    assert ours.record_of({**result, "fidelity": None})["work"] == 28
    fine = {"placement": {"lidars": [1]}, "scores": {"guards": []}, "objective": 0.2, "violations": []}
    broken = {**fine, "placement": {"lidars": [2]}, "objective": 0.9, "violations": ["too close"]}
    assert ours.best_of([broken, fine, best]) == (0.2, [1]) and ours.best_of([broken]) == (None, None)


@pytest.mark.parametrize("method", peers.PEERS)
def test_peers_climb_and_stop_at_their_budget(method):
    if any(importlib.util.find_spec(name) is None for name in peers.PEERS[method][1]):
        pytest.skip(f"pip install {peers.PEERS[method][2]}")
    runs = []
    for _ in range(2):
        budget = budget_of(120 * 4)
        peers.searched(method, budget.costs, 2, 3, budget.most)
        assert len(budget.cast) == 120
        runs.append([entry[:3] for entry in budget.cast])
    assert min(runs[0])[0] < -0.95
    assert runs[0] == runs[1], "equal seeds, equal searches"


def test_a_peer_that_is_not_there_says_what_to_install(monkeypatch):
    monkeypatch.setitem(peers.PEERS, "de", (None, ("no_such_module",), "nevergrad"))
    monkeypatch.setitem(sys.modules, "sightline", SimpleNamespace())
    assert peers.lacking("de").endswith("pip install nevergrad")


def test_bad_arguments_are_refused(tmp_path, capsys):
    for wrong in (["--problems", "xx"], ["--seeds", "0"], ["--evaluations", "45,x"], ["--methods", ""]):
        with pytest.raises(SystemExit) as ended:
            parsed(wrong)
        assert ended.value.code == 2
    assert main(["--program", "/nowhere", "--out", str(tmp_path)]) == 2
    assert "cargo build" in capsys.readouterr().err


CAR_MOUNTS = ["roof", "roof", "front-left", "front-right", "rear-left", "rear-right"]


@pytest.mark.skipif(not PROGRAM.exists(), reason="needs cargo build --release or SIGHTLINE=PROGRAM")
def test_the_program_allows_the_space_and_no_more(tmp_path):
    car, models = problems(tmp_path)["car"], ["spinning-32"] * 2 + ["solid-120"] * 4
    space = space_of(car, [{"sensor": model} for model in models], CAR_MOUNTS)
    source, drawn = random.Random(2), []
    while len(drawn) < 8:
        poses = space.poses([source.choice([0, 1, source.random()]) for _ in range(space.variables)])
        if space.missing(poses) == 0.0:
            drawn.append(poses)
    close, out = [[list(pose) for pose in drawn[0]] for _ in range(2)]
    close[1] = [close[0][0] - math.copysign(0.19, close[0][0]), *close[0][1:]]
    out[2][0] += 0.001
    named = [{"name": str(k), "lidars": lidars(poses, models)} for k, poses in enumerate([*drawn, close, out])]
    (tmp_path / "drawn.json").write_text(json.dumps({"placements": named}))
    told = ["--baselines", str(tmp_path / "drawn.json"), "--evaluations", "1", "--method", "cma", "--frames", "1",
            "--tolerance", "0", "--out", str(tmp_path / "run"), "--backend", "cpu", "--quiet", "--format", "json"]
    result = json.loads(ours.called(PROGRAM, ["optimize", *car.arguments, *told], (0, 1)))
    found = {row["placement"]["name"]: row["violations"] for row in result["baselines"]}
    assert result["mounts"] == CAR_MOUNTS
    assert [found[str(k)] for k in range(8)] == [[]] * 8
    assert space.missing(close) == pytest.approx(0.01) and "too close" in found["8"][0]
    assert found["9"] and found["9"] != found["0"], "a millimetre off the patch"


@pytest.mark.skipif(not PROGRAM.exists(), reason="needs cargo build --release or SIGHTLINE=PROGRAM")
@pytest.mark.parametrize("key", ["uc-symmetric", "uc-fix", "uc-inject"])
def test_the_program_scores_rivals_by_the_rules_of_the_variant(tmp_path, key):
    variant, rig = variants(problems(tmp_path))[key], or_start([])[1]
    rivals = variant.rivals(rig)
    found = ours.scored(variant, [rig, *rivals], [], PROGRAM, tmp_path)
    assert 0.25 < found["value"] < 0.45
    assert [[lidar[name] for name in ("x", "y", "z", "roll")] for lidar in found["lidars"]] in \
        [[[lidar[name] for name in ("x", "y", "z", "roll")] for lidar in rival] for rival in rivals]
    if key != "uc-inject":
        assert ours.scored(variant, [rig], [], PROGRAM, tmp_path) == {"value": None, "lidars": None}


@pytest.mark.skipif(importlib.util.find_spec("sightline") is None or not PROGRAM.exists(),
                    reason="needs pip install ./python, and cargo build --release or SIGHTLINE=PROGRAM")
def test_the_whole_on_urban_crossing(tmp_path, capsys):
    told = ["--problems", "uc", "--methods", "ours,random", "--seeds", "1", "--evaluations", "20", "--work", "400",
            "--out", str(tmp_path / "out"), "--program", str(PROGRAM), "--best-known", str(tmp_path / "best.json")]
    assert main(told) == 0
    printed = capsys.readouterr().out
    assert printed == (tmp_path / "out/table.md").read_text()
    known = json.loads((tmp_path / "best.json").read_text())["uc"]
    mine = json.loads((tmp_path / "out/results/uc.ours-20.1.json").read_text())
    peer = json.loads((tmp_path / "out/results/uc.random.1.json").read_text())
    last = peer["points"][-1]
    assert known["value"] == max(mine["value"], last["value"]) and last["placements"] == 25
    assert 0.25 < last["value"] < 0.45 and "random search by the rules" in printed
    import sightline

    scene = sightline.Scene.load(problems(tmp_path)["uc"].scenes[0], backend="cpu")
    poses = [[lidar[name] for name in ("x", "y", "z", "roll", "pitch", "yaw")] for lidar in mine["lidars"]]
    assert list(scene.score([poses, last["poses"]])["near_gain"]) == [mine["value"], last["value"]]
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "out/results").iterdir()}
    assert main(told) == 0, "goes on, and runs nothing again"
    assert stamps == {path: path.stat().st_mtime_ns for path in (tmp_path / "out/results").iterdir()}
