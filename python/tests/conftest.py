"""Scenes and placements that the tests share."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import sightline

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session", autouse=True)
def from_the_project() -> None:
    """Scenes are named from the folder of the project. Not while tests are collected: pytest's paths are relative."""
    os.chdir(ROOT)


@pytest.fixture(scope="session")
def scene() -> sightline.Scene:
    return sightline.Scene.load("scenes/industrial-yard.json", backend="cpu", frames=4)


@pytest.fixture(scope="session")
def placements() -> list[sightline.Placement]:
    return sightline.read_placements("scenes/placements.json")


@pytest.fixture(scope="session")
def rig(placements: list[sightline.Placement]) -> sightline.Placement:
    return next(placement for placement in placements if placement.name == "Pyramid-roll")


@pytest.fixture
def small() -> sightline.Scene:
    """A box on the ground before a vehicle, in two frames; three beams."""
    return sightline.Scene.from_dict(SMALL, backend="cpu")


SMALL = {
    "sightline": 1,
    "name": "small",
    "roi": {"min": [-10, -10, -0.5], "max": [10, 10, 3.5], "voxel": [0.5, 0.5, 0.5]},
    "lidar": {"channels": 3, "fov": [-20, 0], "azimuth_steps": 32, "range": 50},
    "mount": {"min": [-0.5, -0.5, 1.5], "max": [0.5, 0.5, 2.0], "lidars": 1},
    "frames": 2,
    "rate": 5,
    "static": [{"class": "ground", "plane": {"min": [-20, -20], "max": [20, 20], "z": 0}}],
    "actors": [
        {
            "name": "crate",
            "kind": "car",
            "parts": [{"class": "vehicle", "box": {"min": [-0.5, -1, 0], "max": [0.5, 1, 2]}}],
            "poses": [{"x": 5, "y": 0}, {"x": 7, "y": 0}],
        }
    ],
}

POSE = np.array([[0.0, 0.0, 1.5, 0.0, 0.0, 0.0]])
