"""Scenes of a study: the own four, and worlds made by rule, under one LiDAR."""

from __future__ import annotations

import functools
import gzip
import json
import subprocess
import sys
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import sightline

from .truth import Source

#: The LiDAR of all scenes: that of the own four.
LIDAR: dict[str, Any] = {"channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 250, "range": 100.0}

#: The own scenes, never trained on.
OWN = ("urban-crossing", "highway", "residential", "industrial-yard")


@dataclass(frozen=True)
class World:
    """A scene of a study, and the frames that are used of it."""

    name: str
    path: Path
    #: ``train`` or ``test``.
    role: str
    frames: list[int]
    sha256: str

    def source(self) -> Source:
        """The scene, read once in a process."""
        return _source(self.path)

    def scene(self, lidar: dict[str, Any] | None = None) -> sightline.Scene:
        """The scene with the study's LiDAR or another, opened once in a process."""
        return _scene(self.path, json.dumps(lidar or LIDAR))

    def to_dict(self, out: Path) -> dict[str, Any]:
        """This world in the form that a plan keeps; files within ``out`` are named from there."""
        inside = self.path.is_relative_to(out)
        file = self.path.relative_to(out).as_posix() if inside else self.path.name
        return {
            "name": self.name,
            "file": file,
            "made": inside,
            "role": self.role,
            "frames": self.frames,
            "sha256": self.sha256,
        }

    @staticmethod
    def from_dict(kept: dict[str, Any], out: Path, scenes: Path | None) -> World:
        """Out of a plan; refuses a file that has changed since, unless there are no ``scenes`` to look at."""
        path = (out if kept["made"] or scenes is None else scenes) / kept["file"]
        if scenes is None:
            return World(kept["name"], path, kept["role"], kept["frames"], kept["sha256"])
        if not path.is_file():
            missing = "OpenDRIVE maps with --xodr, or another --out" if kept["made"] else "own scenes with --scenes"
            raise ValueError(f"{path}: is not there; give the folder of the {missing}")
        found = Source.read(path).digest()
        if found != kept["sha256"]:
            raise ValueError(f"{path}: is not the file that the plan was made with; give another --out, or take the sightline of then")
        return World(kept["name"], path, kept["role"], kept["frames"], found)


def own(scenes: Path, frames: int) -> list[World]:
    """The own four as test scenes."""
    found = []
    for name in OWN:
        path = scenes / f"{name}.json"
        if not path.is_file():
            raise ValueError(f"{path}: is not there; give the folder of the own scenes with --scenes")
        found.append(world(name, path, "test", frames))
    return found


def generated(kind: str, seed: int, role: str, frames: int, folder: Path) -> World:
    """A world by rule, written to ``folder`` unless it is there."""
    name = f"{kind}-{seed}"
    path = folder / f"{name}.json"
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        _made(["new", "--quiet", "--kind", kind, "--seed", str(seed), "--out", str(path)])
    return world(name, path, role, frames)


def imported(xodr: Path, name: str, seed: int, role: str, frames: int, folder: Path, called: str | None = None) -> World:
    """A town on the roads of an OpenDRIVE map, written to ``folder`` unless it is there.

    ``name`` is that of its file somewhere in ``xodr``, without the endings ``.xodr`` and ``.xodr.gz``; the town is ``called``
    so, too, unless another name is given.
    """
    called = called or name
    path = folder / f"{called}.json"
    if not path.is_file():
        found = map_of(xodr, name)
        folder.mkdir(parents=True, exist_ok=True)
        drawn = folder / f"{called}.xodr"
        try:
            given = found.read_bytes()
            drawn.write_bytes(gzip.decompress(given) if found.suffix == ".gz" else given)
            _made(["import", str(drawn), "--quiet", "--seed", str(seed), "--out", str(path)])
        except (ValueError, EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise ValueError(f"{found}: is no map that a town can be made on: {error}") from error
        finally:
            drawn.unlink(missing_ok=True)
    return world(called, path, role, frames)


def map_of(xodr: Path, name: str) -> Path:
    """The file of an OpenDRIVE map, somewhere in a folder."""
    found = sorted(file for end in ("xodr", "xodr.gz") for file in xodr.rglob(f"{name}.{end}"))
    if not found:
        raise ValueError(f"{xodr}: holds no {name}.xodr, nor a compressed one; give a folder that does, or no --xodr")
    return found[0]


def _made(words: list[str]) -> None:
    """Lets the program make a scene; what it says of an error is the error."""
    done = subprocess.run([sys.executable, "-m", "sightline", "scene", *words], stderr=subprocess.PIPE, text=True)
    if done.returncode:
        raise ValueError(done.stderr.strip() or f"`sightline scene {words[0]}` ended with the code {done.returncode}")


def world(name: str, path: Path, role: str, frames: int) -> World:
    """A scene with so many frames, spread evenly and away from its ends."""
    source = Source.read(path)
    count = source.open().frames
    frames = min(frames, count)
    return World(name, path, role, [int((k + 0.5) * count / frames) for k in range(frames)], source.digest())


def opened(
    source: Source,
    frames: int | None = None,
    lidar: dict[str, Any] | None = None,
    psog: sightline.Psog | None = None,
) -> sightline.Scene:
    """A scene with the study's LiDAR or another; scores are means over so many frames.

    ``psog`` is that of the scene, which it need not make again: it is the same for all LiDARs.
    """
    return source.open(frames, psog, lidar=lidar or LIDAR)


def at(source: Source, frame: int, psog: sightline.Psog, lidar: dict[str, Any] | None = None) -> sightline.Scene:
    """The scene from a frame on, scored in that one alone: what its ``covered`` gives is c(v) of this frame.

    ``psog`` is that of the whole scene, which it need not make again.
    """

    def from_there(moves: dict[str, Any]) -> dict[str, Any]:
        if "poses" in moves:
            return {**moves, "poses": moves["poses"][frame:]}
        if "route" not in moves:
            return moves
        route = moves["route"]
        start = route.get("start", 0.0) + frame * route.get("spacing", 0.0)
        return {**moves, "route": {**route, "start": start}}

    described = source.described
    later = {**described, "frames": described["frames"] - frame, "ego": from_there(described.get("ego", {}))}
    later["actors"] = [from_there(actor) for actor in described.get("actors", [])]
    return opened(Source(source.path, later), 1, lidar, psog)


@functools.lru_cache(maxsize=64)
def _source(path: Path) -> Source:
    return Source.read(path)


@functools.lru_cache(maxsize=64)
def _scene(path: Path, lidar: str) -> sightline.Scene:
    return opened(_source(path), lidar=json.loads(lidar))
