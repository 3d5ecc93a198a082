"""Tasks that each write one file, on all cores; what is there is not done again."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import sightline

from .files import is_whole, write_json

#: The file that a task writes, and the function that makes what stands in it.
Task = tuple[Path, Callable[..., Any], tuple[Any, ...]]


def say(sentence: str) -> None:
    """Progress, to stderr."""
    print(f"evidence: {sentence}", file=sys.stderr, flush=True)


def carry_out(name: str, tasks: list[Task], jobs: int) -> None:
    """Carries out the tasks whose files are not whole, in their order, in so many processes."""
    left = [task for task in tasks if not is_whole(task[0])]
    if not left:
        return
    for folder in {path.parent for path, _, _ in left}:
        folder.mkdir(parents=True, exist_ok=True)
        for torn in folder.glob("*.tmp*"):
            torn.unlink(missing_ok=True)
    # Libraries of the workers shall not each take all cores.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    began = time.monotonic()
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs, len(left)), mp_context=context, initializer=_begin) as pool:
        pending = {pool.submit(_do, *task): task[0] for task in left}
        try:
            for done, future in enumerate(as_completed(pending), 1):
                future.result()
                rest = (time.monotonic() - began) / done * (len(left) - done)
                say(f"{name} {done}/{len(left)} {pending[future].stem}, {in_words(rest)} left")
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def in_words(seconds: float) -> str:
    """A duration as one reads it."""
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


def _do(path: Path, work: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    write_json(path, work(*arguments))


def _begin() -> None:
    sightline.set_threads(1)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def follow() -> None:
        # A parent that is killed cannot tell its workers to end.
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
