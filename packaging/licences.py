"""Prints name, version and licence of every package that the program is linked from, and the texts that they carry.

``python3 packaging/licences.py TARGET``; ends with 2 and a sentence where a package names no licence.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

#: Beginnings of the names of files that packages keep their licences in.
NAMES = ("licen", "copying", "notice", "unlicense")


def linked(target: str) -> Iterator[dict[str, Any]]:
    """Packages that the program is linked from on a target, without those of the project, by name."""
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", target]
    metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    packages = {package["id"]: package for package in metadata["packages"]}
    needs = {node["id"]: node["deps"] for node in metadata["resolve"]["nodes"]}
    waiting = [key for key, package in packages.items() if package["source"] is None and package["name"] == "sightline"]
    found: set[str] = set()
    while waiting:
        key = waiting.pop()
        if key not in found:
            found.add(key)
            # No kind is that of a dependency which is linked; others are of tests and of build scripts.
            usual = (need for need in needs[key] if any(kind["kind"] is None for kind in need["dep_kinds"]))
            waiting.extend(need["pkg"] for need in usual)
    others = (packages[key] for key in found if packages[key]["source"] is not None)
    yield from sorted(others, key=lambda package: (package["name"], package["version"]))


def main(target: str) -> int:
    """Prints all of it; returns the exit code."""
    texts: dict[str, list[str]] = {}
    print("Packages that sightline is linked from, and their licences.\n")
    for package in linked(target):
        name = f"{package['name']} {package['version']}"
        if not package["license"] and not package["license_file"]:
            print(f"{name}: names no licence; leave the package out or ask its authors", file=sys.stderr)
            return 2
        print(f"{name}: {package['license'] or package['license_file']}")
        for file in sorted(Path(package["manifest_path"]).parent.iterdir()):
            if file.is_file() and file.name.lower().startswith(NAMES):
                text = file.read_text(encoding="utf-8", errors="replace").strip()
                texts.setdefault(text, []).append(f"{name}: {file.name}")
    for text, owners in texts.items():
        print("\n" + "=" * 100)
        print("\n".join(owners) + "\n")
        print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
