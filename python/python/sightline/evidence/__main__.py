"""``python -m sightline.evidence quick|standard|tables --out DIR``."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

#: Studies; the same as ``designs.DESIGNS``, which needs the extra.
NAMES = ("quick", "standard", "channels", "conditions", "transfer")


def main(arguments: list[str] | None = None) -> int:
    """Runs a study; returns the exit code: 0 done, 2 bad input, 130 interrupted."""
    parser = argparse.ArgumentParser(prog="python -m sightline.evidence", description=__doc__)
    parser.add_argument("design", choices=[*NAMES, "tables"], help="which study; tables: of what a run has so far")
    parser.add_argument("--out", type=Path, required=True, help="folder of the run; one that is there goes on")
    parser.add_argument("--scenes", type=Path, default=Path("scenes"), help="folder of the own four scenes [scenes]")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes [all cores]")
    given = parser.parse_args(arguments)
    if given.jobs < 1:
        parser.error(f"--jobs: is {given.jobs}; give 1 or more")
    try:
        from . import present, run
        from .stage import say
    except ImportError as error:
        print(f"error: {error}; pip install 'sightline[evidence]'", file=sys.stderr)
        return 2
    try:
        out, scenes = given.out.resolve(), given.scenes.resolve()
        result = run.so_far(out) if given.design == "tables" else run.run(given.design, out, scenes, given.jobs)
        present.write(result, given.out)
    except KeyboardInterrupt:
        say("interrupted; the same command goes on")
        return 130
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    say(f"wrote result.json, tables.md and figure.svg to {given.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
