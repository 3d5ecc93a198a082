"""``python -m sightline_evidence quick|standard|tables --out DIR``; ``confirm``, ``cost``, ``displays``, ``learned``, ``predictions``, ``real``, ``restore``: see their ``--help``."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from pathlib import Path

#: Studies; the same as ``designs.DESIGNS``, which needs the extra.
NAMES = ("quick", "standard", "towns")

#: Commands with arguments of their own, each a module with a ``main``.
OTHERS = ("confirm", "cost", "displays", "learned", "predictions", "real", "restore")


def main(arguments: list[str] | None = None) -> int:
    """Runs a study or another command; returns the exit code: 0 done, 2 bad input, 130 interrupted."""
    words = sys.argv[1:] if arguments is None else arguments
    if words and words[0] in OTHERS:
        return other(words[0], words[1:])
    parser = argparse.ArgumentParser(prog="python -m sightline_evidence", description=__doc__)
    parser.add_argument("design", choices=[*NAMES, "tables"], help="which study; tables: of what a run has so far")
    parser.add_argument("--out", type=Path, required=True, help="folder of the run; one that is there goes on")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of the own four scenes [scenes]")
    parser.add_argument("--xodr", type=Path, help="folder of OpenDRIVE maps; without it towns made on them are left out")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes [all cores]")
    given = parser.parse_args(words)
    if given.jobs < 1:
        parser.error(f"--jobs: is {given.jobs}; give 1 or more")
    try:
        from . import present, run
        from .stage import say
    except ImportError as error:
        print(f"error: {error}; pip install sightline-evidence", file=sys.stderr)
        return 2
    try:
        out, scenes = given.out.resolve(), given.scenes.resolve()
        xodr = given.xodr.resolve() if given.xodr else None
        result = run.so_far(out) if given.design == "tables" else run.run(given.design, out, scenes, xodr, given.jobs)
        present.write(result, given.out)
    except KeyboardInterrupt:
        say("interrupted; the same command goes on")
        return 130
    except (ValueError, OSError) as error:
        print(f"error: {words_of(error)}", file=sys.stderr)
        return 2
    say(f"wrote result.json, tables.md and figure.svg to {given.out}")
    return 0


def other(command: str, words: list[str]) -> int:
    """Runs a command of a module; returns the exit code."""
    try:
        code: int = importlib.import_module(f".{command}", __package__).main(words)
    except KeyboardInterrupt:
        print("evidence: interrupted; the same command goes on", file=sys.stderr)
        return 130
    except (ImportError, ValueError, OSError) as error:
        print(f"error: {words_of(error)}", file=sys.stderr)
        return 2
    return code


def words_of(error: Exception) -> str:
    """An error as a sentence; of a file the file comes first, and no number of the system."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror[0].lower()}{error.strerror[1:]}; check the path"
    return str(error)


if __name__ == "__main__":
    sys.exit(main())
