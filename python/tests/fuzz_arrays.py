"""Fuzz target of arrays: every call that takes arrays, with arguments mutated in type, shape, layout, value and kind.

    python python/tests/fuzz_arrays.py --mutations 1000000 --seed 1

A mutated call raises `ValueError`, `TypeError` or `MemoryError`, or returns; it never panics, ends the interpreter, takes
more than four seconds, or changes its argument. A call that returns had arguments that a plain reading by NumPy
understands, and gives the result of that plain reading.
"""

from __future__ import annotations

import argparse
import array
import faulthandler
import resource
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

import sightline

#: Types of numbers and of other things that arrays hold.
TYPES = "f2 f4 f8 >f4 >f8 g c8 c16 i1 i2 i4 i8 >i2 >i8 u1 u2 u4 u8 >u8 ? O U8 S8 M8[s] m8[s] V8".split()
#: Values at limits of types and rules.
VALUES = (
    *(0.0, -0.0, 0.5, 1.0, -1.0, 2.0, 3.5, 5e-324, 1e-40, 1e-9, 255, 256, 65535, 65536, 1e9, 1e15, 1e30, 1e300),
    *(np.nan, np.inf, -np.inf, -1e300, 2**31, 2**32, 2**53, 2.0**63, 2.0**64, -(2.0**31), np.pi, 1e6),
)
#: Words in place of an argument of words.
WORDS = ("", "0", "car", "tyre", "a" * 300, "\0", "\ud800", "é", "../x", None, 3, b"x", ("a",), ["a", 1], ["a", "a"])
#: Errors that a wrong argument may raise.
ERRORS = (ValueError, TypeError, MemoryError)
#: Seconds and bytes that a run may take: for one call, and at its peak.
SLOWEST, LARGEST = 4.0, 2 << 30

SCENE = {
    "sightline": 1,
    "name": "small",
    "roi": {"min": [-10, -10, -0.5], "max": [10, 10, 3.5], "voxel": [2, 2, 1]},
    "lidar": {"channels": 2, "fov": [-20, 0], "azimuth_steps": 8, "range": 50},
    "mount": {"min": [-0.5, -0.5, 1.5], "max": [0.5, 0.5, 2.0], "lidars": 1},
    "frames": 2,
    "rate": 5,
    "static": [
        {"class": "ground", "plane": {"min": [-20, -20], "max": [20, 20], "z": 0}},
    ],
    "actors": [
        {
            "name": "crate",
            "kind": "car",
            "parts": [{"class": "vehicle", "box": {"min": [-0.5, -1, 0], "max": [0.5, 1, 2]}}],
            "poses": [{"x": 5, "y": 0}, {"x": 7, "y": 0}],
        }
    ],
}


class Target:
    """A call with seeds of its arguments.

    `wholes` names arguments of whole numbers, `words` arguments of texts; all others are real numbers.
    """

    def __init__(self, call: Callable[..., Any], wholes: str = "", words: str = "", **seeds: Any) -> None:
        self.call, self.seeds = call, seeds
        self.wholes, self.words = wholes.split(), words.split()


def targets() -> dict[str, Target]:
    """Every function and method that takes arrays."""
    scene = sightline.Scene.from_dict(SCENE, backend="cpu")
    # Beams that end at nothing have no range card, which takes longer than all else.
    through = sightline.Scene.from_dict(SCENE | {"coverage": "through"}, backend="cpu")
    suite = sightline.Suite([through, through])
    poses = np.array([[[0, 0, 1.5, 0, 0, 0]], [[0.2, 0, 1.75, 0, 0.1, 3]]])
    pair = np.concatenate([poses, poses + 0.1], 1)
    phases = np.array([0.0, np.nan])
    rays = np.array([[0, 0, 1, 1, 0, 0], [0, 0, 1, 0.6, 0, -0.8], [1, 1, 3, 0, 0, -1.0]])
    classes = ["a", "b"]
    votes = {"classes": classes, "roi": [[0, 0, 0], [2, 2, 2]], "voxel": [1, 1, 1]}

    def scan(poses: Any, frames: Any, seed: Any) -> list[Any]:
        return [(one.xyz, one.range, one.status) for one in scene.scan(poses, frames=frames, seed=seed)]

    def verify(poses: Any) -> Any:
        return scene.verify(poses, random=0, hostile=0, sample=5)

    def from_scans(points: Any, labels: Any, pose: Any, roi: Any, voxel: Any) -> Any:
        frame = votes | {"roi": roi, "voxel": voxel}
        return sightline.Psog.from_scans([points], [labels], [pose], **frame)

    def voted(points: Any, labels: Any, poses: Any, window: Any) -> Any:
        return sightline.Psog.from_scans(points, labels, poses, **votes, window=window)

    def mixed(poses: Any, sensors: Any, phases: Any) -> Any:
        return sightline.Placement(poses, sensors=sensors, phases=phases)

    return {
        "score": Target(through.score, poses=poses),
        "score_phases": Target(through.score, poses=pair, phases=phases),
        "range_card": Target(scene.range_card, poses=pair[0]),
        "suite_score": Target(suite.score, poses=pair),
        "covered": Target(through.covered, poses=poses[0]),
        "cast": Target(scene.cast, "frame", poses=poses, frame=1),
        "cast_rays": Target(scene.cast_rays, "frame", rays=rays, frame=0),
        "scan": Target(scan, "frames seed", poses=poses[:1], frames=np.array([0, 1]), seed=3),
        "verify": Target(verify, poses=poses),
        "beams_on": Target(
            scene.beams_on,
            words="targets",
            poses=poses[0],
            targets=["car"],
            distances=np.array([5.0, 10.0]),
            bearings=np.array([0.0, 1.5]),
        ),
        "redundancy": Target(through.redundancy, words="targets", poses=pair[0], targets=["car"]),
        "overlap": Target(scene.overlap, "least_shared", poses=pair[0], least_shared=3),
        "placement": Target(mixed, words="sensors", poses=pair[0], sensors=["", "x"], phases=phases),
        "psog": Target(
            sightline.Psog,
            "index counts frames shape",
            "classes",
            index=np.array([3, 5]),
            counts=np.array([[1, 0], [0, 2]]),
            frames=2,
            classes=classes,
            roi_min=np.zeros(3),
            voxel=np.ones(3),
            shape=np.array([2, 2, 2]),
        ),
        "from_scans": Target(
            from_scans,
            "labels",
            points=np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5]]),
            labels=np.array([0, 1]),
            pose=np.eye(4),
            roi=np.array([[0, 0, 0], [2, 2, 2.0]]),
            voxel=np.ones(3),
        ),
        "from_stacks": Target(
            voted,
            "labels window",
            points=np.ones((2, 1, 3)),
            labels=np.array([[0], [-1]]),
            poses=np.stack([np.eye(4)] * 2),
            window=1,
        ),
    }


class Arrayed:
    """An object that NumPy asks for an array, and which answers as it is told."""

    def __init__(self, answer: Any) -> None:
        self.answer = answer

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer if dtype is None else np.asarray(self.answer, dtype)

    def __len__(self) -> int:
        return 2**62


def typed(value: np.ndarray, rng: np.random.Generator) -> Any:
    """The array in another type."""
    kind = TYPES[rng.integers(len(TYPES))]
    return value.view("V1") if kind == "V8" else value.astype(kind)


def shaped(value: np.ndarray, rng: np.random.Generator) -> Any:
    """The array in another shape: more or fewer axes, none, or more elements than memory holds."""
    axis = int(rng.integers(max(value.ndim, 1)))
    changes: list[Callable[[], Any]] = [
        lambda: value.reshape(-1),
        lambda: value[None],
        lambda: value[..., None],
        lambda: value.T,
        lambda: np.take(value, 0, axis),
        lambda: np.take(value, [], axis),
        lambda: np.repeat(value, rng.integers(2, 20), axis),
        lambda: np.delete(value, 0, axis),
        lambda: value.reshape((1,) * 30 + value.shape),
        lambda: np.broadcast_to(value, (2**20, 2**20, *value.shape)),
        lambda: np.broadcast_to(value.reshape(-1)[0], (2**62, 0)),
        lambda: np.broadcast_to(value.reshape(-1)[0], value.shape),
        lambda: value.reshape(-1)[0],
        lambda: np.zeros((0,) * max(value.ndim, 1)),
    ]
    return changes[rng.integers(len(changes))]()


def laid_out(value: np.ndarray, rng: np.random.Generator) -> Any:
    """Equal numbers elsewhere in memory: other strides, not aligned, read only; or rows in another order."""
    packed = np.zeros(value.shape, [("pad", "u1"), ("v", value.dtype)])
    packed["v"] = value
    wide = np.repeat(value, 3, -1)[..., ::3] if value.ndim else value
    locked = value.copy()
    locked.flags.writeable = False
    changes = (packed["v"], wide, locked, np.asfortranarray(value), value[::-1], np.flip(value), value.T.copy().T)
    return changes[rng.integers(len(changes))]


def revalued(value: np.ndarray, rng: np.random.Generator) -> Any:
    """The array with some numbers at limits, or with some of its bytes changed."""
    value = value.copy(order="C")
    # NumPy itself fails where the bytes of a text are no letters.
    if rng.integers(4) == 0 and value.dtype.kind not in "OU":
        held = np.frombuffer(bytearray(value.tobytes()), "u1").copy()
        held[rng.integers(held.size)] = rng.integers(256)
        return held.view(value.dtype).reshape(value.shape)
    for _ in range(rng.integers(1, 4)):
        number = VALUES[rng.integers(len(VALUES))] if rng.integers(3) else rng.normal() * 10 ** rng.uniform(-3, 6)
        value.reshape(-1)[rng.integers(value.size)] = number
    return value


def in_other_kind(value: np.ndarray, rng: np.random.Generator) -> Any:
    """The numbers in another kind of object, or something that holds no numbers."""
    listed = value.tolist()
    circle: list[Any] = []
    circle.append(circle)
    ragged = [listed, [listed]] if rng.integers(2) else [*np.atleast_1d(value).tolist(), []]
    interface = type("Interface", (), {"__array_interface__": {"shape": (2,), "typestr": "<f8", "version": 3}})()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        matrix = np.matrix(value) if value.ndim <= 2 else value
    # Memory of an array without an owner is not made: that is a fault of the caller.
    others: tuple[Any, ...] = (
        *(listed, tuple(np.atleast_1d(value)), ragged, circle, Arrayed(value), Arrayed(ValueError("no")), interface),
        *(Arrayed(3), Arrayed(None), matrix, np.ma.array(value, mask=value == 0), memoryview(value.copy(order="C"))),
        *(array.array("d", np.ravel(value).astype(float)), None, True, 3, 10**400, "0", b"\0" * 48, {}, object(), iter([1])),
        *(range(2**60), [10**400], [None], {"a": listed}, [np.float32(1), "1"], np.datetime64(1, "s"), slice(3)),
    )
    return others[rng.integers(len(others))]


MUTATORS = (typed, shaped, laid_out, revalued, revalued, in_other_kind)


def mutated(seed: Any, rng: np.random.Generator) -> Any:
    """A seed after one to three mutations; the last one that applies where one of them does not."""
    value = np.array(seed)
    for _ in range(rng.integers(1, 4)):
        try:
            with np.errstate(all="ignore"):
                value = MUTATORS[rng.integers(len(MUTATORS))](value, rng)
        except (ValueError, TypeError, OverflowError, IndexError, MemoryError, RuntimeError, AttributeError, SystemError):
            # NumPy does not do that to such an array.
            continue
        # NumPy itself fails at a matrix of three axes.
        if type(value) is not np.ndarray or value.size == 0 or value.nbytes > 1 << 20:
            break
    return value


def plain(name: str, value: Any, target: Target) -> Any:
    """A plain reading of an argument by NumPy; raises where it holds no finite numbers, or none that are whole."""
    if name in target.words or value is None:
        return value
    numbers = np.asarray(value)
    if numbers.dtype.kind not in "fiu":
        raise ValueError(f"{name} holds {numbers.dtype}")
    if name in target.wholes:
        wholes = [int(number) for number in numbers.reshape(-1).tolist()]
        if wholes != numbers.reshape(-1).tolist():
            raise ValueError(f"{name} holds numbers that are not whole")
        return wholes[0] if numbers.ndim == 0 else np.array(wholes).reshape(numbers.shape)
    if name != "phases" and not np.isfinite(numbers).all():
        raise ValueError(f"{name} is not finite")
    return np.array(numbers.astype(float), order="C")


def bytes_of(result: Any) -> Any:
    """A result as something that can be compared to the bit."""
    if isinstance(result, np.ndarray):
        return result.dtype.str, result.shape, result.tobytes()
    if isinstance(result, sightline.Psog):
        return bytes_of([result.index, result.counts, result.frames, result.roi_min, result.voxel, result.shape])
    if isinstance(result, sightline.Placement):
        return bytes_of([result.poses, result.sensors, result.phases])
    if isinstance(result, dict):
        return {key: bytes_of(value) for key, value in result.items() if key not in ("timings", "adapter")}
    if isinstance(result, (list, tuple)):
        return [bytes_of(value) for value in result]
    return repr(result)


class Fault(Exception):
    """A promise of the module that does not hold."""


def tried(target: Target, arguments: dict[str, Any]) -> str:
    """Calls a target: `raised`, or `returned` where the result is that of a plain reading."""
    small = {name: value for name, value in arguments.items() if type(value) is np.ndarray and value.nbytes < 1 << 16}
    held = {name: value.tobytes() for name, value in small.items()}
    start = time.perf_counter()
    try:
        result = target.call(**arguments)
    except ERRORS as error:
        if not str(error):
            raise Fault(f"{type(error).__name__} without a sentence") from error
        result = None
        said = "raised"
    else:
        said = "returned"
    taken = time.perf_counter() - start
    if taken > SLOWEST:
        raise Fault(f"took {taken:.1f} s")
    if changed := [name for name, before in held.items() if before != arguments[name].tobytes()]:
        raise Fault(f"changed {changed}")
    if said == "returned":
        try:
            read = {name: plain(name, value, target) for name, value in arguments.items()}
        except Exception as error:
            raise Fault(f"was accepted, and {error}") from error
        if bytes_of(result) != bytes_of(target.call(**read)):
            raise Fault("gives another result than its plain reading")
    return said


def drawn(names: list[str], all_targets: dict[str, Target], seed: int, number: int) -> tuple[str, dict[str, Any]]:
    """Mutation `number`: the name of a target and its arguments."""
    rng = np.random.default_rng([seed, number])
    name = names[number % len(names)]
    target = all_targets[name]
    arguments = dict(target.seeds)
    for _ in range(rng.integers(1, 3)):
        of = list(arguments)[rng.integers(len(arguments))]
        if of in target.words:
            words = WORDS[rng.integers(len(WORDS))]
            arguments[of] = words if rng.integers(2) else [words] * int(rng.integers(4))
        else:
            arguments[of] = mutated(target.seeds[of], rng)
    return name, arguments


def main() -> int:
    """Runs mutations, prints how they ended by target, and every fault; 1 where there is one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mutations", type=int, default=10_000, help="how many calls")
    parser.add_argument("--seed", type=int, default=1, help="seed of the mutations")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutation, to repeat a fault")
    parser.add_argument("--targets", nargs="+", help="names of targets; all where none is named")
    options = parser.parse_args()
    faulthandler.enable()
    warnings.simplefilter("ignore")
    everything = targets()
    names = options.targets or list(everything)
    ended = {name: {"raised": 0, "returned": 0} for name in names}
    faults = 0
    for number in range(options.first, options.first + options.mutations):
        if number % 1000 == 0:
            print(f"{number}", file=sys.stderr, flush=True)
        name, arguments = drawn(names, everything, options.seed, number)
        try:
            ended[name][tried(everything[name], arguments)] += 1
        except KeyboardInterrupt:
            break
        except BaseException as error:
            faults += 1
            given = {key: repr(value)[:200] for key, value in arguments.items() if value is not everything[name].seeds[key]}
            print(f"FAULT of {name}, mutation {number}: {type(error).__name__}: {str(error)[:300]}; with {given}", flush=True)
            if faults >= 20:
                break
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    if peak > LARGEST:
        faults += 1
        print(f"FAULT: the peak of memory is {peak >> 20} MiB")
    for name, counts in ended.items():
        print(f"{name}: {counts['raised']} raised, {counts['returned']} returned as a plain reading does")
    print(f"{faults} faults; peak of memory {peak >> 20} MiB")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
