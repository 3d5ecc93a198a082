from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypedDict, final

from typing_extensions import NotRequired

import numpy as np
import numpy.typing as npt

from ._progress import Progress
from ._records import F32, F64, I64, U16, U32, Front, Result, Scan
from ._scores import Scores

__all__ = [
    "Atlas",
    "DoubtWarning",
    "FEW_PLACEMENTS",
    "Placement",
    "Psog",
    "Raycaster",
    "Rig",
    "ScanIterator",
    "Scene",
    "Search",
    "Sensor",
    "Space",
    "Suite",
    "Vehicle",
    "__version__",
    "_in_python",
    "front",
    "handover",
    "main",
    "optimize",
    "published",
    "read_placements",
    "set_threads",
    "study",
    "write_placements",
]

FEW_PLACEMENTS: int
__version__: str

_Path = str | bytes | PathLike[str] | PathLike[bytes]
_Poses = Placement | Sequence[Placement] | npt.ArrayLike
_Progress = bool | Callable[[Progress], object] | None
_Backend = Literal["auto", "cpu", "gpu"]
_RigFormat = Literal["autoware", "urdf", "sdf", "ros2-launch", "carla", "carla-objects", "tf", "pandaset", "json"]

class _Mesh(TypedDict):
    vertices: F32
    faces: U32
    class_ids: U16

class _BeamHits(TypedDict):
    t_hit: F32
    primitive_ids: I64
    class_ids: I64
    origin: F32
    direction: F32
    placement: I64
    lidar: I64

class _RayHits(TypedDict):
    t_hit: F32
    primitive_ids: I64
    #: Where triangles have classes.
    class_ids: I64
    #: With `normals`.
    normals: NotRequired[F32]
    #: With `uvs`.
    uvs: NotRequired[F32]

@final
class Atlas:
    @property
    def poses(self) -> F64: ...
    @property
    def size_bytes(self) -> int: ...
    def score(self, index: npt.ArrayLike) -> dict[str, F64]: ...
    def __len__(self) -> int: ...

@final
class Placement:
    def __new__(
        cls,
        poses: npt.ArrayLike,
        *,
        name: str = "placement",
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        rides_on: Sequence[str] | None = None,
    ) -> Placement: ...
    @property
    def name(self) -> str: ...
    @property
    def poses(self) -> F64: ...
    @property
    def sensors(self) -> list[str]: ...
    @property
    def phases(self) -> F64: ...
    @property
    def rides_on(self) -> list[str]: ...
    def to_dict(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

class DoubtWarning(UserWarning): ...

@final
class Search:
    def __new__(cls, space: Space, *, seed: int = 1, population: int | None = None) -> Search: ...
    def ask(self) -> F64: ...
    def ask_placements(self) -> list[Placement]: ...
    def tell(self, values: npt.ArrayLike) -> None: ...
    def result(self) -> tuple[Placement, float] | None: ...
    @property
    def told(self) -> int: ...

@final
class Sensor:
    @staticmethod
    def load(path: _Path, *, range: float | None = None, azimuth_steps: int | None = None) -> Sensor: ...
    @staticmethod
    def from_dict(lidar: Mapping[str, Any], *, folder: _Path | None = None) -> Sensor: ...
    @property
    def directions(self) -> F32: ...
    @property
    def range(self) -> float: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Vehicle:
    @staticmethod
    def load(path: _Path) -> Vehicle: ...
    @property
    def path(self) -> PathLike[str]: ...
    @property
    def name(self) -> str: ...
    @property
    def sensors(self) -> dict[str, Sensor]: ...
    @property
    def prices(self) -> dict[str, float]: ...
    @property
    def mounts(self) -> list[dict[str, Any]]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Psog:
    def __new__(
        cls,
        *,
        index: npt.ArrayLike,
        counts: npt.ArrayLike,
        frames: int,
        classes: Sequence[str],
        roi_min: Sequence[float] | F64,
        voxel: Sequence[float] | F64,
        shape: Sequence[int],
    ) -> Psog: ...
    @staticmethod
    def load(path: _Path) -> Psog: ...
    def save(self, path: _Path) -> None: ...
    @staticmethod
    def from_scans(
        points: Sequence[npt.ArrayLike],
        labels: Sequence[npt.ArrayLike],
        poses: Sequence[npt.ArrayLike],
        *,
        classes: Sequence[str],
        roi: Sequence[Sequence[float]],
        voxel: Sequence[float],
        window: int | None = None,
        moving: Sequence[str] | None = None,
    ) -> Psog: ...
    @property
    def index(self) -> npt.NDArray[np.uint64]: ...
    @property
    def counts(self) -> U16: ...
    @property
    def frames(self) -> int: ...
    @property
    def classes(self) -> list[str]: ...
    @property
    def roi_min(self) -> F64: ...
    @property
    def voxel(self) -> F64: ...
    @property
    def shape(self) -> tuple[int, int, int]: ...
    def entropy(self) -> F64: ...
    def merge(self, other: Psog) -> Psog: ...
    def info(self) -> dict[str, Any]: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Raycaster:
    def __new__(
        cls,
        vertices: npt.ArrayLike,
        faces: npt.ArrayLike,
        *,
        class_ids: npt.ArrayLike | None = None,
        reach: float | None = None,
    ) -> Raycaster: ...
    def cast_rays(
        self, rays: npt.ArrayLike, *, t_max: float | None = None, normals: bool = False, uvs: bool = False
    ) -> _RayHits: ...
    def occluded(self, rays: npt.ArrayLike, *, t_max: float | None = None) -> npt.NDArray[np.bool_]: ...
    def count(self, rays: npt.ArrayLike, *, t_max: float | None = None) -> I64: ...
    def __len__(self) -> int: ...

@final
class Rig:
    @staticmethod
    def from_carla(
        sensors: list[dict[str, Any]] | tuple[dict[str, Any], ...],
        *,
        name: str | None = None,
        models: dict[str, str] | None = None,
        base_link: Sequence[float] | F64 | None = None,
    ) -> Rig: ...
    @staticmethod
    def load(
        path: _Path,
        *,
        format: _RigFormat | None = None,
        name: str | None = None,
        frames: Sequence[str] | None = None,
        models: dict[str, str] | None = None,
        base_link: Sequence[float] | F64 | None = None,
        base_frame: str | None = None,
    ) -> Rig: ...
    @property
    def name(self) -> str: ...
    @property
    def frames(self) -> list[str]: ...
    @property
    def poses(self) -> F64: ...
    @property
    def sensors(self) -> list[str | None]: ...
    @property
    def left_out(self) -> list[str]: ...
    @property
    def notes(self) -> list[str]: ...
    def placement(self, name: str | None = None) -> Placement: ...
    def save(self, path: _Path) -> None: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class ScanIterator:
    def __iter__(self) -> Iterator[Scan]: ...
    def __next__(self) -> Scan: ...

@final
class Scene:
    @staticmethod
    def load(
        path: _Path,
        *,
        vehicle: _Path | Vehicle | None = None,
        psog: Psog | None = None,
        frames: int | None = None,
        conditions: Sequence[str] | None = None,
        backend: _Backend = "auto",
        adapter: str | None = None,
        memory: int | None = None,
    ) -> Scene: ...
    @staticmethod
    def from_dict(
        scene: Mapping[str, Any],
        *,
        folder: _Path | None = None,
        psog: Psog | None = None,
        frames: int | None = None,
        conditions: Sequence[str] | None = None,
        backend: _Backend = "auto",
        adapter: str | None = None,
        memory: int | None = None,
    ) -> Scene: ...
    @property
    def name(self) -> str: ...
    @property
    def classes(self) -> list[str]: ...
    @property
    def frames(self) -> int: ...
    @property
    def scored_frames(self) -> list[int]: ...
    @property
    def rate(self) -> float: ...
    @property
    def has_geometry(self) -> bool: ...
    @property
    def files(self) -> list[PathLike[str]]: ...
    @property
    def notes(self) -> list[str]: ...
    @property
    def sensors(self) -> dict[str, Sensor]: ...
    @property
    def psog(self) -> Psog: ...
    def world_from_ego(self, frame: int) -> F64: ...
    def mesh(self, frame: int = 0, *, body: bool = True) -> _Mesh: ...
    def score(
        self,
        poses: _Poses,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        self_hits: bool | None = None,
        near_field: bool = False,
        tolerance: str | None = "5mm,0.5deg",
        progress: _Progress = None,
    ) -> Scores: ...
    def range_card(
        self,
        poses: _Poses,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> dict[str, Any] | None: ...
    def beams_on(
        self,
        poses: _Poses,
        targets: Sequence[_Path],
        distances: npt.ArrayLike,
        bearings: npt.ArrayLike,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> npt.NDArray[np.uint32]: ...
    def redundancy(
        self,
        poses: _Poses,
        *,
        targets: Sequence[_Path] | None = None,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> dict[str, Any]: ...
    def near_field(
        self,
        poses: _Poses,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> dict[str, Any]: ...
    def detections(
        self,
        poses: _Poses,
        targets: Sequence[_Path],
        distances: npt.ArrayLike,
        bearings: npt.ArrayLike,
        *,
        beams: int = 5,
        of_frames: int | None = None,
        level: bool = False,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> dict[str, Any]: ...
    def losses(
        self,
        poses: _Poses,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        progress: _Progress = None,
    ) -> dict[str, Any]: ...
    def overlap(
        self,
        poses: _Poses,
        *,
        least_shared: int = 500,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> dict[str, Any]: ...
    def sweep(
        self,
        poses: _Poses,
        of: str,
        values: npt.ArrayLike,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        progress: _Progress = None,
    ) -> dict[str, Any]: ...
    def tolerance(
        self,
        poses: _Poses,
        *,
        most_mm: float = 100.0,
        most_deg: float = 5.0,
        most_tilt_deg: float = 3.0,
        tilt_about: tuple[float, float] | None = None,
        steps: int = 10,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        progress: _Progress = None,
    ) -> dict[str, Any]: ...
    def covered(
        self,
        poses: _Poses,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> npt.NDArray[np.uint64]: ...
    def cast(
        self,
        poses: _Poses,
        *,
        frame: int = 0,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
    ) -> _BeamHits: ...
    def cast_rays(
        self,
        rays: npt.ArrayLike,
        *,
        frame: int = 0,
        t_max: float | None = None,
        normals: bool = False,
        uvs: bool = False,
    ) -> _RayHits: ...
    def raycaster(self, frame: int = 0) -> Raycaster: ...
    def scan(
        self,
        poses: _Poses,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        conditions: Sequence[str] | None = None,
        ideal: bool = False,
        seed: int = 1,
        frames: int | Sequence[int] | None = None,
        misses: bool = False,
    ) -> ScanIterator: ...
    def to_rerun(
        self, placements: Placement | Sequence[Placement], path: _Path, **options: Any
    ) -> None: ...
    def to_mcap(
        self, placements: Placement | Sequence[Placement], path: _Path, **options: Any
    ) -> None: ...
    def verify(
        self,
        poses: _Poses | None = None,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        frames: int = 1,
        random: int = 200,
        hostile: int = 50,
        sample: int = 20_000,
        seed: int = 1,
        progress: _Progress = None,
    ) -> dict[str, Any]: ...
    def atlas(self, poses: npt.ArrayLike, *, sensors: Sequence[str] | None = None) -> Atlas: ...
    def space(self, equipment: Sequence[tuple[str, str]] | None = None) -> Space: ...
    def random_poses(self, count: int, *, seed: int = 1) -> F64: ...
    def _inputs(self) -> list[dict[str, str]]: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Space:
    @property
    def dim(self) -> int: ...
    @property
    def lower(self) -> F64: ...
    @property
    def upper(self) -> F64: ...
    @property
    def sensors(self) -> list[str] | None: ...
    @property
    def mounts(self) -> list[str]: ...
    @property
    def rules(self) -> list[str]: ...
    def poses(self, z: npt.ArrayLike) -> F64: ...
    def placements(self, z: npt.ArrayLike) -> list[Placement]: ...
    def vector(self, poses: _Poses, *, phases: npt.ArrayLike | None = None) -> F64: ...
    def violations(self, poses: _Poses, *, phases: npt.ArrayLike | None = None) -> F64: ...
    def random(self, n: int, rng: int | np.random.Generator | None = None, *, feasible: bool = True) -> F64: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

@final
class Suite:
    def __new__(cls, scenes: Scene | Sequence[Scene]) -> Suite: ...
    @property
    def names(self) -> list[str]: ...
    def score(
        self,
        poses: _Poses,
        *,
        sensors: Sequence[str] | None = None,
        phases: npt.ArrayLike | None = None,
        tolerance: str | None = "5mm,0.5deg",
        progress: _Progress = None,
    ) -> Scores: ...
    def __len__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def main(arguments: Sequence[_Path]) -> int: ...
def set_threads(count: int) -> None: ...
def published() -> list[Placement]: ...
def read_placements(path: _Path) -> list[Placement]: ...
def _in_python(sentence: str) -> str: ...
def write_placements(placements: Placement | Sequence[Placement], path: _Path) -> None: ...
def optimize(
    scenes: Scene | Sequence[Scene],
    *,
    objective: str | Callable[[Scores], Any] = "near_gain",
    evaluations: int = 180,
    seed: int = 1,
    method: Literal["both", "cma", "swaps"] = "both",
    frames: int | Literal["all", "on-demand"] | None = None,
    population: int | None = None,
    baselines: Sequence[Placement] | None = None,
    starts: Sequence[Placement] | None = None,
    target: float | None = None,
    seconds: float | None = None,
    mirror: bool = False,
    budget: float | None = None,
    fewest: bool = False,
    tolerance: str | None = "5mm,0.5deg",
    bound: float | None = None,
    callback: Callable[[dict[str, Any]], object] | None = None,
    progress: _Progress = None,
) -> Result: ...
def front(
    scenes: Scene | Sequence[Scene],
    objectives: Sequence[str],
    *,
    evaluations: int = 40,
    seed: int = 1,
    seconds: float | None = None,
    mirror: bool = False,
    budget: float | None = None,
    tolerance: str | None = "5mm,0.5deg",
    callback: Callable[[dict[str, Any]], object] | None = None,
    progress: _Progress = None,
) -> Front: ...
def handover(
    placement: Placement | _Path,
    out: _Path,
    *,
    scene: Scene | None = None,
    vehicle: _Path | Vehicle | None = None,
    frame: int = 0,
    margin: float = 0.05,
    base_link: Sequence[float] | F64 | None = None,
) -> dict[str, Any]: ...
def study(
    kind: str,
    scenes: Scene | Sequence[Scene],
    poses: _Poses | None = None,
    *,
    sensors: Sequence[str] | None = None,
    phases: npt.ArrayLike | None = None,
    objective: str = "near_gain",
    evaluations: int = 120,
    random: int = 200,
    seed: int = 1,
    budget: float | None = None,
    conditions: Sequence[str] | None = None,
    regions: Mapping[str, Sequence[float]] | None = None,
    sensor_files: Sequence[_Path] | None = None,
    voxel: float = 0.1,
    progress: _Progress = None,
) -> dict[str, Any]: ...
