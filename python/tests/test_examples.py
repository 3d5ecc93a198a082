"""The examples run as a user runs them."""

from __future__ import annotations

import importlib.util
import json
import random
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def town(file: Path) -> Path:
    """Ground and forty houses along a street, as an OBJ file."""
    draw, lines, count = random.Random(1), [], 0

    def box(low, high) -> None:
        nonlocal count
        for z in (low[2], high[2]):
            for x, y in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])):
                lines.append(f"v {x:.3f} {y:.3f} {z:.3f}")
        for face in ((1, 2, 3, 4), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8)):
            lines.append("f " + " ".join(str(count + corner) for corner in face))
        count += 8

    box((-80, -80, -0.1), (80, 80, 0))
    for _ in range(40):
        x, y = draw.uniform(-70, 70), draw.choice((-1, 1)) * draw.uniform(7, 40)
        size = [draw.uniform(1, 6) for _ in range(3)]
        box((x, y, 0), (x + size[0], y + size[1], size[2]))
    file.write_text("\n".join(lines))
    return file


def run(name: str, *arguments: object) -> str:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *map(str, arguments)],
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_quickstart(tmp_path: Path) -> None:
    assert len((EXAMPLES / "quickstart.py").read_text().splitlines()) <= 30
    printed = run("quickstart.py", town(tmp_path / "town.obj"), tmp_path / "plot.png")
    assert re.search(r"120 placements, best \d\d\.\d\d%\n", printed)
    assert (tmp_path / "plot.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="PyTorch is not installed")
def test_train() -> None:
    assert "loss" in run("train.py", "scenes/industrial-yard.json")


@pytest.mark.parametrize(("name", "package"), [("botorch", "botorch"), ("optuna", "optuna"), ("pymoo", "pymoo"), ("pycma", "cma"), ("search", "sightline")])
def test_optimizers_of_others(name: str, package: str) -> None:
    pytest.importorskip(package)
    printed = run("optimizers.py", name, "scenes/industrial-yard.json")
    # The best of 60 random placements has .353.
    assert float(printed.split()[-1]) > 0.345, printed


def test_a_front_beside_nsga2(tmp_path: Path) -> None:
    pytest.importorskip("pymoo")
    pytest.importorskip("moocore")
    lidar = {"fov": [-25, 10], "azimuth_steps": 360, "range": 60}
    sensors = [
        {"name": name, "price": price, "lidar": {"channels": channels, **lidar}}
        for name, price, channels in (("small", 1000, 8), ("large", 2500, 16))
    ]
    roof = {"name": "roof", "min": [-1.2, -0.7, 1.7], "max": [1.2, 0.7, 2.0], "pitch": [-0.3, 0.3]}
    mounts = [{**roof, "sensors": ["small", "large"], "count": [0, 2]}]
    body = [{"class": "vehicle", "box": {"min": [-2.4, -1.0, 0.2], "max": [2.4, 1.0, 1.6]}}]
    vehicle = {"sightline": 1, "name": "roof", "body": body, "sensors": sensors, "mounts": mounts, "min_distance": 0.2}
    (tmp_path / "roof.json").write_text(json.dumps(vehicle))
    ours, theirs = run("front.py", "scenes/industrial-yard.json", tmp_path / "roof.json", 80).splitlines()
    beaten = [float(line.split(": ")[1].split()[0]) for line in (ours, theirs)]
    assert 0.1 < beaten[0] < 0.3 and 0.1 < beaten[1] < 0.3, (ours, theirs)
    assert all(f" {share:.3f} by moocore; " in line for share, line in zip(beaten, (ours, theirs))), (ours, theirs)
    casts = [int(re.search(r"(\d+) casts", line)[1]) for line in (ours, theirs)]
    assert casts[0] > 100 and 80 <= casts[1] < 160, (ours, theirs)
    # One small sensor, two of them, two large ones.
    assert {"1000", "2000", "5000"} <= {point.split(":")[0] for point in ours.split("; ")[1].split(", ")}


def test_beyond_one_machine() -> None:
    pytest.importorskip("ray")
    printed = run("beyond_one_machine.py", "scenes/industrial-yard.json", "--placements", 150, "--frames", 1)
    assert "of twice one" in printed and "64 nodes" in printed
