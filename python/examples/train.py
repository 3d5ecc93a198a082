"""Trains a network that tells the classes of points from scans that are cast while it trains: python train.py SCENE.json"""

import sys

import torch
from torch.utils.data import DataLoader

import sightline
from sightline.torch import ScanDataset, collate

scene = sightline.Scene.load(sys.argv[1], backend="cpu")
# Points `[P, 5]` (x, y, z, intensity, range) and classes `[P]` of random placements.
scans = ScanDataset(scene, scene.random_poses(1000))
classes = len(scene.classes)
network = torch.nn.Sequential(
    torch.nn.BatchNorm1d(5), torch.nn.Linear(5, 64), torch.nn.ReLU(), torch.nn.Linear(64, 64),
    torch.nn.ReLU(), torch.nn.Linear(64, classes),
)  # fmt: skip
optimizer = torch.optim.Adam(network.parameters(), lr=3e-3)
losses = []
torch.manual_seed(1)
for step, batch in enumerate(DataLoader(scans, batch_size=1, shuffle=True, collate_fn=collate)):
    # Fog, snow and crosstalk have no class.
    loss = torch.nn.functional.cross_entropy(network(batch["points"]), batch["labels"], ignore_index=-1)
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()
    losses.append(loss.item())
    if step == 120:
        break
print(f"loss {losses[0]:.2f} → {sum(losses[-10:]) / 10:.2f} over {len(losses)} scans")
assert sum(losses[-10:]) / 10 < 0.6 * losses[0], "nothing was learnt"
