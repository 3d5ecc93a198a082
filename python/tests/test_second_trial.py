"""Answers of the module that the program gave, too, and the module kept to itself or gave otherwise."""

from __future__ import annotations

import json
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sightline
from sightline import DoubtWarning, Placement, Scene, Suite

#: Ground that falls by a metre behind x = 8.
STREET: dict[str, Any] = {
    "sightline": 1,
    "name": "street",
    "roi": {"min": [-8, -6, 0], "max": [8, 6, 3], "voxel": [1, 1, 1]},
    "psog": {"scan": {"channels": 24, "fov": [-60, 40], "azimuth_steps": 120}},
    "lidar": {"channels": 4, "fov": [-30, 10], "azimuth_steps": 60, "range": 20},
    "mount": {"min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "lidars": 1},
    "frames": 2,
    "static": [
        {"class": "ground", "plane": {"min": [-60, -60], "max": [8, 60], "z": 0}},
        {"class": "ground", "plane": {"min": [8, -60], "max": [60, 60], "z": -1}},
    ],
    "actors": [
        {
            "name": "walker",
            "parts": [{"class": "pedestrian", "box": {"center": [0, 0, 0.9], "size": [0.5, 0.5, 1.8]}}],
            "poses": [{"x": 4, "y": -1}, {"x": 5, "y": 1}],
        }
    ],
}
SPIN = {"channels": 16, "fov": [-40, 10], "azimuth_steps": 180, "range": 40}
CART: dict[str, Any] = {
    "sightline": 1,
    "name": "cart",
    "body": [{"class": "vehicle", "box": {"min": [-1, -0.5, 0.3], "max": [1, 0.5, 1]}}],
    "sensors": [{"name": "spin", "price": 10, "lidar": SPIN}, {"name": "dome", "price": 4, "lidar": {**SPIN, "channels": 6}}],
    "mounts": [
        {"name": "roof", "min": [-0.4, -0.4, 1.4], "max": [0.4, 0.4, 1.7], "pitch": [0, 0.2], "count": [1, 2]},
    ],
    "require": [
        {"name": "adult", "target": "adult", "within": 10, "share": 0.5},
        {"name": "far child", "target": "child", "within": 30, "share": 1.0},
    ],
}
POSES = [[0.2, 0.0, 1.6, 0.0, 0.1, 0.0]]


def program(*arguments: object) -> Any:
    command = [sys.executable, "-m", "sightline", *map(str, arguments), "--backend", "cpu", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


def wrong(call: Any, kind: type[Exception] = ValueError) -> str:
    with pytest.raises(kind) as raised:
        call()
    return str(raised.value)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cart")
    (folder / "street.json").write_text(json.dumps(STREET))
    (folder / "cart.json").write_text(json.dumps(CART))
    lidar = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), POSES[0])) | {"sensor": "spin"}
    out = {"name": "out", "lidars": [{**lidar, "z": 2.0}]}
    (folder / "two.json").write_text(json.dumps({"placements": [{"name": "in", "lidars": [lidar]}, out]}))
    return folder


@pytest.fixture(scope="module")
def cart(files: Path) -> Scene:
    return Scene.load(files / "street.json", vehicle=files / "cart.json", backend="cpu")


@pytest.mark.filterwarnings("ignore")
def test_scores_have_copies_prices_and_broken_rules_of_the_program(files: Path, cart: Scene) -> None:
    theirs = program("score", files / "street.json", files / "two.json", "--vehicle", files / "cart.json")["scores"]
    given = sightline.read_placements(files / "two.json")
    for ours in (cart.score(given), Suite([cart]).score(given)):
        assert ours["requirements_hold_in"].tolist() == [row["requirements_hold_in"] for row in theirs]
        for k, name in enumerate(("adult", "far child")):
            found = [row["requirements"][k]["holds_in"] for row in theirs]
            assert ours.requirements[name]["holds_in"].tolist() == found
        assert ours["price"].tolist() == [row["price"] for row in theirs] == [10, 10]
        assert ours.broken_rules == [row.get("broken_rules", []) for row in theirs]
        assert ours.broken_rules[0] == [] and "0.300 m outside" in ours.broken_rules[1][0]
        assert ours.rows[1]["broken_rules"] == ours.broken_rules[1] == ours.rows[[1]].broken_rules[0]
        assert ours.to_dict()["broken_rules"] == ours.broken_rules
    assert ours.requirements["adult"]["holds_in"][0] > 0.9
    # Copies far off meet less; none are looked at for many placements, or without a tolerance.
    loose = cart.score(given, tolerance="900mm,50deg")
    assert loose.requirements["adult"]["holds_in"][0] < ours.requirements["adult"]["holds_in"][0]
    many = cart.score(np.repeat([POSES], 65, axis=0), sensors=["spin"])
    for none in (cart.score(given, tolerance=None), many):
        assert np.isnan(none["requirements_hold_in"]).all()
    parts = sightline.Scores.concatenate([ours, many])
    assert parts.broken_rules == ours.broken_rules + many.broken_rules


@pytest.mark.parametrize("use", ["score", "suite", "range_card", "optimize"])
def test_ground_that_is_not_level_is_warned_of_once(files: Path, use: str) -> None:
    scene = Scene.load(files / "street.json", vehicle=files / "cart.json", backend="cpu")
    suite = Suite([scene])
    calls = {
        "score": lambda: scene.score(POSES, sensors=["spin"]),
        "suite": lambda: suite.score(POSES, sensors=["spin"]),
        "range_card": lambda: scene.range_card(POSES, sensors=["spin"]),
        "optimize": lambda: sightline.optimize(scene, evaluations=4, tolerance=None),
    }
    with pytest.warns(UserWarning, match=r"the ground of street falls 1.0 m .*; `detections` looks at targets on it") as said:
        calls[use]()
    assert any("level ground" in str(one.message) and one.filename == __file__ for one in said)
    if use != "optimize":
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            calls[use]()


@pytest.mark.filterwarnings("ignore:targets of")
def test_a_result_that_misses_a_requirement_says_so(files: Path, cart: Scene) -> None:
    options = ["--vehicle", files / "cart.json", "--evaluations", 4, "--out", files / "run"]
    theirs = program("optimize", files / "street.json", *options)
    with pytest.warns(DoubtWarning, match="^NOT MET: far child"):
        found = sightline.optimize(cart, evaluations=4)
    assert found.verdict == theirs["verdict"] and "far child" in found.verdict
    # A warning that is an error has the result.
    with warnings.catch_warnings():
        warnings.simplefilter("error", DoubtWarning)
        with pytest.raises(DoubtWarning) as raised:
            sightline.optimize(cart, evaluations=4)
        assert raised.value.result.best == found.best  # type: ignore[attr-defined]
    with pytest.warns(DoubtWarning, match="NOT MET: no point meets all requirements"):
        sightline.front(cart, ["price", "near_gain"], evaluations=0)
    with pytest.warns(DoubtWarning, match="^NOT MET: far child: "):
        by_hand = sightline.optimize(cart, objective=gain, evaluations=8)
    assert "NOT MET: far child: " in by_hand.verdict and by_hand.record["certificate"] is None


@pytest.mark.filterwarnings("ignore")
def test_a_search_that_ends_before_it_has_a_placement_says_so(cart: Scene) -> None:
    def stop(_: object) -> None:
        raise StopIteration

    said = wrong(lambda: sightline.optimize(cart, budget=20, callback=stop), RuntimeError)
    assert said.startswith("callback: ended the search while its sensors were being chosen")


def test_masked_values_are_no_numbers(small: Scene) -> None:
    masked = np.ma.masked_array([[0, 0, 1.6, 0, 0, 0]], mask=[[False] * 5 + [True]])
    calls = [
        lambda: small.score(masked),
        lambda: Placement(masked),
        lambda: small.atlas(masked),
        lambda: small.cast_rays(masked),
        lambda: small.score(POSES, phases=np.ma.masked_array([0.1], mask=[True])),
        lambda: sightline.Psog.from_scans(
            [np.ones((1, 3))], [np.ma.masked_array([0], mask=[True])], [np.eye(4)],
            classes=["a"], roi=[[0, 0, 0], [2, 2, 2]], voxel=[1, 1, 1],
        ),
    ]  # fmt: skip
    assert all("has masked values" in wrong(call) for call in calls)
    assert small.score(np.ma.masked_array(POSES, mask=False)) == small.score(POSES)


def test_arguments_that_are_not_used_are_told(files: Path, small: Scene) -> None:
    street, cart = files / "street.json", files / "cart.json"
    said = r"^frames: is 1000, and the scene has 2; all of them are used\.$"
    with pytest.warns(UserWarning, match=said) as warned:
        assert Scene.load(street, frames=1000, backend="cpu").frames == 2
    assert len(warned) == 1 and warned[0].filename == __file__
    for use in (lambda: list(small.scan(POSES, frames=1000)), lambda: small.verify(POSES, frames=1000, sample=1)):
        with pytest.warns(UserWarning, match=said):
            use()
    with pytest.warns(UserWarning, match=said):
        sightline.optimize(small, evaluations=4, frames=1000)
    assert "backend=\"cpu\" does not use" in wrong(lambda: Scene.load(street, backend="cpu", adapter="nvidia"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = Scene.load(street, vehicle=cart, backend="cpu")
    dear = Placement([[0.2, 0.2, 1.6, 0, 0.1, 0], [-0.2, -0.2, 1.6, 0, 0.1, 0]], name="dear", sensors=["spin", "spin"])
    with pytest.warns(UserWarning, match="starts: `dear` is not started from: it costs 20, and the budget is 10"):
        sightline.optimize(scene, evaluations=4, budget=10, starts=[dear], tolerance=None)


@pytest.mark.filterwarnings("ignore")
def test_errors_name_the_argument_and_what_to_give(files: Path, cart: Scene, small: Scene) -> None:
    street, vehicle = files / "street.json", files / "cart.json"
    cases = {
        "objectives: is 'price,near_gain'; give a list of texts": lambda: sightline.front(cart, "price,near_gain"),  # type: ignore[arg-type]
        "tolerance: is 5; give a length and an angle as text": lambda: sightline.optimize(cart, tolerance=5),  # type: ignore[arg-type]
        "tolerance: `5 cm` is no tolerance": lambda: cart.score(POSES, sensors=["spin"], tolerance="5 cm"),
        "callback: is 5; give a function or None": lambda: sightline.optimize(cart, callback=5),  # type: ignore[arg-type]
        "path: is 7; give a path as text or Path": lambda: Scene.load(7),  # type: ignore[arg-type]
        "folder: is 7; give a path": lambda: Scene.from_dict(STREET, folder=7),  # type: ignore[arg-type]
        "vehicle: is a dict; write it to a file": lambda: Scene.load(street, vehicle=CART),  # type: ignore[arg-type]
        "targets[0]: is 7; give a path": lambda: cart.beams_on(POSES, [7], [5], [0], sensors=["spin"]),  # type: ignore[list-item]
        "is a vehicle, where a scene belongs; give it as vehicle=": lambda: Scene.load(vehicle),
        "is a scene, where a vehicle belongs; load it by Scene.load": lambda: Scene.load(street, vehicle=street),
        "budget: 1 is below the cheapest rig": lambda: sightline.optimize(cart, budget=1),
        "objectives: has 1 objective; name two or three": lambda: sightline.front(cart, ["price"]),
        "fewest: the vehicle requires nothing": lambda: sightline.optimize(small, fewest=True),
        "give vehicle= when the scene is loaded": lambda: sightline.optimize(small, budget=1),
        "sensors: has the length 1; give a name for each LiDAR, 2 in all": lambda: cart.score(POSES * 2, sensors=["spin"]),
        "phase = inf is not usable; give a finite number (radians": lambda: small.score(POSES, phases=[np.inf]),
        "random_poses() has the models of space().sensors": lambda: cart.score(cart.random_poses(2)),
    }
    for sentence, call in cases.items():
        assert sentence in wrong(call)
    assert "--" not in wrong(lambda: Scene.load(street, vehicle=vehicle, backend="cpu", memory=1).score(POSES, sensors=["spin"]), MemoryError)
    typo = wrong(lambda: Scene.from_dict({**STREET, "mouts": 1}))
    assert typo.startswith("scene: unknown key `mouts`") and "line" not in typo
    assert "line" not in wrong(lambda: sightline.Sensor.from_dict({**SPIN, "fof": 1}))


def test_paths_of_any_kind_are_taken(files: Path, cart: Scene, tmp_path: Path) -> None:
    assert Scene.load(bytes(files / "street.json"), backend="cpu").name == "street"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        vehicle = sightline.Vehicle.load(files / "cart.json")
        assert Scene.load(files / "street.json", vehicle=vehicle, backend="cpu").sensors.keys() == cart.sensors.keys()
    box = tmp_path / "box.json"
    box.write_text(json.dumps({"sightline": 1, "name": "box", "shapes": [{"box": {"center": [0, 0, 0.5], "size": [1, 1, 1]}}]}))
    found = cart.beams_on(POSES, [box, "adult"], [5], [0], sensors=["spin"])
    assert found.shape == (2, 1, 1, 1) and found.min() > 0


def test_placements_are_written_as_they_are(cart: Scene, tmp_path: Path) -> None:
    placements = [Placement(np.array(POSES) / 3, name=name, sensors=["spin"], phases=[0.1]) for name in "ab"]
    for given in (placements, placements[0]):
        sightline.write_placements(given, tmp_path / "p.json")
        assert sightline.read_placements(tmp_path / "p.json") == (given if given is placements else placements[:1])
    said = wrong(lambda: sightline.write_placements(placements[:1] * 2, tmp_path / "q.json"))
    assert said.startswith("placements: `a` is there twice") and not (tmp_path / "q.json").exists()


def test_files_that_are_missing_are_told_once() -> None:
    for read in (Scene.load, sightline.Sensor.load, sightline.read_placements, sightline.Rig.load):
        said = wrong(lambda: read("no.json"), FileNotFoundError)
        assert said.count("No such file") == 1 and "os error" not in said and "cannot be read" not in said
    assert wrong(lambda: Scene.load("no.json"), FileNotFoundError) == "[Errno 2] No such file or directory: 'no.json'"


def test_numbers_of_numpy_are_taken_in_dicts() -> None:
    rays: dict[str, Any] = {"directions": np.eye(3), "range": np.float32(50)}
    assert len(sightline.Sensor.from_dict(rays)) == 3
    spin = {**SPIN, "azimuth_steps": np.int64(180), "fov": (np.float64(-40), np.float32(10))}
    assert len(sightline.Sensor.from_dict(spin)) == 16 * 180
    cases = {
        "lidar.range: is {1}; give a number": {**SPIN, "range": {1}},
        "lidar.directions[1][2]: is NaN; give a finite": {"directions": np.array([[1, 0, 0], [0, 1, np.nan]]), "range": 1},
        "lidar: has the key 1.5; give texts as keys": {**SPIN, 1.5: {2}},
    }
    for sentence, lidar in cases.items():
        assert sentence in wrong(lambda: sightline.Sensor.from_dict(lidar))


def test_a_scene_of_a_dict_is_named_where_its_parts_have_files(cart: Scene, tmp_path: Path) -> None:
    shape = {"box": {"center": [0, 0, 0.5], "size": [1, 1, 1]}}
    (tmp_path / "box.json").write_text(json.dumps({"sightline": 1, "name": "box", "shapes": [shape]}))
    vehicle = {**CART, "require": [{"name": "box", "target": "box.json", "within": 9, "share": 0.1}]}
    still = {key: STREET[key] for key in ("sightline", "roi", "psog", "static")} | {"name": "flat", "vehicle": vehicle}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        flat = Scene.from_dict(still, folder=tmp_path, backend="cpu")
        moving = {key: STREET[key] for key in ("frames", "actors")}
        other = Scene.from_dict({**still, **moving, "name": "other"}, folder=tmp_path, backend="cpu")
        said = wrong(lambda: Suite([other, flat]).score(POSES, sensors=["spin"]))
    assert "the scene `flat` has a P-SOG in which nothing is uncertain" in said and "box.json" not in said


@pytest.mark.filterwarnings("ignore:targets of")
def test_likely_mistakes_about_targets_and_angles_are_doubts(cart: Scene) -> None:
    with pytest.warns(DoubtWarning, match=r"stand in the own body .*: 1 of 2 places do, the first is adult at 0.5 m and 0°"):
        cart.beams_on(POSES, ["adult"], [0.5, 9], [0], sensors=["spin"])
    with pytest.warns(DoubtWarning, match="values: .* radians"):
        cart.sweep(POSES, "0.pitch", [0, 0.1, 0.2], sensors=["spin"])


def test_plots_come_with_the_module() -> None:
    code = "import sightline; print(sightline.plot.__name__, hasattr(sightline, 'plots'))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["sightline.plot", "False"], done.stderr
    pytest.importorskip("matplotlib")
    scene = Scene.from_dict(STREET, backend="cpu")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = sightline.optimize(scene, objective=gain, evaluations=8)
    assert sightline.plot.convergence(found).get_ylabel() == "gain"


def gain(scores: sightline.Scores) -> Any:
    return scores["near_gain"]
