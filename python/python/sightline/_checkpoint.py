"""Finished tasks in a folder, so that a driver that dies loses none."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from . import Placement, Result, Scene, Scores, __version__

#: File that says to which job the folder belongs.
PLAN = "plan.json"
#: Result in a file: words as JSON holds them, and arrays by name; no pickle, for reading a pickle runs code.
Packed = tuple[dict[str, Any], dict[str, npt.NDArray[Any]]]


def gaps(count: int, parts: Mapping[int, Scores]) -> Iterator[tuple[int, int]]:
    """Ranges ``start, stop`` of ``count`` placements that no part covers."""
    at = 0
    for start in sorted(parts):
        if at < start:
            yield at, start
        at = max(at, start + len(parts[start].names))
    if at < count:
        yield at, count


class Checkpoint:
    """A folder of results ``HOME/NUMBER.npz``, or nothing at all."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder

    @classmethod
    def open(cls, folder: str | Path | None, inputs: Mapping[str, Any]) -> Checkpoint:
        """Begins a folder, or goes on with one that was begun with the same ``inputs``, by the caller's names for them.

        Raises ``ValueError`` for a folder of other inputs, and for one that is neither empty nor a checkpoint.
        """
        if folder is None:
            return cls(None)
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        plan = json.loads(json.dumps({"sightline": __version__, **inputs}, default=_known))
        file = folder / PLAN
        if not file.exists():
            # Drivers may die while writing the plan.
            if any(entry != file.with_suffix(".part") for entry in folder.iterdir()):
                raise ValueError(f"{folder}: is not empty and no checkpoint; give a new folder")
            text = json.dumps(plan, indent=1).encode()
            _write(file, lambda out: out.write(text))
            return cls(folder)
        before = json.loads(file.read_text())
        changed = [key for key in {**before, **plan} if _text(before.get(key)) != _text(plan.get(key))]
        if changed:
            raise ValueError(
                f"{folder}: was begun with other inputs ({', '.join(changed)}); give them, or another folder"
            )
        return cls(folder)

    def read(self, home: int) -> Iterator[tuple[int, Packed]]:
        """Results of a home by their numbers."""
        if self._folder is None:
            return
        for file in sorted((self._folder / f"{home:04}").glob("*.npz")):
            with np.load(file, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
            yield int(file.stem), (json.loads(str(arrays.pop("words"))), arrays)

    def write(self, home: int, number: int, packed: Packed) -> None:
        """Keeps a result; the file is whole or absent at any time."""
        if self._folder is None:
            return
        words, arrays = packed
        content: dict[str, Any] = {"words": np.array(json.dumps(words)), **arrays}
        file = self._folder / f"{home:04}" / f"{number:012}.npz"
        file.parent.mkdir(exist_ok=True)
        _write(file, lambda out: np.savez(out, **content))


def pack_scores(scores: Scores) -> Packed:
    """Scores as words and columns."""
    words = {"names": scores.names, "columns": list(scores), "guards": scores.guards, "classes": scores.classes,
             "least": scores.least, "required": scores.required, "broken_rules": scores.broken_rules}
    return words, {f"column:{name}": scores[name] for name in scores}


def unpack_scores(packed: Packed) -> Scores:
    """Scores of words and columns."""
    words, arrays = packed
    columns = {name: arrays[f"column:{name}"] for name in words["columns"]}
    told = (words.get("required"), words.get("broken_rules"))
    return Scores(words["names"], columns, words["guards"], words["classes"], words["least"], *told)


def pack_result(result: Result) -> Packed:
    """A search's result: its scores, and all else as words, in which numbers keep every bit."""
    words, arrays = pack_scores(result.scores)
    words["best"] = None if result.best is None else _arguments(result.best)
    words["baselines"] = [_arguments(placement) for placement in result.baselines]
    return {**words, "history": result.history, "record": result.record, "verdict": result.verdict}, arrays


def unpack_result(packed: Packed) -> Result:
    """A search's result of scores and words."""
    words, _ = packed
    best = None if words["best"] is None else Placement(**words["best"])
    baselines = [Placement(**arguments) for arguments in words["baselines"]]
    told = (words["history"], words["record"], words.get("verdict", ""))
    return Result(best, baselines, unpack_scores(packed), *told)


def _arguments(placement: Placement) -> dict[str, Any]:
    """Arguments that make a placement again, as JSON has them."""
    _, arguments, options = placement.__reduce__()[1]
    phases = options["phases"]
    return {**options, "poses": arguments[0].tolist(), "phases": phases if phases is None else phases.tolist()}


def _text(value: Any) -> str:
    """An input to be compared: NaN, a phase that is not locked, differs from itself, its text does not."""
    return json.dumps(value, sort_keys=True)


def _known(value: Any) -> Any:
    """An input that JSON does not know, so that two that differ give other results."""
    if isinstance(value, Scene):
        return _made(value)
    if isinstance(value, Placement):
        return _arguments(value)
    if isinstance(value, np.ndarray):
        return {"shape": value.shape, "sha256": hashlib.sha256(value.tobytes()).hexdigest()}
    return value.item() if isinstance(value, np.generic) else str(value)


def _made(scene: Scene) -> Any:
    """Arguments that make a scene, and the SHA-256 of its files; the choice of an engine is left out."""
    _, first, options, *_ = scene.__reduce__()[1]
    options = {key: value for key, value in options.items() if key not in ("adapter", "memory", "backend")}
    if (psog := options.pop("psog", None)) is not None:
        options["psog"] = hashlib.sha256(psog.index.tobytes() + psog.counts.tobytes()).hexdigest()
    return [[str(first), options], scene._inputs()]


def _write(file: Path, fill: Callable[[IO[bytes]], object]) -> None:
    beside = file.with_suffix(".part")
    with open(beside, "wb") as out:
        fill(out)
        out.flush()
        os.fsync(out.fileno())
    os.replace(beside, file)
