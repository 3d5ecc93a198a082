"""Hostile arguments: each is an exception, in an interpreter that lives on; none wraps or is cut to a whole number."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

import sightline

#: Whole numbers that no count, index or seed may be.
NO_NUMBERS = ("-1", "0.9", "nan", "inf", "2**64", "10**400", "True", "np.bool_(True)", "'1'", "[1]", "object()")
#: Calls with `{}` where such a number stands.
COUNTS = (
    "s.random_poses({})",
    "s.random_poses(1, seed={})",
    "s.mesh({})",
    "s.world_from_ego({})",
    "s.cast(p, frame={})",
    "s.cast_rays(np.ones((1, 6)), frame={})",
    "s.scan(p, seed={})",
    "s.scan(p, frames=[0, {}])",
    "s.verify(p, frames={})",
    "s.verify(random={})",
    "s.verify(hostile={})",
    "s.verify(p, sample={})",
    "s.verify(p, sample=1, seed={})",
    "load(frames={})",
    "load(memory={})",
    "sightline.set_threads({})",
    "sightline.Sensor.load('nowhere.json', azimuth_steps={})",
    "sightline.optimize(s, evaluations={})",
    "sightline.optimize(s, seed={})",
    "sightline.optimize(s, population={})",
    "sightline.Psog(**(g | dict(frames={})))",
    "sightline.Psog(**(g | dict(shape=[2, 2, {}])))",
    "sightline.Psog(**(g | dict(index=[3, {}])))",
    "sightline.Psog(**(g | dict(counts=[[1, 0], [0, {}]])))",
    "votes(window={})",
)
#: Calls whose sizes no machine holds, and others that are wrong in one way each.
CALLS = (
    "s.random_poses(10**9 + 1)",
    "s.random_poses(2**63 - 1)",
    "s.score(np.broadcast_to(p, (10**12, 1, 6)))",
    "s.cast_rays(np.broadcast_to(np.ones(6), (10**12, 6)))",
    "s.score(range(2**60))",
    "s.score(np.zeros((1,) * 40))",
    "s.verify(p, sample=2**63)",
    "load(conditions=range(2**60))",
    "load(conditions='fog:mor=50')",
    "sightline.Suite(range(2**60))",
    "sightline.Suite([s, None])",
    "sightline.optimize([])",
    "sightline.optimize(s, seconds=float('nan'))",
    "sightline.optimize(s, target=float('nan'))",
    "sightline.optimize(s, budget=float('nan'))",
    "sightline.Sensor.load('nowhere.json', range=float('nan'))",
    "sightline.Sensor.load('nowhere.json', azimuth_steps=2**31)",
    "sightline.Sensor.load(os.fsdecode(b'\\xff.json'))",
    "sightline.set_threads(65535)",
    "sightline.Psog(**(g | dict(counts=[[65537, 0], [0, 1]])))",
    "sightline.Psog(**(g | dict(voxel=[1, 1])))",
    "sightline.Psog(**(g | dict(voxel=[1, 1, float('nan')])))",
    "sightline.Psog(**(g | dict(classes='ab')))",
    "votes(labels=[[0.9]])",
    "votes(labels=[[float('nan')]])",
    "votes(labels=[[65536]])",
    "votes(labels=[[2**64]])",
    "votes(labels=[[True]])",
    "votes(labels=[[[0]]])",
    "votes(labels=[np.array([0], object)])",
    "votes(classes=[str(k) for k in range(70000)], labels=[[65536]])",
    "votes(points=range(2**60), labels=range(2**60), poses=range(2**60))",
    "votes(roi=[[0, 0, 0]])",
)

INTERPRETER = """
import json, os, sys
import numpy as np
import sightline
nan, inf = float("nan"), float("inf")
scene, calls = json.loads(sys.stdin.read())
load = lambda **options: sightline.Scene.from_dict(scene, **({"backend": "cpu"} | options))
s, p = load(), np.array([[[0, 0, 1.5, 0, 0, 0]]])
g = dict(index=[3, 5], counts=[[1, 0], [0, 2]], frames=2, classes=["a", "b"], roi_min=[0, 0, 0], voxel=[1, 1, 1],
    shape=[2, 2, 2])
frame = dict(points=[np.ones((1, 3))], labels=[[0]], poses=[np.eye(4)], classes=["a"], roi=[[0, 0, 0], [2, 2, 2]],
    voxel=[1, 1, 1])
votes = lambda **change: sightline.Psog.from_scans(**(frame | change))
for call in calls:
    try:
        eval(call)
        said = "nothing"
    except Exception as error:
        said = type(error).__name__
    except BaseException as error:
        said = "beyond Exception: " + type(error).__name__
    print(json.dumps([call, said]), flush=True)
"""


def test_every_hostile_argument_is_an_exception(small) -> None:
    # NumPy takes truth values between numbers for numbers.
    calls = [
        call.format(number) for call in COUNTS for number in NO_NUMBERS if not (", {}]" in call and "True" in number)
    ] + list(CALLS)
    _, scene, *_ = small.__reduce__()[1]
    done = subprocess.run(
        [sys.executable, "-c", INTERPRETER], input=json.dumps([scene, calls]), capture_output=True, text=True, timeout=300
    )
    said = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0 and len(said) == len(calls), (said[-1:], done.stderr[-2000:])
    assert [pair for pair in said if pair[1] not in ("ValueError", "MemoryError")] == []


@pytest.mark.parametrize("number", [np.uint8(2), np.float64(2), 2.0, np.array(2)])
def test_whole_numbers_of_any_type_are_counts(small, number) -> None:
    assert small.random_poses(number).shape == (2, 1, 6)


def test_labels_of_any_type_are_labels() -> None:
    frame = dict(classes=["a"], roi=[[0, 0, 0], [2, 2, 2]], voxel=[1, 1, 1])
    points, pose = [np.ones((2, 3))], [np.eye(4)]
    whole = sightline.Psog.from_scans(points, [[0, -1]], pose, **frame)
    for kind in ("i1", ">i4", "f2", ">f8"):
        labels = [np.array([0, -1], kind)]
        assert sightline.Psog.from_scans(points, labels, pose, **frame).counts.tolist() == whole.counts.tolist()


def test_fields_of_packed_records_are_read_where_they_stand(small) -> None:
    packed = np.zeros(2, dtype=[("flag", "u1"), ("pose", "f8", (1, 6))])
    packed["pose"][:, 0, 2] = [1.5, 1.75]
    assert small.score(packed["pose"]) == small.score(packed["pose"].copy())


def test_messages_name_argument_value_and_range(small) -> None:
    with pytest.raises(ValueError, match=r"^count: is 0\.9; give a whole number, 0 to 1000000000"):
        small.random_poses(0.9)
    with pytest.raises(ValueError, match=r"^frame: is -1; give 0 to 1"):
        small.mesh(-1)
