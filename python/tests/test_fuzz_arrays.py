"""The fuzz target of arrays, for a few thousand mutations."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

TARGET = Path(__file__).with_name("fuzz_arrays.py")


def test_mutated_arrays_raise_or_give_what_a_plain_reading_gives() -> None:
    done = subprocess.run(
        [sys.executable, TARGET, "--mutations", "3000", "--seed", "3"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    assert "\n0 faults" in done.stdout
    ended = [line.split(": ")[1].split() for line in done.stdout.splitlines() if "plain reading" in line]
    # Mutations that all raise, or all pass, would test one half.
    assert ended and all(int(raised) > 20 and int(returned) > 10 for raised, _, returned, *_ in ended), done.stdout
