"""Results on disk: one JSON file a finished run, and the best value known of each problem."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

from .problems import ROOT

#: A value is better than the best known by more than this.
LEAST_BETTER = 1e-9


def write(path: Path, text: str) -> None:
    """Writes a file beside itself and renames it, so that it is whole or absent."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    beside.write_text(text)
    beside.replace(path)


class Absent(Exception):
    """A run that is not there, in a store that makes none; holds the name of its file."""


class Store:
    """Finished runs of a folder, by problem, method and seed; with `kept` those that are there, and no others."""

    def __init__(self, folder: Path, kept: bool = False) -> None:
        self.folder, self.kept = folder / "results", kept
        self.folder.mkdir(parents=True, exist_ok=True)

    def path(self, problem: str, method: str, seed: int) -> Path:
        """Its file."""
        return self.folder / f"{problem}.{method}.{seed}.json"

    def get(self, problem: str, method: str, seed: int) -> dict[str, Any] | None:
        """A finished run, if there is one."""
        path = self.path(problem, method, seed)
        if not path.exists():
            return None
        try:
            return json.loads(path.read_text())
        except ValueError as error:
            raise SystemExit(f"{path}: is no JSON ({error}); delete it and start again") from None

    def known(self, problem: str, method: str, seed: int, settings: dict[str, Any]) -> dict[str, Any] | None:
        """A finished run, if there is one. SystemExit where it had other settings."""
        known = self.get(problem, method, seed)
        if known is not None and known["settings"] != settings:
            raise SystemExit(
                f"{self.path(problem, method, seed)}: was run with {known['settings']}, now wanted is "
                f"{settings}; give another --out, or delete the file"
            )
        return known

    def done(self, problem: str, method: str, seed: int, settings: dict[str, Any], run: Any) -> dict[str, Any]:
        """The finished run on disk, else the result of `run()`, which is kept; raises Absent where no runs are made.

        SystemExit where the one that is there had other settings.
        """
        known = self.known(problem, method, seed, settings)
        if known is not None:
            return known
        if self.kept:
            raise Absent(self.path(problem, method, seed).name)
        record = {"problem": problem, "method": method, "seed": seed, "settings": settings, **run()}
        write(self.path(problem, method, seed), json.dumps(record, indent=1) + "\n")
        return record


def commit() -> str:
    """Commit of the working tree, short; `unknown` without git."""
    try:
        done = subprocess.run(["git", "describe", "--always", "--dirty", "--exclude=*"], cwd=ROOT,
                              capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.strip()


class BestKnown:
    """The best value known of each problem, with its placement and the command that found it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.entries: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}

    def value(self, problem: str) -> float | None:
        """Its value."""
        return self.entries.get(problem, {}).get("value")

    def offer(self, problem: str, value: float | None, lidars: Any, command: str, at: str) -> bool:
        """Takes a value that is better by more than LEAST_BETTER; None, of a broken rule, never is."""
        known = self.value(problem)
        if value is None or (known is not None and value <= known + LEAST_BETTER):
            return False
        self.entries[problem] = {
            "value": value,
            "placement": {"name": f"best-known-{problem}", "lidars": lidars},
            "command": command,
            "commit": at,
        }
        write(self.path, json.dumps(self.entries, indent=1) + "\n")
        return True
