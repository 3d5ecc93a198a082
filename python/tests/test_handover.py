"""The folder of a rig and the page of a search against the files of the program; sentences in Python's words."""

from __future__ import annotations

import json
import pickle
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import sightline
from sightline import Placement, Scene, Vehicle, _native

#: Scene, vehicle and poses of another test.
TRIAL: dict[str, Any] = runpy.run_path(str(Path(__file__).with_name("test_second_trial.py")))
STREET, CART, POSES = TRIAL["STREET"], TRIAL["CART"], TRIAL["POSES"]
in_python: Any = getattr(_native, "_in_python")


def program(*arguments: object) -> None:
    command = [sys.executable, "-m", "sightline", *map(str, arguments), "--backend", "cpu", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode in (0, 1), done.stderr


def held(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture(scope="module")
def cart(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scene, vehicle and the file of one placement."""
    folder = tmp_path_factory.mktemp("cart")
    (folder / "street.json").write_text(json.dumps(STREET))
    (folder / "cart.json").write_text(json.dumps(CART))
    sightline.write_placements(Placement(POSES, name="one", sensors=["spin"]), folder / "one.json")
    return folder


@pytest.mark.filterwarnings("ignore")
def test_a_folder_has_the_bytes_of_the_program(cart: Path, tmp_path: Path) -> None:
    street, car, file = cart / "street.json", cart / "cart.json", cart / "one.json"
    asked = ("--vehicle", car, "--margin", "0.1", "--base-link=-1,0,0.5")
    program("rig", "handover", street, file, "--frame", "1", *asked, "--out", tmp_path / "theirs")
    scene = Scene.load(street, vehicle=car, backend="cpu")
    options: dict[str, Any] = {"margin": 0.1, "base_link": [-1, 0, 0.5]}
    made = sightline.handover(file, tmp_path / "ours", scene=scene, frame=1, **options)
    theirs = held(tmp_path / "theirs")
    assert held(tmp_path / "ours") == theirs and sorted(made["files"]) == sorted(theirs)
    [[own, beams]] = made["own_beams"]
    assert (made["placement"], made["price"], beams) == ("one", 10, 16 * 180)
    assert f"LiDAR 0: {own} of {beams} beams" in theirs["README.txt"].decode() and own > 0
    # Without a scene on level ground.
    program("rig", "handover", file, *asked, "--out", tmp_path / "level")
    sightline.handover(str(file), str(tmp_path / "own level"), vehicle=Vehicle.load(car), **options)
    assert held(tmp_path / "own level") == held(tmp_path / "level")
    # A placement and a scene in memory have no files to name.
    [one] = sightline.read_placements(file)
    bare = {key: value for key, value in STREET.items() if key not in ("lidar", "mount")}
    memory = Scene.from_dict({**bare, "vehicle": CART}, backend="cpu")
    for n, of in enumerate([scene, memory]):
        sightline.handover(one, tmp_path / str(n), scene=of, frame=1, **options)
        found = held(tmp_path / str(n))
        assert found.keys() == theirs.keys()
        differ = {name for name in found if found[name] != theirs[name]}
        assert differ <= {"README.txt", "drawing.svg", "drawing.pdf"}
        readme = found["README.txt"].decode()
        assert "Placement one; drawn by" in readme and "one.json" not in readme and ("cart.json" in readme) == (n == 0)


@pytest.mark.filterwarnings("ignore")
def test_a_run_is_handed_over_and_its_page_is_that_of_a_result(cart: Path, tmp_path: Path) -> None:
    street, car, run = cart / "street.json", cart / "cart.json", tmp_path / "run"
    program("optimize", street, "--vehicle", car, "--evaluations", "12", "--budget", "15", "--out", run)
    program("rig", "handover", run, "--out", tmp_path / "theirs")
    scene = Scene.load(street, vehicle=car, backend="cpu")
    sightline.handover(run, tmp_path / "alone")
    sightline.handover(run, tmp_path / "in scene", scene=scene)
    theirs = held(tmp_path / "theirs")
    assert held(tmp_path / "alone") == theirs and b"Result: " in theirs["README.txt"]
    # A vehicle that is given may be another one: the run's words about its own are left out, as by the program.
    program("rig", "handover", street, run, "--vehicle", car, "--out", tmp_path / "their scene")
    assert held(tmp_path / "in scene") == held(tmp_path / "their scene") != theirs

    result = sightline.optimize(scene, evaluations=12, budget=15)
    result.report(tmp_path / "page.html")
    ours, want = (tmp_path / "page.html").read_text(), in_python((run / "report.html").read_text())

    def bare(page: str) -> str:
        """The page without times, commands and settings."""
        page = re.sub(r"<pre class=\"wide\"[^>]*>.*?</pre>", "", page, flags=re.S)
        page = re.sub(r"<dt>(rate|time)</dt><dd>.*?</dd>", "", page)
        return page.replace("<p>How far each LiDAR may be off, and the body may tilt, until a requirement breaks:</p>", "")

    assert bare(ours) == bare(want) and len(bare(ours)) > 20_000
    assert "sightline optimize" not in ours and "Copies are mounted up to 5 mm" in ours
    result.report(str(tmp_path / "page.html"))
    with pytest.raises((OSError, ValueError), match="page.html"):
        result.report(tmp_path / "page.html" / "x")
    with pytest.raises(ValueError, match="^report: this result has no page: it was pickled"):
        pickle.loads(pickle.dumps(result)).report(tmp_path / "page.html")
    own = sightline.optimize(scene, objective=lambda scores: scores["near_gain"], evaluations=4)
    with pytest.raises(ValueError, match="objective is a function"):
        own.report(tmp_path / "own.html")


@pytest.mark.filterwarnings("ignore")
def test_a_front_writes_its_page(cart: Path, tmp_path: Path) -> None:
    street, car = cart / "street.json", cart / "cart.json"
    asked = ("--front", "price,near_gain", "--evaluations", "0")
    program("optimize", street, "--vehicle", car, *asked, "--out", tmp_path / "run")
    found = sightline.front(Scene.load(street, vehicle=car, backend="cpu"), ["price", "near_gain"], evaluations=0)
    found.report(tmp_path / "page.html")
    theirs = in_python((tmp_path / "run" / "report.html").read_text())
    ours = (tmp_path / "page.html").read_text()
    assert ours.split("<section")[:-1] == theirs.split("<section")[:-1] and "sightline optimize" not in ours


def test_faults_of_a_hand_over_have_python_s_words(cart: Path, tmp_path: Path, scene: Scene) -> None:
    one, out, two = Placement(POSES, name="one", sensors=["spin"]), tmp_path / "out", tmp_path / "two.json"
    sightline.write_placements([one, Placement(POSES, name="other", sensors=["spin"])], two)
    street = Scene.load(cart / "street.json", vehicle=cart / "cart.json", backend="cpu")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    poses: Any = POSES
    calls: list[tuple[str, Any]] = [
        (r"name it behind a colon, as `\S*two\.json:one` \(", lambda: sightline.handover(two, out, scene=street)),
        ("give vehicle= or scene=$", lambda: sightline.handover(one, out)),
        ("give frame=0 to 1$", lambda: sightline.handover(one, out, scene=street, frame=2)),
        ("leave out frame=$", lambda: sightline.handover(one, out, vehicle=cart / "cart.json", frame=2)),
        ("^frame: is -1; give", lambda: sightline.handover(one, out, scene=street, frame=-1)),
        ("^margin: is 11; give metres, 0 to 10", lambda: sightline.handover(one, out, scene=street, margin=11)),
        ("^base_link: is .*600.*metres, at most", lambda: sightline.handover(one, out, scene=street, base_link=[600, 0, 0])),
        ("^placement: is .*; give a Placement, or", lambda: sightline.handover(poses, out, scene=street)),
        ("^vehicle: the scene has one", lambda: sightline.handover(one, out, scene=street, vehicle=cart / "cart.json")),
        ("name a new folder$", lambda: sightline.handover(one, tmp_path / "full", scene=street)),
        ("LiDAR 0: .*`spin`", lambda: sightline.handover(one, out, scene=scene)),
    ]
    for match, call in calls:
        with pytest.raises(ValueError, match=match):
            call()
    with pytest.raises(FileNotFoundError):
        sightline.handover(tmp_path / "none.json", out, scene=street)
    assert not out.exists()
    high = Placement([[0.2, 0, 3.0, 0, 0, 0]], sensors=["spin"])
    with pytest.warns(UserWarning, match="RULE BROKEN: "):
        sightline.handover(high, out, scene=street)


#: Sources whose sentences reach Python: errors, notes, verdicts, studies, pages.
SOURCES = ("src/job", "src/search", "src/score", "src/study", "src/targets", "src/shared", "src/near_field", "src/report/page",
           "src/report/front", "src/report/next_steps.rs", "crates/scene/src", "crates/lidar-cast/src", "crates/files/src/json",
           "crates/formats/src/rig/import.rs", "crates/formats/src/rig/sdf.rs", "crates/scan/src")  # fmt: skip
#: Options that no call of the module has, or that are no options.
NOT_OF_PYTHON = {
    "--delta",  # of a grid that is given
    "--fix", "--symmetric", "--equal-height",  # rules of the mount by options
    "--layout",  # of a command that is named with it
    "--own",  # a style
}  # fmt: skip


def test_no_sentence_names_an_option_that_is_an_argument() -> None:
    left = []
    for source in SOURCES:
        for file in [Path(source)] if source.endswith(".rs") else sorted(Path(source).rglob("*.rs")):
            if "tests" in file.parts or file.name == "tests.rs":
                continue
            text = file.read_text().split("#[cfg(test)]")[0]
            # Literals go on over lines; comments and help of commands are not of sentences.
            text = re.sub(r"\\\n\s*", "", re.sub(r"^\s*//.*$|cfg_attr\(.*$", "", text, flags=re.M))
            for literal in re.findall(r'"((?:[^"\\\n]|\\.)*)"', text):
                literal = literal.replace('\\"', '"')
                if re.search(r"--[a-z]|`sightline ", literal):
                    told = in_python(literal)
                    left += [f"{file}: {told}" for option in re.findall(r"--[a-z-]+|`sightline [a-z]+", told)
                             if option not in NOT_OF_PYTHON]  # fmt: skip
    assert left == []


def test_sentences_are_told_in_python_s_words() -> None:
    for theirs, ours in {
        "or give --sensor 0=a (in Python sensors=[…])": "or give sensors=[…]; random_poses() has the models of space().sensors",
        "one model: the file of a vehicle, `--vehicle FILE` (in Python vehicle=…)": "one model: the file of a vehicle, vehicle=…",
        "give a vehicle with --vehicle (in Python load the scene with one)": "give vehicle= when the scene is loaded",
        "give --sensor top=MODEL or --optical-height top=METRES": 'give models={"top": "MODEL"}',
        "for one; give --optical-height VLP-16=METRES": "for one; add it to z of `poses`",
        "name a model of that view with --sensor": "name a model of that view with models=",
        "is at z = 0, --base-link=0,0,2 counts heights": "is at z = 0, base_link=0,0,2 counts heights",
        "pick one with --base-frame top": "pick one with base_frame=top",
        "another seed (--seed 2), more evaluations (--evaluations 40)": "another seed (seed=2), more evaluations (evaluations=40)",
        "`sightline optimize` with --budget PRICE refines one": "`sightline.optimize` with budget=PRICE refines one",
        "as `sightline rig handover a.json b.json:c` (it has c)": "as `b.json:c` (it has c)",
    }.items():
        assert in_python(theirs) == ours
