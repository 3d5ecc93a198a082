"""Where on this vehicle should the LiDARs go?

>>> import sightline
>>> scene = sightline.Scene.load("scenes/highway.json")
>>> scores = scene.score(sightline.read_placements("scenes/placements.json"))
>>> scores["near_gain"]                           # doctest: +SKIP
array([0.248..., 0.208..., ...])

Frame: x forward, y left, z up, origin on the ground under the vehicle's reference point. Metres, radians, nats,
seconds. A pose is ``x, y, z, roll, pitch, yaw``, with R = Rz(yaw) · Ry(pitch) · Rx(roll).

Errors are ``ValueError`` for what is wrong in arguments and files, ``OSError`` for files and devices that cannot be
used, ``MemoryError`` for work that does not fit. Sentences on files are a ``UserWarning``, likely mistakes a
``DoubtWarning``. Long work leaves the GIL to others, ends at Ctrl-C, and shows how far it is by a bar of tqdm or to the
logger ``sightline``.
"""

import importlib as _importlib
import os as _os
from typing import TYPE_CHECKING, Any as _Any

# Mesa's device selection layer looks for a display and complains where there is none.
_os.environ.setdefault("NODEVICE_SELECT", "1")

from ._native import (  # noqa: E402
    Atlas,
    DoubtWarning,
    Placement,
    Psog,
    Raycaster,
    Rig,
    ScanIterator,
    Scene,
    Search,
    Sensor,
    Space,
    Suite,
    Vehicle,
    __version__,
    front,
    handover,
    optimize,
    published,
    read_placements,
    set_threads,
    study,
    write_placements,
)
from . import examples  # noqa: E402
from ._progress import Progress  # noqa: E402
from ._records import Boxes, Front, Result, Scan, Status  # noqa: E402
from ._scores import Scores  # noqa: E402

if TYPE_CHECKING:
    from . import plot
else:

    def __getattr__(name: str) -> _Any:
        """Parts that need further packages, imported when they are first used."""
        if name in ("distributed", "plot", "torch"):
            return _importlib.import_module(f".{name}", __name__)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [
    "Atlas",
    "Boxes",
    "DoubtWarning",
    "Front",
    "Placement",
    "Progress",
    "Psog",
    "Raycaster",
    "Result",
    "Rig",
    "Scan",
    "ScanIterator",
    "Scene",
    "Scores",
    "Search",
    "Sensor",
    "Space",
    "Status",
    "Suite",
    "Vehicle",
    "__version__",
    "examples",
    "front",
    "handover",
    "optimize",
    "published",
    "read_placements",
    "set_threads",
    "study",
    "write_placements",
]
