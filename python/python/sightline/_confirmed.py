"""``sightline optimize … --out DIR --confirm learned``: the program searches, then a learner judges what it found."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path


def optimize(words: list[str]) -> int:
    """Runs the search, unless its result is there, then confirms; returns the exit code."""
    parser = argparse.ArgumentParser(prog="sightline optimize", add_help=False, allow_abbrev=False)
    parser.add_argument("--confirm", choices=["learned"])
    parser.add_argument("--learner", type=Path, action="append", default=[])
    parser.add_argument("--out", type=Path)
    given, rest = parser.parse_known_args(words)
    if given.out is None:
        parser.error("--confirm learned: needs --out, the folder of the run")
    try:
        from .evidence import confirm
    except ImportError as error:
        print(f"error: --confirm learned: {error}; needed are torch and sightline[evidence]", file=sys.stderr)
        return 2
    if not (given.out / "result.json").is_file():
        # In a process of its own, for the program ends the one that it runs in.
        code = subprocess.run([sys.executable, "-m", "sightline", *rest, "--out", str(given.out)]).returncode
        if code:
            return code
    try:
        found = confirm.confirm(given.out.resolve(), given.learner, os.cpu_count() or 1)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on", file=sys.stderr)
        return 130
    except (ValueError, OSError) as error:
        print(f"error: --confirm learned: {error}", file=sys.stderr)
        return 2
    print(confirm.table(found))
    print(f"wrote {given.out / 'learned.json'}")
    return 0
