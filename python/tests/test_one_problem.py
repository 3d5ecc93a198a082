"""The program and the module pose one problem from the same files, to the last bit: scores and optimum."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import sightline
from sightline import Scene, Suite

ROOM: dict[str, Any] = {
    "sightline": 1,
    "name": "room",
    "roi": {"min": [-4, -3, 0], "max": [4, 3, 3], "voxel": [0.5, 0.5, 0.5]},
    "psog": {"scan": {"channels": 24, "fov": [-60, 40], "azimuth_steps": 120}},
    "lidar": {"channels": 8, "fov": [-30, 10], "azimuth_steps": 60, "range": 20},
    "mount": {"min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "roll": [-0.3, 0.3], "min_distance": 0.2, "lidars": 2},
    "coverage": "first-hit",
    "frames": 3,
    "static": [
        {"class": "ground", "plane": {"min": [-4, -3], "max": [4, 3], "z": 0.1}},
        {"class": "wall", "box": {"center": [3.9, 0, 1.5], "size": [0.2, 6, 3]}},
        {"class": "wall", "box": {"center": [-3.9, 0, 1.5], "size": [0.2, 6, 3]}},
    ],
    "actors": [
        {
            "name": "walker",
            "parts": [{"class": "pedestrian", "box": {"center": [0, 0, 0.9], "size": [0.5, 0.5, 1.8]}}],
            "poses": [{"x": 2, "y": -1}, {"x": 2, "y": 0}, {"x": 2, "y": 1}],
        }
    ],
}

CART: dict[str, Any] = {
    "sightline": 1,
    "name": "cart",
    "sensors": [
        {
            "name": "turning",
            "price": 10,
            "phase": "free",
            "lidar": {"channels": 6, "fov": [-40, 30], "azimuth_steps": 60, "range": 20},
        },
        {
            "name": "sector",
            "price": 3,
            "lidar": {"channels": 5, "fov": [-30, 30], "azimuth": [-50, 50], "azimuth_steps": 31, "range": 8},
        },
    ],
    "mounts": [
        {
            "name": "roof", "min": [-0.4, -0.4, 1.4], "max": [0.4, 0.4, 1.7], "roll": [-0.2, 0.2],
            "sensors": ["turning"], "count": [1, 2],
        },
        {
            "name": "front", "min": [0.45, -0.3, 0.9], "max": [0.55, 0.3, 1.2], "yaw": [-0.3, 0.3],
            "sensors": ["sector"], "count": [0, 1],
        },
        {
            "name": "rear", "min": [-0.55, -0.3, 0.9], "max": [-0.45, 0.3, 1.2], "yaw": [2.84, 3.44],
            "sensors": ["sector"], "count": [0, 1],
        },
    ],
    "min_distance": 0.2,
}  # fmt: skip

PLAIN = [
    {"name": "apart", "lidars": [{"x": 0.4, "y": 0, "z": 1.7}, {"x": -0.4, "y": 0.1, "z": 1.3, "roll": 0.1}]},
    {"name": "down", "lidars": [{"x": 0, "y": 0, "z": 1.3, "pitch": 0.6}, {"x": 0.3, "y": 0.4, "z": 1.7}]},
]
MIXED = [
    {"name": "roof", "lidars": [{"x": 0.3, "y": 0, "z": 1.6, "roll": 0.1, "sensor": "turning"}]},
    {
        "name": "both",
        "lidars": [
            {"x": 0, "y": 0, "z": 1.5, "sensor": "turning"},
            {"x": 0.5, "y": 0.1, "z": 1, "yaw": 0.2, "sensor": "sector"},
        ],
    },
]


def program(*arguments: object) -> Any:
    command = [sys.executable, "-m", "sightline", *map(str, arguments), "--backend", "cpu", "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    other = {**ROOM, "name": "other", "static": [*ROOM["static"][:2], {"class": "wall", "box": ROOM_WALL}]}
    for name, value in [("room", ROOM), ("other", other), ("cart", CART)]:
        (tmp_path / f"{name}.json").write_text(json.dumps(value))
    for name, value in [("plain", PLAIN), ("mixed", MIXED)]:
        (tmp_path / f"{name}.json").write_text(json.dumps({"placements": value}))
    return tmp_path


ROOM_WALL = {"center": [-2.4, 0, 1.5], "size": [0.2, 6, 3]}

CASES = [
    (["room"], "plain", None, [], {}),
    (["room"], "mixed", "cart", [], {"budget": 16.0}),
    (["room"], "plain", None, ["fog:mor=8"], {}),
    (["room", "other"], "plain", None, [], {"mirror": True}),
    (["on_file"], "plain", None, [], {}),
]


@pytest.mark.parametrize(("scenes", "placements", "vehicle", "conditions", "search"), CASES)
def test_the_program_and_the_module_pose_one_problem(
    folder: Path, scenes: list[str], placements: str, vehicle: str | None, conditions: list[str], search: dict[str, Any]
) -> None:
    if scenes == ["on_file"]:
        psog = folder / "room.psog.npz"
        Scene.load(folder / "room.json", backend="cpu").psog.save(psog)
        (folder / "on_file.json").write_text(json.dumps({**ROOM, "psog": {"file": psog.name}}))
    paths = [folder / f"{scene}.json" for scene in scenes]
    car = folder / f"{vehicle}.json" if vehicle else None
    options = [*(["--vehicle", car] if car else [])]
    for condition in conditions:
        options += ["--condition", condition]

    loaded = [Scene.load(path, vehicle=car, conditions=conditions, backend="cpu") for path in paths]
    given = sightline.read_placements(folder / f"{placements}.json")
    scores = Suite(loaded).score(given) if len(loaded) > 1 else loaded[0].score(given)
    told = program("score", *paths, folder / f"{placements}.json", *options)
    told = told["mean"] if len(loaded) > 1 else told["scores"]
    for column in ("covered", "near_gain", "information_gain"):
        assert list(scores[column]) == [row[column] for row in told], column
    assert min(scores["information_gain"]) > 0

    if "budget" in search:
        options += ["--budget", search["budget"]]
    if "mirror" in search:
        options += ["--mirror"]
    out = ["--out", folder / "run", "--evaluations", 12, "--seed", 3]
    told = program("optimize", *paths, *options, *out)
    found = sightline.optimize(loaded if len(loaded) > 1 else loaded[0], evaluations=12, seed=3, **search)
    assert found.record["best"] == told["best"] and told["best"] is not None
    assert found.record["baselines"] == told["baselines"]
    assert found.record.get("near_field") == told.get("near_field")
    assert found.record["settings"].get("equipped") == told["settings"].get("equipped")
