"""Tasks on actors that may be lost."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayError, RayTaskError

from . import _progress

#: Tasks in flight for each actor: one at work, one behind it.
IN_FLIGHT = 2
#: Times that a task is lost with its worker, or a worker before it stands, until it is given up.
TRIES = 5
#: Seconds between two looks at workers that do not answer.
LOOK = 5.0


@dataclass
class Task:
    """A call of a worker's method."""

    method: str
    arguments: tuple[Any, ...]
    #: Number of the scene that a worker builds for it; workers keep to the scenes that they have built.
    home: int
    #: Where its result belongs.
    index: tuple[int, ...] = ()
    tries: int = 0


@dataclass(frozen=True)
class Progress(_progress.Progress):
    """How far the work is, and who does it; ``seconds`` are those of this call."""

    #: Workers that answer.
    workers: int = 0
    #: Workers lost so far.
    lost: int = 0


@dataclass(eq=False)
class _Member:
    actor: Any
    cores: float
    homes: set[int] = field(default_factory=set)
    load: int = 0
    is_ready: bool = False
    #: Workers lost in its place since one stood there.
    tries: int = 0


class Pool:
    """Actors that are started again where they are lost; to be used in a ``with`` statement."""

    def __init__(
        self,
        start: Callable[[float], Any],
        cores: list[float],
        progress: _progress.Wanted,
        work: str,
    ) -> None:
        self._start, self._progress, self._work = start, progress, work
        self._members: list[_Member] = []
        self._flying: dict[Any, tuple[_Member, Task | None]] = {}
        self._lost = 0
        for count in cores:
            self._hire(count)

    @property
    def slots(self) -> int:
        """Tasks that are in flight at most."""
        return IN_FLIGHT * len(self._members)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        for member in self._members:
            ray.kill(member.actor)

    def run(
        self,
        tasks: Iterable[Task],
        done: Callable[[Task, Any], Iterator[Task]],
        *,
        total: int,
        already: int = 0,
        weigh: Callable[[Task], int] = lambda _: 1,
    ) -> None:
        """Runs tasks to the last; ``done`` takes each result as it comes, and may return further tasks."""
        waiting: dict[int, deque[Task]] = {}
        for first in tasks:
            waiting.setdefault(first.home, deque()).append(first)
        with _progress.shown(None if callable(self._progress) else self._progress) as step:
            self._run(waiting, done, total, already, weigh, step)

    def _run(
        self,
        waiting: dict[int, deque[Task]],
        done: Callable[[Task, Any], Iterator[Task]],
        total: int,
        already: int,
        weigh: Callable[[Task], int],
        step: _progress.Reporter,
    ) -> None:
        begun, finished = time.monotonic(), 0
        while any(waiting.values()) or any(flying for _, flying in self._flying.values()):
            self._hand_out(waiting)
            answered, _ = ray.wait(list(self._flying), num_returns=1, timeout=LOOK)
            for reference in answered:
                member, task = self._flying.pop(reference)
                try:
                    value = ray.get(reference, timeout=LOOK)
                except RayTaskError as error:
                    # The method itself failed: every other worker would fail as well.
                    raise error.cause if isinstance(error.cause, Exception) else error
                except (RayError, GetTimeoutError) as error:
                    self._replace(member, error)
                    if task is not None:
                        self._again(task, waiting, error)
                    continue
                if task is None:
                    member.is_ready = True
                    continue
                member.load -= 1
                finished += weigh(task)
                for further in done(task, value):
                    waiting.setdefault(further.home, deque()).append(further)
                self._tell(finished, already, total, begun, step)

    def _hire(self, cores: float, tries: int = 0) -> None:
        member = _Member(self._start(cores), cores, tries=tries)
        self._members.append(member)
        self._flying[member.actor.ready.remote()] = (member, None)

    def _replace(self, member: _Member, error: Exception) -> None:
        """Starts another in place of a lost one; its other tasks come back as lost by themselves."""
        if member not in self._members:
            return
        self._members.remove(member)
        self._lost += 1
        tries = 0 if member.is_ready else member.tries + 1
        if tries < TRIES:
            self._hire(member.cores, tries)
        elif not self._members:
            raise RuntimeError(
                f"workers: none is left; the last place lost {TRIES} before they stood, the last one with: "
                f"{_said(error)}; see that every node has sightline and memory for the scenes, start fewer workers a "
                "node, or load the scenes with fewer frames"
            ) from error

    @staticmethod
    def _again(task: Task, waiting: dict[int, deque[Task]], error: Exception) -> None:
        task.tries += 1
        if task.tries >= TRIES:
            raise RuntimeError(
                f"{task.method}{task.arguments!r:.200}: its worker was lost {TRIES} times, the last time with: "
                f"{_said(error)}; if workers run out of memory, start fewer a node, or load the scenes "
                "with fewer frames or a smaller `memory`"
            ) from error
        waiting.setdefault(task.home, deque()).appendleft(task)

    def _hand_out(self, waiting: dict[int, deque[Task]]) -> None:
        """Gives tasks to the workers with the least to do, each of a home that it has built if there is one."""
        while True:
            free = [m for m in self._members if m.is_ready and m.load < IN_FLIGHT]
            homes = [home for home, tasks in waiting.items() if tasks]
            if not free or not homes:
                return
            member = min(free, key=lambda m: m.load)
            own = [home for home in homes if home in member.homes]
            builders = {home: sum(home in m.homes for m in self._members) for home in homes}
            home = own[0] if own else min(homes, key=lambda home: builders[home])
            task = waiting[home].popleft()
            member.homes.add(home)
            member.load += 1
            reference = getattr(member.actor, task.method).remote(*task.arguments)
            self._flying[reference] = (member, task)

    def _tell(self, finished: int, already: int, total: int, begun: float, step: _progress.Reporter) -> None:
        if not callable(self._progress):
            step(self._work, already + finished, total)
            return
        seconds = time.monotonic() - begun
        left = seconds * (total - already - finished) / finished if finished else None
        workers = sum(member.is_ready for member in self._members)
        self._progress(Progress(already + finished, total, seconds, left, self._work, workers, self._lost))


def _said(error: Exception) -> str:
    """The line of an error of Ray that tells most: the last of a traceback, else the first."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return lines[-1 if getattr(error, "actor_init_failed", False) else 0].rstrip(".")
