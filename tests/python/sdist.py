"""Checks a source distribution of the Python module: what the wheel is built from is in it, and Cargo reads it.

``python sdist.py FILE``; nothing is compiled. Run from a folder of the project.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def main(archive: Path) -> None:
    """Fails with a sentence at the first thing that is missing."""
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(archive) as packed:
            packed.extractall(folder, filter="data")
        (home,) = Path(folder).iterdir()
        lacks(home, [f"crates/{crate.name}/Cargo.toml" for crate in (ROOT / "crates").iterdir()])
        lacks(home, [f"crates/lidar-cast/{file.relative_to(ROOT)}" for file in (ROOT / "shaders").rglob("*.wgsl")])
        lacks(home, [f"python/src/{file.name}" for file in (ROOT / "python/src").glob("*.rs")])
        module = ROOT / "python/python/sightline"
        ours = [f"python/sightline/{file.relative_to(module)}" for file in module.rglob("*") if file.suffix in (".py", ".pyi", ".json")]
        lacks(home, [*ours, "python/sightline/py.typed", "Cargo.lock", "PKG-INFO", "LICENSE"])
        included(home)
        # Versions of all packages are locked, and none is looked for elsewhere.
        command = ["cargo", "metadata", "--format-version", "1", "--locked", "--offline", "--manifest-path", "python/Cargo.toml"]
        metadata = json.loads(subprocess.run(command, cwd=home, check=True, stdout=subprocess.PIPE).stdout)
        own = {package["name"] for package in metadata["packages"] if package["source"] is None}
        if not own >= {"sightline", "sightline-python", "lidar-cast"}:
            sys.exit(f"{archive}: cargo finds {sorted(own)} alone")


def lacks(home: Path, files: list[str]) -> None:
    """Ends unless each file is there as a file of its own: links of the project lead nowhere elsewhere."""
    missing = [file for file in files if not (home / file).is_file() or (home / file).is_symlink()]
    if missing or not files:
        sys.exit(f"the source distribution lacks {', '.join(missing) or 'all of a kind'}")


def included(home: Path) -> None:
    """Ends unless each file that sources include at compile time is there; those of tests may stay away."""
    count = 0
    for source in [*home.glob("src/**/*.rs"), *home.glob("crates/*/src/**/*.rs"), *home.glob("python/src/*.rs")]:
        if "tests" in source.parts or source.name == "tests.rs":
            continue
        for name in re.findall(r'include_(?:str|bytes)!\("([^"]+)"', source.read_text(encoding="utf-8")):
            count += 1
            if not (source.parent / name).is_file():
                sys.exit(f"the source distribution lacks {name}, which {source.relative_to(home)} includes")
    if count < 10:
        sys.exit(f"{count} files are included, where at least 10 were looked for")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
