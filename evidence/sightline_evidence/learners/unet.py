"""A small bird's-eye U-Net: a map of groups, and centres and boxes of vehicles, pedestrians and cyclists."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .._types import F32, I64, U8, Floats
from ..grid import Grid
from ..groups import GROUPS
from ..metrics.detection import Objects
from ..metrics.targets import birds_eye
from ..truth import KINDS, VISIBLE, Truth

try:
    import torch
    from torch import Tensor, nn
    from torch.nn import functional
except ImportError as error:
    raise ImportError(
        "the U-Net is learnt by PyTorch, which is not there; pip install torch (539 MB, with its CUDA packages "
        "some 5 GB; https://download.pytorch.org/whl/cpu has a small one for CPUs)"
    ) from error

#: Heights in metres between which points of a column are counted apart.
SLICES = (-0.5, 0.3, 0.8, 1.4, 2.0, 2.9, 5.5)

#: Channels of an image: the slices; number, lowest, highest and mean height of a column.
CHANNELS = len(SLICES) - 1 + 4

#: Numbers of a box: offset of its middle in cells (2), height of its middle, log of its edges (3), sine, cosine of yaw.
BOX = 8

#: Times in a training at which it is kept and looked at.
LOOKS = 6


@dataclass(frozen=True)
class Settings:
    """Size of the net and of its training."""

    steps: int = 2000
    width: int = 16
    rate: float = 2e-3
    #: Edge of a cell of the map in voxels.
    cell: int = 3


@dataclass(frozen=True)
class Target:
    """Truth of a frame over the cells of a coarse grid, equal for all placements."""

    #: ``[H, W]``, groups; 0 where there is no target.
    labels: U8
    #: ``[kinds, H, W]``, 1 at centres, falling around them.
    heat: F32
    #: ``[B]`` cells with a centre, and the boxes' numbers ``[B, BOX]``.
    cells: I64
    boxes: F32


@dataclass(frozen=True)
class Sample:
    """A frame as the net sees it, ``[CHANNELS, H, W]``, and what is there."""

    image: F32
    target: Target


def one_thread() -> None:
    """Maps are small: threads would wait for each other, and workers have a core each."""
    torch.set_num_threads(1)


def coarse(grid: Grid, cell: int) -> Grid:
    """The grid with columns of ``cell`` × ``cell`` voxels."""
    x, y, z = grid.shape
    edge = (grid.voxel[0] * cell, grid.voxel[1] * cell, grid.voxel[2])
    return Grid(grid.low, edge, (-(-x // cell), -(-y // cell), z))


def image(grid: Grid, xyz: Floats) -> F32:
    """Columns of points ``[P, 3]`` over the cells of a coarse grid, ``[CHANNELS, H, W]``."""
    high, wide, deep = grid.shape
    keys = grid.keys(xyz)
    column, z = keys[keys >= 0] // deep, xyz[keys >= 0, 2].astype(np.float64)
    cells = high * wide
    layer = np.clip(np.digitize(z, SLICES) - 1, 0, len(SLICES) - 2)
    slices = np.bincount(layer * cells + column, minlength=cells * (len(SLICES) - 1))
    count = np.bincount(column, minlength=cells)
    lowest, highest = np.full(cells, np.inf), np.full(cells, -np.inf)
    np.minimum.at(lowest, column, z)
    np.maximum.at(highest, column, z)
    mean = np.bincount(column, weights=z, minlength=cells) / np.maximum(count, 1)
    there = count > 0
    parts = [np.log1p(slices).reshape(-1, cells), np.log1p(count)[None]]
    parts += [np.where(there, values, 0.0)[None] for values in (lowest, highest, mean)]
    seen: F32 = np.concatenate(parts).reshape(CHANNELS, high, wide).astype(np.float32)
    return seen


def map_of(grid: Grid, truth: Truth, cell: int) -> U8:
    """Fixed groups ``[H, W]`` of a frame over cells of so many voxels."""
    small = coarse(grid, cell)
    return birds_eye(small, small.keys(grid.centres(truth.keys)), truth.labels)


def target(grid: Grid, truth: Truth, cell: int) -> Target:
    """Targets of a frame over cells of so many voxels; ``grid`` is that of the scene."""
    small, labels = coarse(grid, cell), map_of(grid, truth, cell)
    kept = truth.points >= VISIBLE
    heat = np.zeros((len(KINDS), *labels.shape), np.float32)
    middle = (truth.centre[kept, :2] - small.low[:2]) / small.voxel[:2]
    place = np.clip(np.floor(middle).astype(np.int64), 0, np.array(labels.shape) - 1)
    x, y = np.meshgrid(*(np.arange(n) for n in labels.shape), indexing="ij")
    for (i, j), kind, size in zip(place, truth.kind[kept], truth.size[kept]):
        spread = max(1.0, 0.15 * float(size[:2].max()) / small.voxel[0])
        bump = np.exp(-((x - i) ** 2 + (y - j) ** 2) / (2 * spread**2))
        heat[kind] = np.maximum(heat[kind], bump)
    yaw = truth.yaw[kept, None]
    numbers = [middle - place, truth.centre[kept, 2:], np.log(truth.size[kept]), np.sin(yaw), np.cos(yaw)]
    cells = place[:, 0] * labels.shape[1] + place[:, 1]
    return Target(labels, heat, cells, np.concatenate(numbers, axis=1).astype(np.float32))


class Net(nn.Module):
    """Three scales, two convolutions each; heads for groups, heat and boxes."""

    def __init__(self, width: int) -> None:
        super().__init__()
        sizes = [width, 2 * width, 4 * width]
        self.down = nn.ModuleList(_block(a, b) for a, b in zip([CHANNELS, *sizes], sizes))
        self.up = nn.ModuleList(_block(3 * a, a) for a in (2 * width, width))
        self.head = nn.Conv2d(width, len(GROUPS) + len(KINDS) + BOX, 1)
        # Centres are rare: begin by doubting them.
        with torch.no_grad():
            self.head.bias[len(GROUPS) : len(GROUPS) + len(KINDS)] = -4.0  # type: ignore[index]

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Groups, heat (both before their squashing) and boxes of images ``[N, C, H, W]``."""
        high, wide = images.shape[2:]
        found = functional.pad(images, (0, -wide % 4, 0, -high % 4))
        kept: list[Tensor] = []
        for number, block in enumerate(self.down):
            found = block(functional.max_pool2d(found, 2) if number else found)
            kept.append(found)
        for block, skipped in zip(self.up, reversed(kept[:-1])):
            found = block(torch.cat([functional.interpolate(found, scale_factor=2.0), skipped], dim=1))
        out = self.head(found)[:, :, :high, :wide]
        groups, heat, boxes = torch.split(out, [len(GROUPS), len(KINDS), BOX], dim=1)
        return groups, heat, boxes


def _block(a: int, b: int) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs in (a, b):
        layers += [nn.Conv2d(inputs, b, 3, padding=1), nn.GroupNorm(4, b), nn.ReLU()]
    return nn.Sequential(*layers)


@dataclass(frozen=True)
class Unet:
    """A trained net, and its loss step by step."""

    net: Net
    settings: Settings
    curve: list[float]

    @staticmethod
    def load(path: Path) -> Unet:
        """Reads the net that ``train`` kept in a file at its end."""
        try:
            kept = torch.load(path, weights_only=True)
            settings = Settings(**kept["settings"])
            net = Net(settings.width)
            net.load_state_dict(kept["net"])
        except (RuntimeError, ValueError, KeyError, TypeError, EOFError, pickle.UnpicklingError) as error:
            raise ValueError(f"{path}: is no learner of this package ({error}); train one anew") from error
        if kept["step"] < settings.steps:
            raise ValueError(f"{path}: its training ended at step {kept['step']} of {settings.steps}; let it go on")
        return Unet(net, settings, kept["curve"])

    def groups(self, seen: F32) -> U8:
        """The map of groups ``[H, W]`` of an image."""
        with torch.no_grad():
            found = self.net(torch.from_numpy(seen)[None])[0][0, 1:].argmax(dim=0)
        named: U8 = (found + 1).numpy().astype(np.uint8)
        return named

    def predict(self, grid: Grid, seen: F32, most: int = 100) -> tuple[U8, F32, Objects]:
        """Map of groups ``[H, W]``, how sure it is ``[H, W]``, and at most so many objects; ``grid`` is the coarse one."""
        with torch.no_grad():
            groups, heat, boxes = self.net(torch.from_numpy(seen)[None])
            likely = groups[0, 1:].softmax(dim=0)
            sure, best = likely.max(dim=0)
            peaks = heat.sigmoid()
            peaks = torch.where(functional.max_pool2d(peaks, 3, 1, 1) == peaks, peaks, 0.0)[0]
            scores, order = peaks.flatten().topk(min(most, peaks.numel()))
        kind, cell = np.divmod(order.numpy(), seen.shape[1] * seen.shape[2])
        numbers = boxes[0].reshape(BOX, -1).numpy()[:, cell].astype(np.float64)
        place = np.stack(np.divmod(cell, seen.shape[2])) + numbers[:2]
        xy = place.T * grid.voxel[:2] + grid.low[:2]
        objects = Objects(
            np.c_[xy, numbers[2]],
            np.exp(np.clip(numbers[3:6], -3, 4)).T,
            np.arctan2(numbers[6], numbers[7]),
            [KINDS[k] for k in kind],
            scores.numpy().astype(np.float64),
        )
        return (best + 1).numpy().astype(np.uint8), sure.numpy(), objects


def train(
    at: Callable[[int], Sample],
    seed: int,
    settings: Settings,
    file: Path | None = None,
    look: Callable[[int, Unet], None] = lambda step, unet: None,
) -> Unet:
    """Learns from ``at(step)``, one sample a step, with the rate falling to 0; the same bits for the same seed.

    ``LOOKS`` times it is kept in ``file``, from which a training that was cut off goes on, and handed to ``look``.
    """
    torch.manual_seed(seed)
    net = Net(settings.width)
    optimizer = torch.optim.AdamW(net.parameters(), settings.rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, settings.rate, total_steps=settings.steps + 1)
    parts = {"net": net, "optimizer": optimizer, "schedule": schedule}
    unet, begin = Unet(net, settings, []), _resumed(file, parts, settings)
    unet.curve.extend(begin)
    for step in range(len(begin), settings.steps):
        optimizer.zero_grad()
        loss = _loss(net, at(step))
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        schedule.step()
        unet.curve.append(float(loss.detach()))
        if (step + 1) % max(settings.steps // LOOKS, 1) == 0 or step + 1 == settings.steps:
            if file:
                _keep(file, parts, settings, unet.curve)
            look(step + 1, unet)
    return unet


def _keep(file: Path, parts: dict[str, Any], settings: Settings, curve: list[float]) -> None:
    kept = {name: part.state_dict() for name, part in parts.items()}
    beside = file.with_name(f"{file.name}.{os.getpid()}.tmp")
    torch.save({**kept, "settings": asdict(settings), "step": len(curve), "curve": curve}, beside)
    os.replace(beside, file)


def _resumed(file: Path | None, parts: dict[str, Any], settings: Settings) -> list[float]:
    """Puts a training back to where it was kept; its losses until there."""
    if file is None or not file.exists():
        return []
    kept = torch.load(file, weights_only=True)
    if kept["settings"] != asdict(settings):
        raise ValueError(f"{file}: was trained with {kept['settings']}, now it is {asdict(settings)}; give another --out")
    for name, part in parts.items():
        part.load_state_dict(kept[name])
    curve: list[float] = kept["curve"]
    return curve


def _loss(net: Net, given: Sample) -> Tensor:
    groups, heat, boxes = net(torch.from_numpy(given.image)[None])
    labels = torch.from_numpy(given.target.labels.astype(np.int64))[None]
    # Rare groups weigh more, as for trees: by one over the square root of their number.
    count = np.bincount(given.target.labels.ravel(), minlength=len(GROUPS))
    count[0] = 0
    weight = torch.from_numpy(np.where(count > 0, 1 / np.sqrt(np.maximum(count, 1)), 0.0).astype(np.float32))
    loss = functional.cross_entropy(groups, labels, weight, ignore_index=0) if count.any() else groups.sum() * 0
    # Focal loss of centres (Zhou 2019): near misses count little.
    wanted, found = torch.from_numpy(given.target.heat)[None], heat.sigmoid().clamp(1e-4, 1 - 1e-4)
    centre = wanted > 0.999
    hit = -torch.log(found) * (1 - found) ** 2 * centre
    miss = -torch.log(1 - found) * found**2 * (1 - wanted) ** 4 * ~centre
    loss = loss + (hit + miss).sum() / max(len(given.target.cells), 1)
    if len(given.target.cells):
        there = boxes[0].reshape(BOX, -1)[:, torch.from_numpy(given.target.cells)].T
        loss = loss + functional.l1_loss(there, torch.from_numpy(given.target.boxes))
    total: Tensor = loss
    return total
