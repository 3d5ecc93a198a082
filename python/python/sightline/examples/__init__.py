"""Scenes, vehicles and placements to try things with: ``sightline.Scene.load(sightline.examples.path("highway"))``."""

from __future__ import annotations

from pathlib import Path

__all__ = ["names", "path"]

_HOME = Path(__file__).parent


def names() -> list[str]:
    """Names of all files: four scenes, ``placements``, ``vehicles/car``, …"""
    return sorted(file.relative_to(_HOME).with_suffix("").as_posix() for file in _HOME.rglob("*.json"))


def path(name: str) -> Path:
    """The file of a name. Raises ``ValueError`` for another name."""
    if name not in names():
        raise ValueError(f"name: `{name}` is no example; there are {', '.join(names())}")
    return _HOME / f"{name}.json"
