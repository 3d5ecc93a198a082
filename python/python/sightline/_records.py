"""What comes back from scenes: scores, scans, results; arrays with names."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._native import Placement

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]


class Scores:
    """Scores of N placements, one array a score.

    ``scores["near_gain"]`` is an array ``[N]``; ``NaN`` where a placement has no such score. Two columns have
    more axes: ``covered_by_class`` ``[N, classes]`` and ``unique_share`` ``[N, L]``, ``NaN`` beyond a placement's own
    LiDARs. ``near_gain_2`` and ``near_gain_3`` count each voxel for up to two and three LiDARs that cover it. Names and
    meaning are those of ``sightline score --format json``.
    """

    __slots__ = ("classes", "columns", "guards", "names")

    def __init__(
        self,
        names: list[str],
        columns: dict[str, npt.NDArray[Any]],
        guards: list[list[str]],
        classes: list[str],
    ) -> None:
        #: Name of each placement; its number for those from an array.
        self.names = names
        #: Arrays by score.
        self.columns = columns
        #: Of each placement, sentences why its scores should not be believed; mostly none.
        self.guards = guards
        #: Names of the classes of ``covered_by_class``.
        self.classes = classes

    def __getitem__(self, column: str) -> npt.NDArray[Any]:
        try:
            return self.columns[column]
        except KeyError:
            raise KeyError(f"`{column}` is no score; there are {', '.join(self.columns)}") from None

    def __len__(self) -> int:
        return len(self.names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __contains__(self, column: object) -> bool:
        return column in self.columns

    def __repr__(self) -> str:
        return f"Scores({len(self)} placements: {', '.join(self.columns)})"

    def __eq__(self, other: object) -> bool:
        """Whether names, guards and every bit of every column are the same."""
        if not isinstance(other, Scores) or list(self) != list(other):
            return False
        same = all(_same(self[name], other[name]) for name in self)
        return same and (self.names, self.guards, self.classes) == (
            other.names,
            other.guards,
            other.classes,
        )

    __hash__ = None  # type: ignore[assignment]

    def to_dict(self) -> dict[str, Any]:
        """Names, guards and all columns by name; ``covered_by_class`` a column a class."""
        table: dict[str, Any] = {"name": list(self.names)}
        for name, values in self.columns.items():
            if values.ndim == 1:
                table[name] = values
            else:
                parts = self.classes if name == "covered_by_class" else range(values.shape[1])
                table.update({f"{name}.{part}": values[:, k] for k, part in enumerate(parts)})
        table["guards"] = [list(guards) for guards in self.guards]
        return table

    def to_pandas(self) -> Any:
        """A ``pandas.DataFrame`` with a row a placement."""
        import pandas

        return pandas.DataFrame(self.to_dict()).set_index("name")

    @staticmethod
    def concatenate(parts: Iterable[Scores]) -> Scores:
        """The scores of several batches of one scene, in order."""
        parts = list(parts)
        if not parts:
            raise ValueError("parts: are none; give at least one batch of scores")
        first = parts[0]
        for part in parts:
            if list(part) != list(first) or part.classes != first.classes:
                raise ValueError("parts: have different columns; they must come from one scene")
        width = {
            name: max(part[name].shape[1] for part in parts)
            for name in first
            if first[name].ndim > 1
        }
        columns = {
            name: np.concatenate(
                [_widened(part[name], width[name]) if name in width else part[name] for part in parts]
            )
            for name in first
        }
        return Scores(
            [name for part in parts for name in part.names],
            columns,
            [guards for part in parts for guards in part.guards],
            first.classes,
        )


def _same(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> bool:
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def _widened(values: npt.NDArray[Any], width: int) -> npt.NDArray[Any]:
    missing = width - values.shape[1]
    return np.pad(values, ((0, 0), (0, missing)), constant_values=np.nan) if missing else values


class Status(enum.IntEnum):
    """What a beam came back as."""

    #: From the surface that it met.
    HIT = 0
    #: Not at all: it met nothing within range.
    MISS = 1
    #: Not at all: what came back was too weak.
    LOST = 2
    #: Not at all: thrown away, although it was strong enough.
    DROPPED = 3
    #: From the fog.
    FOG = 4
    #: From a flake of snow.
    SNOW = 5
    #: At a wrong distance, for another sensor's pulse.
    CROSSTALK = 6
    #: A second time, from a surface behind the first.
    SECOND = 7


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes of the B actors of a frame."""

    #: ``[B, 4, 4]``, takes the box's frame (x forward, origin in its middle) to the ego frame.
    ego_from_box: F64
    #: ``[B, 3]``, extents along its x, y, z in metres.
    size: F64
    #: ``[B, 3]``, in the world frame, metres a second.
    velocity: F64
    #: ``[B]``, the same in all frames, from 1.
    instance: U16
    #: ``[B]``, position in ``Scan.classes``.
    class_id: U16
    #: ``[B]``, points of the scan that lie in it.
    points: U32
    #: Names of the actors in the scene; may be empty.
    names: list[str]
    #: ``car``, ``pedestrian``, …
    kinds: list[str]

    def __len__(self) -> int:
        return len(self.names)


@dataclass(frozen=True, eq=False)
class Scan:
    """One frame as a rig saw it: P points, ordered by LiDAR, ring, column.

    With ``misses=True`` every beam is there, ``NaN`` where there is no point.
    """

    #: Name of the scene.
    scene: str
    #: Number of the frame.
    frame: int
    #: Seconds since frame 0.
    time: float
    #: Class names.
    classes: list[str]
    #: ``[4, 4]``, takes the ego frame to the world.
    world_from_ego: F64
    #: Of each LiDAR ``model``, ``ego_from_sensor`` ``[4, 4]``, ``channels``, ``columns``, ``range``.
    lidars: list[dict[str, Any]]
    #: ``[P, 3]`` metres in the ego frame at ``time``, the vehicle's own motion made up for.
    xyz: F32
    #: ``[P, 3]``, the same as a sensor sees it that does not know that it moved.
    raw: F32
    #: ``[P]`` metres along the beam.
    range: F32
    #: ``[P]``, calibrated reflectivity from 0 to 1.
    intensity: F32
    #: ``[P]`` seconds since ``time``.
    time_offset: F32
    #: ``[P]``, cosine of the angle of incidence.
    incidence: F32
    #: ``[P]``, position in ``lidars``.
    lidar: U16
    #: ``[P]``, channel of the LiDAR.
    ring: U16
    #: ``[P]``, azimuth step.
    column: U32
    #: ``[P]``, position in ``classes``; 65535 for fog, snow, crosstalk.
    class_id: U16
    #: ``[P]``, what the beam meets in clear air; 65535 for nothing.
    clean_class_id: U16
    #: ``[P]``, 1 + the number of the actor; 0 for what is none, 65535 for the own vehicle.
    instance: U16
    #: ``[P]``, a :class:`Status`.
    status: npt.NDArray[np.uint8]
    #: Actors in the frame.
    boxes: Boxes

    def __len__(self) -> int:
        return len(self.xyz)

    def __repr__(self) -> str:
        return f"Scan({self.scene!r}, frame {self.frame}, {len(self)} points, {len(self.boxes)} boxes)"


@dataclass(frozen=True, eq=False)
class Result:
    """What a search has come to."""

    #: The result; ``None`` where no candidate kept the rules of the mount.
    best: Placement | None
    #: Layouts that it is compared with.
    baselines: list[Placement]
    #: Scores over all frames of ``best``, if there is one, and of ``baselines`` behind it.
    scores: Scores
    #: A record of each generation.
    history: list[dict[str, Any]]
    #: All of ``result.json``: settings, findings, certificate, timings.
    record: dict[str, Any]

    def __repr__(self) -> str:
        return f"Result(best={self.best!r}, {self.record['evaluations']} evaluations)"


@dataclass(frozen=True, eq=False)
class Front:
    """Placements that no other one found beats in all objectives together, the best in the first objective first."""

    #: Names of the K objectives.
    objectives: list[str]
    #: The N placements.
    placements: list[Placement]
    #: A list of K values for each placement.
    values: list[list[float]]
    #: Price of all sensors of each placement.
    prices: list[float]
    #: Whether each placement meets all requirements; true where there are none.
    meets: list[bool]
    #: Number of a placement by its role: ``knee``, ``best price``, ``cheapest that meets all requirements``, ….
    picks: dict[str, int]
    #: Scores over all frames.
    scores: Scores
    #: All of ``result.json``.
    record: dict[str, Any]

    def __len__(self) -> int:
        return len(self.placements)

    def __repr__(self) -> str:
        return f"Front({len(self)} placements: {', '.join(self.objectives)})"
