"""Trains a network that tells the classes of points from scans that are cast while it trains: python train.py SCENE.json"""

import sys

import torch
from torch.utils.data import DataLoader, IterableDataset

import sightline


class Scans(IterableDataset):
    """Points `[P, 5]` (x, y, z, intensity, range) and classes `[P]` of fresh random placements."""

    def __init__(self, path: str, seed: int) -> None:
        self.scene, self.seed = sightline.Scene.load(path, backend="cpu"), seed

    def __iter__(self):
        for number, poses in enumerate(self.scene.random_poses(1000, seed=self.seed)):
            for scan in self.scene.scan(poses, seed=number, frames=[number % self.scene.frames]):
                known = torch.from_numpy(scan.labels(ignore=-1))
                columns = (scan.xyz, scan.intensity[:, None], scan.range[:, None])
                yield torch.cat([torch.from_numpy(column) for column in columns], 1), known


scans = Scans(sys.argv[1], seed=1)
classes = len(scans.scene.classes)
network = torch.nn.Sequential(
    torch.nn.BatchNorm1d(5), torch.nn.Linear(5, 64), torch.nn.ReLU(), torch.nn.Linear(64, 64),
    torch.nn.ReLU(), torch.nn.Linear(64, classes),
)  # fmt: skip
optimizer = torch.optim.Adam(network.parameters(), lr=3e-3)
losses = []
for step, (points, labels) in enumerate(DataLoader(scans, batch_size=None)):
    # Fog, snow and crosstalk have no class.
    loss = torch.nn.functional.cross_entropy(network(points), labels, ignore_index=-1)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    losses.append(loss.item())
    if step == 120:
        break
print(f"loss {losses[0]:.2f} → {sum(losses[-10:]) / 10:.2f} over {len(losses)} scans")
assert sum(losses[-10:]) / 10 < 0.6 * losses[0], "nothing was learnt"
