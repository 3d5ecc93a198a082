"""Packages that only some calls need."""

from __future__ import annotations

import importlib
from typing import Any


def missing(package: str, extra: str) -> ImportError:
    """The error where a package is not installed; ``extra`` is the extra that installs it."""
    return ImportError(f"{package} is not installed; pip install 'sightline-lidar[{extra}]'")


def load(package: str, extra: str) -> Any:
    """Imports a package. Raises ``ImportError`` with the extra to install."""
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise missing(package, extra) from error


def plain(value: Any) -> Any:
    """Arrays and numbers of NumPy as lists and numbers, for ``json.dumps``."""
    try:
        return value.tolist()
    except AttributeError:
        raise TypeError(f"Object of type {type(value).__name__} is not JSON serializable") from None
