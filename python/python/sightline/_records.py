"""Records that scenes return: scans, results; arrays with names."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._scores import Scores

if TYPE_CHECKING:
    from ._native import Placement

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
U16 = npt.NDArray[np.uint16]
U32 = npt.NDArray[np.uint32]
I64 = npt.NDArray[np.int64]

#: ``Scan.class_id`` of points of no class.
NO_CLASS = 65535
#: Fields of :class:`Scan` that have a row for each point.
COLUMNS = ("xyz", "raw", "range", "intensity", "time_offset", "incidence", "lidar", "ring", "column", "class_id",
           "clean_class_id", "instance", "status")  # fmt: skip


class Status(enum.IntEnum):
    """Fate of a beam."""

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
    #: For each LiDAR: ``model``, ``ego_from_sensor`` ``[4, 4]``, ``channels``, ``columns``, ``range``.
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

    def labels(self, ignore: int = -1) -> npt.NDArray[np.int64]:
        """``[P]`` class of each point, as losses of PyTorch take it; ``ignore`` for points of no class."""
        return np.where(self.class_id == NO_CLASS, ignore, self.class_id.astype(np.int64))

    def save(self, path: str | PathLike[str]) -> None:
        """Writes binary ``.ply`` or ``.pcd``, whole at any time: ``x``, ``y``, ``z`` and all columns but ``raw`` by name.

        Raises ``ValueError`` for another ending, ``OSError`` for a file that cannot be written.
        """
        from ._clouds import save

        save(self, path)

    def to_open3d(self) -> Any:
        """An ``open3d.t.geometry.PointCloud``; columns are its attributes by name. Raises ``ImportError`` without Open3D."""
        from ._clouds import to_open3d

        return to_open3d(self)

    def to_pyvista(self) -> Any:
        """A ``pyvista.PolyData``; columns are its point data by name. Raises ``ImportError`` without PyVista."""
        from ._clouds import to_pyvista

        return to_pyvista(self)

    def __repr__(self) -> str:
        return f"Scan({self.scene!r}, frame {self.frame}, {len(self)} points, {len(self.boxes)} boxes)"


def _write_page(page: Any, path: str | PathLike[str]) -> None:
    if page is None:
        why = "it was pickled, or its objective is a function"
        raise ValueError(f"report: this result has no page: {why}; call report where `optimize` or `front` ran")
    page.write(path)


@dataclass(frozen=True, eq=False)
class Result:
    """Outcome of a search."""

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
    #: Sentences on the result: requirements met or missed, what stays blind, baselines, warnings.
    verdict: str = ""
    _page: Any = field(default=None, repr=False)

    def report(self, path: str | PathLike[str]) -> None:
        """Writes the page of the search, whole at any time: ``report.html`` of ``sightline optimize``, without its command.

        The page opens offline. It shows the result, things seen and missed, baselines and settings. Writing it takes some seconds,
        since losses of LiDARs are looked at. Raises ``ValueError`` for a result that was pickled, and where the objective is a
        function, ``OSError`` for a file that cannot be written.
        """
        _write_page(self._page, path)

    def __repr__(self) -> str:
        by_method = (f"{method['method']} {method['evaluations']}" for method in self.record["methods"])
        return f"Result(best={self.best!r}, placements looked at: {', '.join(by_method)})"


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
    _page: Any = field(default=None, repr=False)

    def report(self, path: str | PathLike[str]) -> None:
        """Writes the page of the front, as ``Result.report`` does; it needs no time. Raises as that."""
        _write_page(self._page, path)

    def __len__(self) -> int:
        return len(self.placements)

    def __repr__(self) -> str:
        return f"Front({len(self)} placements: {', '.join(self.objectives)})"
