"""A small world that the tests of evidence share."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

import sightline

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session", autouse=True)
def from_the_project() -> None:
    """Names scenes from the folder of the project."""
    os.chdir(ROOT)


SMALL = {
    "sightline": 1,
    "name": "small",
    "roi": {"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]},
    "lidar": {"channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 250, "range": 60},
    "mount": {"min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "lidars": 4},
    "frames": 3,
    "ego": {
        "body": [{"class": "vehicle", "box": {"min": [-2, -0.9, 0.2], "max": [2, 0.9, 1.6]}}],
        "route": {"points": [[0, 0], [100, 0]], "spacing": 1.0},
    },
    "static": [
        {"class": "road", "plane": {"min": [-60, -4], "max": [60, 4], "z": 0}},
        {"class": "sidewalk", "plane": {"min": [-60, 4], "max": [60, 60], "z": 0.1}},
        {"class": "sidewalk", "plane": {"min": [-60, -60], "max": [60, -4], "z": 0.1}},
        {"class": "building", "box": {"min": [-30, 9, 0], "max": [30, 12, 8]}},
        {"class": "vegetation", "box": {"min": [3, -9, 0], "max": [6, -7, 3]}},
        {"class": "pole", "cylinder": {"foot": [8, 5, 0], "radius": 0.15, "height": 5}},
    ],
    "actors": [
        {
            "name": "before",
            "kind": "car",
            "parts": [{"class": "vehicle", "box": {"min": [-2, -0.9, 0], "max": [2, 0.9, 1.5]}}],
            "poses": [{"x": 9, "y": 0}, {"x": 10, "y": 0}, {"x": 11, "y": 0}],
        },
        {
            "name": "walks",
            "kind": "pedestrian",
            "parts": [{"class": "pedestrian", "box": {"min": [-0.3, -0.3, 0], "max": [0.3, 0.3, 1.8]}}],
            "poses": [{"x": 5, "y": 4}, {"x": 5, "y": 5}, {"x": 5, "y": 6}],
        },
        {
            "name": "hidden",
            "kind": "car",
            "parts": [{"class": "vehicle", "box": {"min": [-2, -0.9, 0], "max": [2, 0.9, 1.5]}}],
            "poses": [{"x": 0, "y": 15}, {"x": 1, "y": 15}, {"x": 2, "y": 15}],
        },
    ],
}


@pytest.fixture(scope="session")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("worlds") / "small.json"
    path.write_text(json.dumps(SMALL), encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def published() -> list[sightline.Placement]:
    return sightline.published()
