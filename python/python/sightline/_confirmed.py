"""``sightline optimize … --out DIR --confirm learned``: the program searches, then a learner judges what it found."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NoReturn

from ._native import read_placements

#: Options of ``optimize`` that no value follows.
FLAGS = ("--mirror", "--equal-height", "--symmetric", "--quiet", "--verbose", "-v")

#: Options that a run may be given anew when it goes on; all others lie in its folder.
ANEW = ("--max-seconds", "--time", "--gltf", "--format", "--backend", "--adapter", "--threads", "--memory", *FLAGS[3:])

#: Numbers that are compared with those of a run where the command names them.
NUMBERS = ("--seed", "--evaluations", "--population", "--target")


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
    scenes, options = read(rest)
    if "--vehicle" in options or "--budget" in options:
        return _refused("--vehicle, --budget: learners know scenes with one `lidar` and one `mount` as yet; search without --confirm")
    begun = (given.out / "checkpoint.json").is_file()
    try:
        different = difference(given.out, scenes, options) if begun else None
    except (ValueError, KeyError, TypeError, OSError) as error:
        different = f"{given.out}: holds a run that cannot be read ({error}); give another --out"
    if different:
        return _refused(different)
    try:
        from .evidence import confirm
    except ImportError as error:
        return _refused(f"{error}; needed are torch and sightline[evidence]")
    if not (begun and is_searched(given.out)):
        code = search(given.out, rest, options)
        if code == 130:
            print("interrupted; the same command goes on", file=sys.stderr)
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


def is_searched(run: Path) -> bool:
    """Whether a search came to its end; one that was interrupted has a result of what it had, too."""
    try:
        stopped = json.loads((run / "result.json").read_text(encoding="utf-8"))["stopped"]
    except FileNotFoundError:
        return False
    return bool(stopped != "interrupted")


def search(run: Path, words: list[str], options: dict[str, list[str]]) -> int:
    """Begins the search, or goes on with it; returns the exit code, 130 after Ctrl-C."""
    if (run / "checkpoint.json").is_file():
        again = ((option, values or [""]) for option, values in options.items() if option in ANEW)
        rest = [word for option, values in again for value in values for word in (option, value) if word]
        words = [words[0], "--resume", str(run), *rest]
    else:
        words = [*words, "--out", str(run)]
    # In a process of its own, for the program ends the one that it runs in.
    program = subprocess.Popen([sys.executable, "-m", "sightline", *words])
    while True:
        try:
            return program.wait()
        except KeyboardInterrupt:
            # Ctrl-C reaches the program, too: it ends its generation and writes what it has.
            continue


def read(words: list[str]) -> tuple[list[Path], dict[str, list[str]]]:
    """Scenes and options of a command, each option with all of its values; a flag has none."""
    scenes: list[Path] = []
    options: dict[str, list[str]] = {}
    option = None
    for word in words[1:]:
        if option:
            options[option].append(word)
            option = None
        elif word.startswith("-"):
            name, equals, value = word.partition("=")
            options.setdefault(name, []).extend([value] if equals else [])
            option = name if not equals and name not in FLAGS else None
        else:
            scenes.append(Path(word))
    return scenes, options


def difference(run: Path, scenes: list[Path], options: dict[str, list[str]]) -> str | None:
    """What a command asks for that the run in a folder is not of: scenes by their bytes, and every setting that it names.

    What it leaves out is the program's to choose, and as the run has it.
    """
    checkpoint = json.loads((run / "checkpoint.json").read_text(encoding="utf-8"))
    state = checkpoint["state"]
    begun, settings = state["begun"], (state.get("run") or state["equipping"])["settings"]
    if begun.get("vehicle"):
        return f"{run}: holds a run of the vehicle {begun['vehicle']}; learners know scenes with one `lidar` and one `mount` as yet"
    digests = {one["file"]: one["sha256"] for one in checkpoint["inputs"]}
    known = [begun["scene"], *begun.get("more_scenes", [])]
    wanted = [hashlib.sha256(scene.read_bytes()).hexdigest() for scene in scenes]
    if wanted != [digests[scene] for scene in known]:
        named = ", ".join(map(str, scenes)) or "none"
        return f"{run}: holds a run of {', '.join(known)} as that was then, not of {named}; give another --out"
    for option, (ours, theirs) in _compared(begun, settings, options).items():
        if ours != theirs:
            return f"{run}: holds a run with {option} {_shown(theirs)}, not {_shown(ours)}; give another --out"
    return None


def _compared(begun: dict[str, Any], settings: dict[str, Any], options: dict[str, list[str]]) -> dict[str, tuple[Any, Any]]:
    """Of each option what the command says and what the run has."""
    rules, last = begun["rules"], {option: values[-1] for option, values in options.items() if values}
    pairs: dict[str, tuple[Any, Any]] = {
        # What is not there unless a command names it.
        "--mirror": ("--mirror" in options, begun.get("mirror", False)),
        "--equal-height": ("--equal-height" in options, rules["equal_height"]),
        "--symmetric": ("--symmetric" in options, rules["symmetric"]),
        "--fix": ([_fixed(text) for text in options.get("--fix", [])], [list(one) for one in rules["fixed"]]),
        "--near-weight": (_number(last.get("--near-weight")), begun.get("near_weight")),
    }
    asked, kept = options.get("--condition", []), begun.get("conditions", [])
    if len(asked) != len(kept) or not all(map(_is_of, asked, kept)):
        pairs["--condition"] = (asked, kept)
    pairs |= {option: (_number(last[option]), settings[option[2:]]) for option in NUMBERS if option in last}
    if "--method" in last:
        pairs["--method"] = (last["--method"], settings["method"])
    if "--objective" in last:
        pairs["--objective"] = ("".join(last["--objective"].split()), "".join(settings["objective"].split()))
    if "--delta" in last:
        metres, comma, radians = last["--delta"].partition(",")
        spacing = {"metres": _number(metres), "radians": _number(radians if comma else metres)}
        pairs["--delta"] = (spacing, settings["delta"])
    if "--frames" in last or "--fidelity" in last:
        frames = {"count": _number(last["--frames"])} if "--frames" in last else {"full": "all", "auto": "on-demand"}.get(last["--fidelity"])
        pairs["--frames, --fidelity"] = (frames, settings["frames"])
    for option, key in (("--baselines", "baselines"), ("--inject", "starts")):
        if option in last:
            given = [(one.name, one.poses.tolist()) for one in read_placements(last[option])]
            pairs[option] = (given, [(one["name"], _poses(one)) for one in settings[key]])
    return pairs


def _number(text: str | None) -> float | str | None:
    try:
        return None if text is None else int(text) if text.isdecimal() else float(text)
    except ValueError:
        return text


def _fixed(text: str) -> list[Any]:
    field, _, value = text.partition("=")
    return [field.strip(), _number(value)]


def _is_of(asked: str, kept: str) -> bool:
    """Whether a condition, kept with all of its values, has those that were asked for."""
    (kind, _, values), (known, _, others) = asked.partition(":"), kept.partition(":")
    every, some = ({key: _number(value) for key, _, value in (one.partition("=") for one in of.split(",") if one)} for of in (others, values))
    return kind == known and all(every.get(key) == value for key, value in some.items())


def _poses(placement: dict[str, Any]) -> list[list[float]]:
    return [[lidar.get(key, 0.0) for key in ("x", "y", "z", "roll", "pitch", "yaw")] for lidar in placement["lidars"]]


def _shown(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 60 else f"{text[:60]}…"
