"""Finished chunks in a folder, so that a driver that dies loses none."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import Scene, Scores, __version__

#: What the folder belongs to.
PLAN = "plan.json"


def gaps(count: int, parts: Mapping[int, Scores]) -> Iterator[tuple[int, int]]:
    """Ranges ``start, stop`` of ``count`` placements that no part covers."""
    at = 0
    for start in sorted(parts):
        if at < start:
            yield at, start
        at = max(at, start + len(parts[start]))
    if at < count:
        yield at, count


class Checkpoint:
    """A folder of chunks ``SCENE/START.npz``, or nothing at all."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    @classmethod
    def open(
        cls,
        folder: str | Path | None,
        scenes: list[Scene],
        poses: npt.NDArray[np.float64],
        named: Mapping[str, Any],
    ) -> Checkpoint:
        """Begins a folder, or goes on with one that was begun with the same inputs."""
        if folder is None:
            return cls(None)
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        plan = {
            "sightline": __version__,
            "scenes": [[_made(scene), scene._inputs()] for scene in scenes],
            "shape": list(poses.shape),
            "poses": hashlib.sha256(poses.tobytes()).hexdigest(),
            "sensors": named["sensors"],
        }
        if named["phases"] is not None:
            plan["phases"] = hashlib.sha256(named["phases"].tobytes()).hexdigest()
        plan = json.loads(json.dumps(plan, default=str))
        file = folder / PLAN
        if not file.exists():
            if any(folder.iterdir()):
                raise ValueError(f"{folder}: is not empty and no checkpoint; give a new folder")
            _write(file, json.dumps(plan, indent=1).encode())
            return cls(folder)
        before = json.loads(file.read_text())
        changed = [key for key in {**before, **plan} if before.get(key) != plan.get(key)]
        if changed:
            raise ValueError(
                f"{folder}: was begun with other inputs ({', '.join(changed)}); give them, or another folder"
            )
        return cls(folder)

    def read(self, scene: int) -> Iterator[tuple[int, Scores]]:
        """Finished chunks of a scene: first placement and scores."""
        if self._folder is None:
            return
        for file in sorted((self._folder / f"{scene:04}").glob("*.npz")):
            with np.load(file, allow_pickle=False) as archive:
                words = json.loads(str(archive["words"]))
                columns = {name: archive[f"column:{name}"] for name in words["columns"]}
            yield int(file.stem), Scores(words["names"], columns, words["guards"], words["classes"])

    def write(self, scene: int, start: int, scores: Scores) -> None:
        """Keeps a chunk; the file is whole at any time."""
        if self._folder is None:
            return
        words = {
            "names": scores.names,
            "columns": list(scores),
            "guards": scores.guards,
            "classes": scores.classes,
        }
        file = self._folder / f"{scene:04}" / f"{start:012}.npz"
        file.parent.mkdir(exist_ok=True)
        arrays: dict[str, Any] = {f"column:{name}": scores[name] for name in scores}
        beside = file.with_suffix(".part")
        with open(beside, "wb") as out:
            np.savez(out, words=np.array(json.dumps(words)), **arrays)
            out.flush()
            os.fsync(out.fileno())
        os.replace(beside, file)


def _made(scene: Scene) -> Any:
    """What a scene is made of, its inputs left out: two that differ here score differently."""
    _, first, options, _ = scene.__reduce__()[1]
    options = {key: value for key, value in options.items() if key not in ("adapter", "memory", "backend")}
    if (psog := options.pop("psog", None)) is not None:
        options["psog"] = hashlib.sha256(psog.index.tobytes() + psog.counts.tobytes()).hexdigest()
    return [str(first), options]


def _write(file: Path, content: bytes) -> None:
    beside = file.with_suffix(".part")
    beside.write_bytes(content)
    os.replace(beside, file)
