"""The region as voxels, numbered as the engine numbers them: (i · ny + j) · nz + k."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._types import F64, I64, U8, Floats


@dataclass(frozen=True)
class Grid:
    """Voxels ``[nx, ny, nz]`` of a region in the ego frame; metres."""

    low: tuple[float, float, float]
    voxel: tuple[float, float, float]
    shape: tuple[int, int, int]

    @staticmethod
    def of(roi: Mapping[str, Any]) -> Grid:
        """From a scene file's ``roi``: extents are whole numbers of voxels to one part in a million, else rounded up."""
        counts = [(high - low) / edge for low, high, edge in zip(roi["min"], roi["max"], roi["voxel"])]
        whole = [round(n) if abs(n - round(n)) <= 1e-6 * n else math.ceil(n) for n in counts]
        low, voxel = (tuple(map(float, roi[key])) for key in ("min", "voxel"))
        return Grid(low, voxel, tuple(whole))  # type: ignore[arg-type]

    def keys(self, xyz: Floats) -> I64:
        """Linear index ``[P]`` of the voxel of each point ``[P, 3]``; −1 outside."""
        cell = np.floor((xyz - np.array(self.low)) / np.array(self.voxel)).astype(np.int64)
        inside = np.all((cell >= 0) & (cell < np.array(self.shape)), axis=1)
        linear = (cell[:, 0] * self.shape[1] + cell[:, 1]) * self.shape[2] + cell[:, 2]
        return np.where(inside, linear, -1)

    def centres(self, keys: I64) -> F64:
        """Middles ``[V, 3]`` of voxels ``[V]``; metres."""
        cell = np.stack(np.unravel_index(keys, self.shape), axis=1)
        middles: F64 = np.array(self.low) + (cell + 0.5) * np.array(self.voxel)
        return middles


def majority(keys: I64, labels: U8, classes: int) -> tuple[I64, U8]:
    """Distinct keys, rising, with the label that most of their points have; of equal counts the lowest label.

    Keys below 0 (outside) and labels 0 (nothing) have no vote.
    """
    votes = (keys >= 0) & (labels > 0)
    ballots, counts = np.unique(keys[votes] * classes + labels[votes], return_counts=True)
    key, label = ballots // classes, ballots % classes
    order = np.lexsort((label, -counts, key))
    found, first = np.unique(key[order], return_index=True)
    return found, label[order][first].astype(np.uint8)
