"""Scans for PyTorch, made while a network is trained: ``pip install 'sightline-lidar[torch]'``.

>>> from sightline.torch import ScanDataset, collate                            # doctest: +SKIP
>>> scans = ScanDataset(scene, scene.random_poses(100))                         # doctest: +SKIP
>>> DataLoader(scans, batch_size=4, shuffle=True, num_workers=2, collate_fn=collate)  # doctest: +SKIP

Workers may be started by ``spawn`` or by ``fork``; a scene on a GPU takes ``spawn``. An item is the same in every
worker and in every epoch.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._extra import missing

try:
    import torch
    from torch.nn.utils.rnn import pad_sequence
    from torch.utils.data import Dataset
except ImportError as _error:
    raise missing("PyTorch", "torch") from _error

from . import Placement, Scan, Scene
from ._records import COLUMNS

__all__ = ["Item", "ScanDataset", "collate"]

#: ``points`` float32 ``[P, C]``; ``labels``, ``placement`` and ``frame`` int64: ``[P]``, ``[]``, ``[]``.
Item = dict[str, torch.Tensor]


class ScanDataset(Dataset[Item]):
    """Labelled scans of N placements in F frames of a scene; item ``n * F + f`` is placement n in ``frames[f]``.

    ``columns`` are fields of :class:`Scan`, side by side in ``points``. Points of no class, such as fog, have the label
    ``ignore``. ``conditions`` and ``ideal`` are those of :meth:`Scene.scan`; its seed is ``seed + n``. Raises ``ValueError``
    for wrong arguments.
    """

    def __init__(
        self,
        scene: Scene,
        placements: Sequence[Placement] | npt.ArrayLike,
        *,
        frames: Sequence[int] | None = None,
        columns: Sequence[str] = ("xyz", "intensity", "range"),
        ignore: int = -1,
        conditions: Sequence[str] | None = None,
        ideal: bool = False,
        seed: int = 1,
    ) -> None:
        self.scene, self.columns, self.ignore, self.seed = scene, tuple(columns), ignore, seed
        self.placements: Sequence[Any] | npt.NDArray[Any] = (
            placements if isinstance(placements, Sequence) else np.asarray(placements)
        )
        if isinstance(self.placements, np.ndarray) and self.placements.ndim != 3:
            raise ValueError("placements: are no list; give several placements, or poses [N, L, 6]")
        self.frames = range(scene.frames) if frames is None else list(frames)
        self.options: dict[str, Any] = {"conditions": conditions, "ideal": ideal}
        unknown = [name for name in self.columns if name not in COLUMNS]
        if unknown or not self.columns:
            raise ValueError(f"columns: {unknown} are no columns of a scan; give some of {', '.join(COLUMNS)}")

    def __len__(self) -> int:
        return len(self.placements) * len(self.frames)

    def scan(self, item: int) -> Scan:
        """The scan of an item."""
        if not -len(self) <= item < len(self):
            raise IndexError(f"item {item} of {len(self)} scans")
        n, f = divmod(item % len(self), len(self.frames))
        scans = self.scene.scan(self.placements[n], frames=[self.frames[f]], seed=self.seed + n, **self.options)
        return next(scans)

    def __getitem__(self, item: int) -> Item:
        scan = self.scan(item)
        columns = [np.asarray(getattr(scan, name), np.float32).reshape(len(scan), -1) for name in self.columns]
        return {
            "points": torch.from_numpy(np.concatenate(columns, axis=1)),
            "labels": torch.from_numpy(scan.labels(self.ignore)),
            "placement": torch.tensor(item % len(self) // len(self.frames)),
            "frame": torch.tensor(scan.frame),
        }


def collate(items: Sequence[Item], *, pad: bool = False, ignore: int = -1) -> Item:
    """A batch of B items; ``placement`` and ``frame`` are ``[B]``.

    One after the other, ``points`` ``[P, C]`` and ``labels`` ``[P]`` of all, with ``batch`` ``[P]``, the item of each point.
    With ``pad``, ``points`` ``[B, P, C]`` and ``labels`` ``[B, P]``, zeros and ``ignore`` behind the points of an item, with
    ``mask`` ``[B, P]``, true for points.
    """
    points, labels = [item["points"] for item in items], [item["labels"] for item in items]
    sizes = torch.tensor([len(each) for each in points])
    batch = {key: torch.stack([item[key] for item in items]) for key in ("placement", "frame")}
    if pad:
        batch["points"] = pad_sequence(points, batch_first=True)
        batch["labels"] = pad_sequence(labels, batch_first=True, padding_value=ignore)
        batch["mask"] = torch.arange(batch["points"].shape[1]) < sizes[:, None]
    else:
        batch["points"], batch["labels"] = torch.cat(points), torch.cat(labels)
        batch["batch"] = torch.repeat_interleave(torch.arange(len(items)), sizes)
    return batch
