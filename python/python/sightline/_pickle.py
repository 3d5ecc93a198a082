"""How objects are made again in another process."""

from __future__ import annotations

import os
from typing import Any, Callable


def call(make: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any]) -> Any:
    """Calls a maker with positional and named arguments; pickle itself passes positional ones only."""
    return make(*arguments, **options)


def _there(path: Any, root: str) -> Any:
    """A path as it was given, or from the folder ``root`` that was the current one then, where it is not here."""
    away = isinstance(path, (str, os.PathLike)) and not os.path.exists(path)
    return os.path.join(root, path) if away else path


def file(load: Callable[..., Any], path: Any, root: str) -> Any:
    """Reads a file again."""
    return load(_there(path, root))


def scene(
    make: Callable[..., Any], source: Any, options: dict[str, Any], inputs: list[dict[str, str]], root: str
) -> Any:
    """Reads a scene again, and refuses one whose files are not those that it was made of."""
    for key in ("vehicle", "folder"):
        if key in options:
            options[key] = _there(options[key], root)
    made = make(_there(source, root), **options)
    for before, now in zip(inputs, made._inputs()):
        if before["sha256"] != now["sha256"]:
            raise ValueError(
                f"{now['file']}: is not the file that the scene was read from before it was sent here; give all "
                "processes the same files"
            )
    return made
