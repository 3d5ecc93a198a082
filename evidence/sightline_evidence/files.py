"""JSON files that are whole or not there."""

from __future__ import annotations

import gzip
import json
import math
import os
import re
from pathlib import Path
from typing import Any


def write_json(path: Path, value: Any) -> None:
    """Writes beside, then renames, so that a killed run leaves nothing half-written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.{os.getpid()}.tmp")
    text = json.dumps(finite(value), indent=1, sort_keys=True, allow_nan=False)
    beside.write_text(_NUMBERS.sub(_on_a_line, text) + "\n", encoding="utf-8")
    os.replace(beside, path)


#: An innermost list of numbers over several lines.
_NUMBERS = re.compile(r"\[\n[\s\d.,eE+\-nul]*\]")


def _on_a_line(found: re.Match[str]) -> str:
    return " ".join(found.group().split()).replace("[ ", "[").replace(" ]", "]")


def finite(value: Any) -> Any:
    """JSON has no ``NaN``: ``null`` in its place."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def read_json(path: Path) -> Any:
    """Value of a JSON file, plain or compressed with gzip (``.gz``)."""
    content = path.read_bytes()
    return json.loads(gzip.decompress(content) if path.suffix == ".gz" else content)


def is_whole(path: Path) -> bool:
    """Whether a file is there and can be read."""
    try:
        read_json(path)
    except (OSError, ValueError):
        return False
    return True
