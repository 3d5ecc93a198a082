"""Beyond one machine, with Ray: ``pip install 'sightline-lidar[ray]'``.

>>> import sightline
>>> from sightline import distributed
>>> scenes = [sightline.Scene.load(path, backend="cpu") for path in paths]     # doctest: +SKIP
>>> by_scene = distributed.score(scenes, poses, checkpoint="scores")           # doctest: +SKIP

An actor a node builds the engine of a scene once and keeps it. Work is cut into chunks of a second or more, two of
them in flight for each actor, and what comes back is put together by index: the bytes are those of one process.
Chunks of workers and nodes that are lost are done again by others. With ``checkpoint=`` the driver itself may die,
whether it scores, searches or runs commands: the next call with the same arguments goes on from there.

Scenes travel as paths, so every node needs the same files at the same places; a scene whose files differ is refused.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ._extra import missing

try:
    import ray
except ImportError as _missing:
    raise missing("Ray", "ray") from _missing

from . import Placement, Result, Scene, Scores, optimize as _optimize, set_threads
from ._checkpoint import Checkpoint, gaps, pack_result, pack_scores, unpack_result, unpack_scores
from ._native import FEW_PLACEMENTS, DoubtWarning
from ._pool import Pool, Progress, Task
from ._records import F64
from ._scores import missed_by_first

__all__ = ["Completed", "Progress", "optimize", "run", "score"]

#: Placements of the first chunk of a scene, whose time tells how large the others may be.
PROBE = 16
#: Seconds that a chunk is to take.
CHUNK_SECONDS = 2.0


class _Worker:
    """Holds scenes whose engines are built when they are first asked for."""

    scenes: list[Scene]
    poses: Any
    named: dict[str, Any]

    def __init__(self, threads: int | None, shared: list[Any]) -> None:
        self.threads, self.shared = threads, shared

    def ready(self) -> None:
        """Takes scenes, poses and names; here, for of a constructor's exception Ray hands on the text alone.

        Scenes are unpickled here too: one whose files differ raises its own ``ValueError``, which Ray would replace.
        """
        if self.threads is not None:
            set_threads(self.threads)
        scenes, self.poses, self.named = ray.get(self.shared)
        self.scenes = pickle.loads(scenes)

    def score(self, scene: int, start: int, stop: int) -> tuple[Scores, float]:
        """Scores of some placements in a scene, and the seconds that took without building the engine."""
        self._scored(scene, start, start + 1)
        begun = time.perf_counter()
        scores = self._scored(scene, start, stop)
        seconds = time.perf_counter() - begun
        # Placements are numbered over all chunks.
        scores.names = [str(number) for number in range(start, stop)]
        return scores, seconds

    def _scored(self, scene: int, start: int, stop: int) -> Scores:
        phases = self.named["phases"]
        phases = phases if phases is None else phases[start:stop]
        # One process looks at as few placements, however they are cut into chunks.
        few = len(self.poses) <= FEW_PLACEMENTS
        return self.scenes[scene].score(
            self.poses[start:stop], sensors=self.named["sensors"], phases=phases, self_hits=few
        )

    def optimize(self, scene: int, settings: dict[str, Any]) -> Result:
        """A search in a scene."""
        return _optimize(self.scenes[scene], **settings)

    def run(self, arguments: list[str]) -> Completed:
        """A command of the program."""
        command = [sys.executable, "-m", "sightline", *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        return Completed(arguments, done.returncode, done.stdout, done.stderr)


@dataclass(frozen=True)
class Completed:
    """A command of the program that has ended."""

    #: Without the program's name.
    arguments: list[str]
    #: 0 done, 1 a check failed, 2 bad input, 130 interrupted.
    code: int
    stdout: str
    stderr: str


def score(
    scenes: Sequence[Scene],
    poses: npt.ArrayLike,
    *,
    sensors: Sequence[str] | None = None,
    phases: npt.ArrayLike | None = None,
    actors: int | None = None,
    threads: int | None = None,
    checkpoint: str | Path | None = None,
    progress: bool | Callable[[Progress], object] | None = None,
) -> list[Scores]:
    """Scores of N placements in each of some scenes.

    ``poses`` is an array as for :meth:`sightline.Scene.score`, ``[N, L, 6]``, or ``[L, 6]`` for one placement;
    ``sensors`` names the model of each LiDAR, and ``phases`` ``[L]`` or ``[N, L]`` locks them. There is an actor a node
    with all of its cores, or ``actors`` of them with ``threads`` threads each. ``checkpoint`` is a folder that finished
    chunks are kept in. ``progress`` is as for :func:`sightline.optimize`; a function is told after each chunk.

    Raises ``ValueError`` for what :meth:`sightline.Scene.score` refuses, in its words, and for a checkpoint of other
    inputs; ``RuntimeError`` where a chunk, or each worker at its start, is lost over and over. Poses and phases are
    checked before anything is sent.
    """
    array, locked = _checked(poses, sensors, phases)
    if not scenes:
        raise ValueError("scenes: are none; give at least one")
    if not len(array):
        return [scene.score(array, sensors=sensors) for scene in scenes]
    named = {"sensors": list(sensors) if sensors is not None else None, "phases": locked}
    kept = Checkpoint.open(checkpoint, {"scenes": list(scenes), "poses": array, **named})
    finished = [{start: unpack_scores(part) for start, part in kept.read(k)} for k in range(len(scenes))]
    count = len(array)
    total = count * len(scenes)

    def probe(scene: int) -> Iterator[Task]:
        for start, stop in gaps(count, finished[scene]):
            yield Task("score", (scene, start, min(start + PROBE, stop)), home=scene)
            return

    def rest(scene: int, rate: float) -> Iterator[Task]:
        left = list(gaps(count, finished[scene]))
        # Little work is shared by all workers rather than done in large chunks by some.
        share = sum(stop - start for start, stop in left) // pool.slots + 1
        size = max(PROBE, min(int(rate * CHUNK_SECONDS), share))
        for start, stop in left:
            for at in range(start, stop, size):
                yield Task("score", (scene, at, min(at + size, stop)), home=scene)

    cut = [False] * len(scenes)

    def done(task: Task, value: tuple[Scores, float]) -> Iterator[Task]:
        scene, start, stop = task.arguments
        scores, seconds = value
        kept.write(scene, start, pack_scores(scores))
        finished[scene][start] = scores
        if not cut[scene]:
            cut[scene] = True
            yield from rest(scene, (stop - start) / max(seconds, 1e-6))

    have = sum(len(part.names) for parts in finished for part in parts.values())
    pool = _pool(actors, threads, list(scenes), array, named, progress, "placements")
    with pool:
        first = [task for scene in range(len(scenes)) for task in probe(scene)]
        weigh = lambda task: task.arguments[2] - task.arguments[1]  # noqa: E731
        pool.run(first, done, total=total, already=have, weigh=weigh)
    # Parts of a scene are freed once put together: all parts may be gigabytes.
    return [Scores.concatenate(parts.pop(start) for start in sorted(parts)) for parts in finished]


def optimize(
    scenes: Sequence[Scene],
    *,
    seeds: Sequence[int] = (1,),
    actors: int | None = None,
    threads: int | None = None,
    checkpoint: str | Path | None = None,
    progress: bool | Callable[[Progress], object] | None = None,
    **settings: Any,
) -> list[list[Result]]:
    """A search in each scene with each seed: ``[scene][seed]``.

    ``settings`` are those of :func:`sightline.optimize`, but for ``callback``, which cannot travel. ``checkpoint`` is a
    folder that finished searches are kept in; one that is cut off begins again.

    Raises ``ValueError`` for settings that are wrong, and for a checkpoint of other inputs; ``RuntimeError`` where a
    search fails over and over. Requirements that a result misses are a ``DoubtWarning`` with scene and seed.
    """
    if "callback" in settings:
        raise ValueError("callback: cannot travel to other processes; give `progress`, which is told of each search")
    kept = Checkpoint.open(checkpoint, {"scenes": list(scenes), "seeds": list(seeds), "settings": settings})
    results = [{k: unpack_result(one) for k, one in kept.read(scene)} for scene in range(len(scenes))]
    tasks = [
        Task("optimize", (scene, {**settings, "seed": seed}), home=scene, index=(scene, k))
        for scene in range(len(scenes))
        for k, seed in enumerate(seeds)
        if k not in results[scene]
    ]

    def done(task: Task, value: Result) -> Iterator[Task]:
        scene, k = task.index
        kept.write(scene, k, pack_result(value))
        results[scene][k] = value
        # Nobody hears the warnings of a worker.
        for words in missed_by_first(value.scores) if value.best is not None else ():
            warnings.warn(f"{scenes[scene].name}, seed {seeds[k]}: {words}", DoubtWarning, stacklevel=2)
        return iter(())

    total = len(scenes) * len(seeds)
    with _pool(actors, threads, list(scenes), None, None, progress, "searches") as pool:
        pool.run(tasks, done, total=total, already=total - len(tasks))
    return [[row[k] for k in range(len(seeds))] for row in results]


def run(
    commands: Sequence[Sequence[str]],
    *,
    actors: int | None = None,
    threads: int | None = None,
    checkpoint: str | Path | None = None,
    progress: bool | Callable[[Progress], object] | None = None,
) -> list[Completed]:
    """Commands of the program, each on some node, as ``["study", "cost", "scenes/highway.json"]``; in their order.

    Files that they read and write are those of the node; take a folder that all nodes share. ``threads`` is given to
    the commands as ``--threads``. ``checkpoint`` is a folder that commands are kept in that were done or whose check
    failed; what could not be done is tried again by the next call. The folder knows the commands, not the files that
    they read.

    Raises ``ValueError`` for a checkpoint of other commands; ``RuntimeError`` where a worker is lost over and over.
    """
    more = ["--threads", str(threads)] if threads is not None else []
    given = [[*command, *more] for command in commands]
    kept = Checkpoint.open(checkpoint, {"commands": given})
    results = {k: Completed(**words) for k, (words, _) in kept.read(0)}
    tasks = [Task("run", (words,), home=k, index=(k,)) for k, words in enumerate(given) if k not in results]

    def done(task: Task, value: Completed) -> Iterator[Task]:
        results[task.index[0]] = value
        if value.code in (0, 1):
            kept.write(0, task.index[0], (asdict(value), {}))
        return iter(())

    with _pool(actors, None, [], None, None, progress, "commands") as pool:
        pool.run(tasks, done, total=len(given), already=len(given) - len(tasks))
    return [results[k] for k in range(len(given))]


def _checked(
    poses: npt.ArrayLike, sensors: Sequence[str] | None, phases: npt.ArrayLike | None
) -> tuple[F64, F64 | None]:
    """Poses ``[N, L, 6]`` and phases ``[N, L]``; raises of them what :meth:`sightline.Scene.score` would."""
    try:
        array, turned = np.asanyarray(poses), None if phases is None else np.asanyarray(phases)
        are_masked = np.ma.is_masked(array) or np.ma.is_masked(turned)
        are_many = not are_masked and array.ndim == 3 and (turned is None or turned.shape in (array.shape[1:2], array.shape[:2]))
        if are_many:
            # Types and the number of LiDARs, checked by a placement with nothing else to be refused for.
            locked = None if turned is None else np.zeros(array.shape[1:2], turned.dtype)
            Placement(np.zeros((1, *array.shape[1:]), array.dtype), sensors=sensors, phases=locked)
    except (TypeError, ValueError):
        are_many = False
    if not are_many:
        # Placement that is alone, or the sentence that names the whole shape.
        one = Placement(poses, name="0", sensors=sensors, phases=phases)
        return one.poses[None], None if phases is None else one.phases[None]
    array = np.ascontiguousarray(array, np.float64)
    if turned is not None:
        turned = np.ascontiguousarray(np.broadcast_to(turned, array.shape[:2]), np.float64)
    for n, pose in enumerate(array):
        Placement(pose, name=str(n), sensors=sensors, phases=None if turned is None else turned[n])
    return array, turned


def _nodes() -> list[dict[str, Any]]:
    return list(ray.nodes())  # type: ignore[no-untyped-call]


def _pool(
    actors: int | None,
    threads: int | None,
    scenes: list[Scene],
    poses: npt.NDArray[np.float64] | None,
    named: dict[str, Any] | None,
    progress: bool | Callable[[Progress], object] | None,
    work: str,
) -> Pool:
    if not ray.is_initialized():
        ray.init(log_to_driver=False, include_dashboard=False)
    # References must outlive every actor, or a new one could not take them.
    shared = [ray.put(pickle.dumps(scenes)), ray.put(poses), ray.put(named)]
    remote = ray.remote(max_restarts=0)(_Worker)

    def start(cores: float) -> Any:
        own = threads if threads is not None or actors is not None else int(cores)
        return remote.options(num_cpus=cores).remote(own, shared)

    alive = [node["Resources"].get("CPU", 0) for node in _nodes() if node["Alive"]]
    wanted = [float(threads or 1)] * actors if actors else [cores for cores in alive if cores >= 1]
    if not wanted:
        raise RuntimeError("Ray has no node with a core; start one, or give actors=")
    return Pool(start, wanted, progress, work)
