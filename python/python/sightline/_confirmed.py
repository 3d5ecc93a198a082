"""``sightline optimize … --out DIR --confirm learned``: the program searches, then a learner judges what it found."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NoReturn

#: Options of ``optimize`` that no value follows.
FLAGS = ("--mirror", "--equal-height", "--symmetric", "--quiet", "--verbose", "-v")


class _Parser(argparse.ArgumentParser):
    """Says what is wrong as the program does: in one sentence, with the exit code 2."""

    def error(self, message: str) -> NoReturn:
        print(f"sightline: {message}; see `sightline optimize --help`", file=sys.stderr)
        raise SystemExit(2)


def optimize(words: list[str]) -> int:
    """Runs the search, unless its result is there, then confirms; returns the exit code."""
    parser = _Parser(prog="sightline optimize", add_help=False, allow_abbrev=False)
    parser.add_argument("--confirm", choices=["learned"])
    parser.add_argument("--learner", type=Path, action="append", default=[])
    parser.add_argument("--out", type=Path)
    given, rest = parser.parse_known_args(words)
    if given.out is None:
        parser.error("--confirm learned: needs --out, the folder of the run")
    searched = (given.out / "result.json").is_file()
    try:
        difference = _difference(given.out, rest) if searched else None
    except (ValueError, KeyError, TypeError, OSError) as error:
        difference = f"{given.out}: holds a run that cannot be read ({error}); give another --out"
    if difference:
        return _refused(difference)
    try:
        from .evidence import confirm
    except ImportError as error:
        return _refused(f"{error}; needed are torch and sightline[evidence]")
    if not searched:
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
        return _refused(str(error))
    print(confirm.table(found))
    print(f"wrote {given.out / 'learned.json'}")
    return 0


def _refused(sentence: str) -> int:
    print(f"sightline: --confirm learned: {sentence}", file=sys.stderr)
    return 2


def _difference(run: Path, words: list[str]) -> str | None:
    """What the command asks for that the finished run in its folder is not of: scenes by their bytes, the objective."""
    begun = json.loads((run / "result.json").read_text(encoding="utf-8"))["settings"]
    kept = json.loads((run / "checkpoint.json").read_text(encoding="utf-8"))["inputs"]
    digests = {one["file"]: one["sha256"] for one in kept}
    known = [begun["scene"], *begun.get("more_scenes", [])]
    scenes = _scenes(words)
    wanted = [hashlib.sha256(scene.read_bytes()).hexdigest() for scene in scenes]
    if wanted != [digests[scene] for scene in known]:
        named = ", ".join(map(str, scenes)) or "none"
        return f"{run}: holds a run of {', '.join(known)} as that was then, not of {named}; give another --out"
    usual = "near_gain" if _value(words, "--near-weight") is None else "information_gain"
    objective = _value(words, "--objective") or usual
    if "".join(objective.split()) != "".join(begun["search"]["objective"].split()):
        return f"{run}: holds a run for {begun['search']['objective']}, not for {objective}; give another --out"
    return None


def _scenes(words: list[str]) -> list[Path]:
    """The scenes among the arguments: words that are no options and follow none that takes a value."""
    scenes, is_value = [], False
    for word in words[1:]:
        if is_value or word.startswith("-"):
            is_value = not is_value and "=" not in word and word not in FLAGS
        else:
            scenes.append(Path(word))
    return scenes


def _value(words: list[str], option: str) -> str | None:
    for k, word in enumerate(words):
        if word == option and k + 1 < len(words):
            return words[k + 1]
        if word.startswith(f"{option}="):
            return word.removeprefix(f"{option}=")
    return None
