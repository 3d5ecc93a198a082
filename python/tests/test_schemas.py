"""JSON Schemas by another validator: own files are valid, wrong ones are refused by it and by the program."""

from __future__ import annotations

import copy
import json
import re
import shutil
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sightline

from .conftest import POSE, ROOT, SMALL

jsonschema = pytest.importorskip("jsonschema")

KINDS = {"roi": "scene", "mounts": "vehicle", "placements": "placements", "shapes": "targets"}
FOLDERS = ("scenes", "docs/van", "docs/own-mesh", "docs/rigs", "tests/loaders", "fuzz/corpus")


def validator(kind: str) -> Any:
    schema = json.loads((ROOT / f"docs/schemas/{kind}.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def kind_of(document: Any) -> str | None:
    keys = document if isinstance(document, dict) else {}
    return next((kind for key, kind in KINDS.items() if key in keys), None)


def own_files() -> Iterator[tuple[str, str, Any]]:
    """Kind, name and content of every file of the project that a schema describes."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.json")):
            document = json.loads(path.read_text())
            kind = kind_of(document)
            if "fuzz" in path.parts and kind == "vehicle":
                # Read as the vehicle in a scene, which needs no version.
                document.setdefault("sightline", 1)
            if kind:
                yield kind, str(path.relative_to(ROOT)), document
    for target in json.loads((ROOT / "crates/scene/src/scene/targets.json").read_text()):
        yield "targets", f"preset {target['name']}", target
    yield "scene", "the tests' small scene", SMALL


def test_own_files_are_valid() -> None:
    counts = dict.fromkeys(KINDS.values(), 0)
    for kind, name, document in own_files():
        faults = [fault.json_path + ": " + fault.message for fault in validator(kind).iter_errors(document)]
        assert not faults, f"{name}: {faults[:3]}"
        assert validator(kind).is_valid(document | {"$schema": f"../docs/schemas/{kind}.json"}), name
        counts[kind] += 1
    assert counts["scene"] >= 10 and counts["vehicle"] >= 8 and counts["placements"] >= 3 and counts["targets"] >= 14, counts


def test_generated_scenes_are_valid(tmp_path: Path) -> None:
    for world in ("street", "town"):
        file = tmp_path / f"{world}.json"
        assert sightline._native.main(["sightline", "scene", "new", "--kind", world, "--out", str(file), "--quiet"]) == 0
        validator("scene").validate(json.loads(file.read_text()))


def places(node: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """A way to every value, one of each list."""
    yield at
    if isinstance(node, dict):
        for key, value in node.items():
            yield from places(value, (*at, key))
    elif isinstance(node, list) and node:
        yield from places(node[0], (*at, 0))


def value_at(document: Any, at: tuple[Any, ...]) -> Any:
    for key in at:
        document = document[key]
    return document


def changed(document: Any, at: tuple[Any, ...], value: Any) -> Any:
    document = copy.deepcopy(document)
    value_at(document, at[:-1])[at[-1]] = value
    return document


def without(document: Any, at: tuple[Any, ...]) -> Any:
    document = copy.deepcopy(document)
    del value_at(document, at[:-1])[at[-1]]
    return document


def refused(kind: str, document: Any, folder: Path, small: sightline.Scene) -> str | None:
    """The sentence with which the program refuses a file; `None` where it takes it."""
    file = folder / "changed.json"
    file.write_text(json.dumps(document))
    try:
        if kind == "scene":
            sightline.Scene.load(file, backend="cpu")
        elif kind == "vehicle":
            sightline.Scene.load("scenes/industrial-yard.json", vehicle=file, backend="cpu")
        elif kind == "placements":
            sightline.read_placements(file)
        else:
            small.beams_on(POSE, [str(file)], np.array([5.0]), np.array([0.0]))
    except (ValueError, OSError) as error:
        return str(error)
    return None


@pytest.mark.parametrize("kind", KINDS.values())
def test_wrong_files_are_refused_by_the_validator_and_by_the_program(
    kind: str, tmp_path: Path, small: sightline.Scene
) -> None:
    warnings.simplefilter("ignore")
    check, seen = validator(kind), set()
    types = keys = missing = 0
    # The van names sensor files.
    shutil.copytree("scenes/sensors", tmp_path / "sensors")
    folder = tmp_path / "vehicles"
    folder.mkdir()
    for _, name, document in (own for own in own_files() if own[0] == kind):
        # Some need files beside them.
        if refused(kind, document, folder, small):
            continue
        for at in places(document):
            general = tuple("" if isinstance(key, int) else key for key in at)
            if general in seen:
                continue
            seen.add(general)
            value, place = value_at(document, at), (name, at)
            if isinstance(value, dict):
                wrong = changed({"": document}, ("", *at, "colour?"), [[]])[""]
                assert not check.is_valid(wrong) and refused(kind, wrong, folder, small), (place, "unknown key")
                keys += 1
            if not at:
                continue
            wrong = changed(document, at, [] if isinstance(value, dict) else {"colour?": 1})
            assert not check.is_valid(wrong) and refused(kind, wrong, folder, small), (place, "wrong type")
            types += 1
            if isinstance(at[-1], str):
                lacking = without(document, at)
                told = refused(kind, lacking, folder, small)
                is_required = not check.is_valid(lacking)
                assert not is_required or told, (place, "missing key")
                assert is_required or not re.search("missing key|the key .* is missing", told or ""), (place, told)
                missing += is_required
    least = {"scene": (300, 60, 40), "vehicle": (70, 8, 10), "placements": (10, 3, 6), "targets": (20, 5, 8)}[kind]
    assert all(count >= few for count, few in zip((types, keys, missing), least)), (types, keys, missing)
