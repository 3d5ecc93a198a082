"""How objects are made again in another process."""

from __future__ import annotations

from typing import Any, Callable


def call(make: Callable[..., Any], arguments: tuple[Any, ...], options: dict[str, Any]) -> Any:
    """Calls a maker with positional and named arguments; pickle itself passes positional ones only."""
    return make(*arguments, **options)


def scene(
    make: Callable[..., Any], source: Any, options: dict[str, Any], inputs: list[dict[str, str]]
) -> Any:
    """Reads a scene again, and refuses one whose files are not those that it was made of."""
    made = make(source, **options)
    for before, now in zip(inputs, made._inputs()):
        if before != now:
            raise ValueError(
                f"{now['file']}: is not the file that the scene was read from before it was sent here; give all "
                "processes the same files"
            )
    return made
