"""Scans as files of points and as objects of viewers."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._extra import load
from ._records import COLUMNS

if TYPE_CHECKING:
    from ._records import Scan

#: Columns beside x, y, z. ``raw`` is left out.
_NAMES = [name for name in COLUMNS if name not in ("xyz", "raw")]
#: Types of PLY by NumPy's. Readers such as Open3D skip ``ushort`` and ``uint``.
_PLY = {"f4": "float", "i4": "int", "u1": "uchar"}


def table(scan: Scan, widened: bool = False) -> npt.NDArray[Any]:
    """Columns of a scan as one array of records, little-endian and packed: ``x``, ``y``, ``z``, ``range``, …

    With ``widened``, whole numbers of two and four bytes are ``i4``.
    """
    columns = dict(zip("xyz", scan.xyz.T)) | {name: getattr(scan, name) for name in _NAMES}
    kinds = [column.dtype.newbyteorder("<") for column in columns.values()]
    if widened:
        kinds = [np.dtype("<i4") if kind.kind == "u" and kind.itemsize > 1 else kind for kind in kinds]
    rows = np.empty(len(scan), np.dtype(list(zip(columns, kinds))))
    for name, column in columns.items():
        rows[name] = column
    return rows


def save(scan: Scan, path: str | os.PathLike[str]) -> None:
    """Writes binary PLY or PCD by the ending of ``path``, whole at any time."""
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".ply", ".pcd"):
        raise ValueError(f"{path}: the ending tells the format; give .ply or .pcd")
    rows = table(scan, widened=ending == ".ply")
    header = _ply(rows) if ending == ".ply" else _pcd(rows)
    with whole(path) as part:
        part.write_bytes(header.encode("ascii") + rows.tobytes())


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A file to write, which then takes the place of ``path``; nothing is left of one that fails."""
    part = path.with_name(f"{path.name}.part")
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _columns(rows: npt.NDArray[Any]) -> list[tuple[str, str]]:
    """Name and type of each column, as ``f4``."""
    return [(name, rows.dtype[name].str.lstrip("<|")) for name in rows.dtype.names or ()]


def _ply(rows: npt.NDArray[Any]) -> str:
    properties = [f"property {_PLY[kind]} {name}" for name, kind in _columns(rows)]
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}", *properties, "end_header"]
    return "\n".join(lines) + "\n"


def _pcd(rows: npt.NDArray[Any]) -> str:
    names, kinds = zip(*_columns(rows))
    lines = [
        "VERSION 0.7",
        f"FIELDS {' '.join(names)}",
        f"SIZE {' '.join(kind[1:] for kind in kinds)}",
        f"TYPE {' '.join(kind[0].upper() for kind in kinds)}",
        f"COUNT {' '.join('1' for _ in kinds)}",
        f"WIDTH {len(rows)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(rows)}",
        "DATA binary",
    ]
    return "\n".join(lines) + "\n"


def to_open3d(scan: Scan) -> Any:
    """An ``open3d.t.geometry.PointCloud``."""
    open3d = load("open3d", "open3d")
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(np.ascontiguousarray(scan.xyz)))
    for name in _NAMES:
        cloud.point[name] = open3d.core.Tensor(np.ascontiguousarray(getattr(scan, name)[:, None]))
    return cloud


def to_pyvista(scan: Scan) -> Any:
    """A ``pyvista.PolyData``."""
    pyvista = load("pyvista", "pyvista")
    cloud = pyvista.PolyData(np.array(scan.xyz))
    for name in _NAMES:
        cloud.point_data[name] = getattr(scan, name)
    return cloud
