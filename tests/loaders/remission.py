"""Holds the intensity of scans against the cosine of incidence, beside the remission of SemanticKITTI's scans.

    remission.py OURS KITTI [FIGURE.svg]

OURS: a folder of `sightline scan --layout npz`; KITTI: a folder of sequences with `velodyne` and `labels`. Our cosines
are told by the scan, theirs are those of planes through neighbouring points. Needs numpy, scipy; the
figure needs matplotlib.
"""

import json
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

# Name, ids of SemanticKITTI, classes of ours.
CLASSES = [
    ("road", (40,), ("road",)),
    ("lane marking", (60,), ("road_line",)),
    ("sidewalk", (48,), ("sidewalk",)),
    ("terrain", (72,), ("terrain", "ground")),
    ("building", (50,), ("building",)),
    ("fence, wall", (51,), ("fence", "wall")),
    ("vegetation", (70,), ("vegetation",)),
    ("car", (10, 252), ("vehicle",)),
    ("pole", (80,), ("pole",)),
    ("person", (30, 254), ("pedestrian",)),
]
NEAR, FAR = 5.0, 20.0
EDGES = (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0)
FEWEST = 100


def cosines(points, of, tree):
    """Cosine of incidence of points seen from 0, NaN where the neighbours lie in no plane."""
    away, near = tree.query(points[of], 24, distance_upper_bound=1.0)
    near = np.where(np.isfinite(away), near, of[:, None])
    near = points[near] - points[of][:, None]
    _, sizes, axes = np.linalg.svd(near - near.mean(1, keepdims=True), full_matrices=False)
    at = points[of] / np.linalg.norm(points[of], axis=1, keepdims=True)
    cosine = np.abs(np.einsum("nd,nd->n", at, axes[:, 2]))
    plane = (np.isfinite(away).sum(1) >= 8) & (sizes[:, 1] > 0.15 * sizes[:, 0]) & (sizes[:, 2] < 0.2 * sizes[:, 1])
    return np.where(plane, cosine, np.nan)


def measure(scans):
    """Per class name: intensity, cosine from planes and cosine as told (NaN if nobody tells it)."""
    chance = np.random.default_rng(0)
    found = {name: [] for name, *_ in CLASSES}
    for points, intensity, told, masks in scans:
        tree = cKDTree(points)
        away = np.linalg.norm(points, axis=1)
        for name, mask in masks.items():
            of = np.flatnonzero(mask & (away > NEAR) & (away < FAR))
            of = np.sort(chance.permutation(of)[:4000])
            if len(of):
                found[name].append(np.stack([intensity[of], cosines(points, of, tree), told[of]]))
    return {name: np.concatenate(rows, 1) if rows else np.zeros((3, 0)) for name, rows in found.items()}


def ours(folder):
    """Scans of one LiDAR, in its frame."""
    about = json.loads(Path(folder, "dataset.json").read_text())
    for scene in about["scenes"]:
        for file in sorted(Path(folder, scene["name"]).glob("*.npz")):
            scan = np.load(file)
            hit = (scan["status"] == 0) & (scan["instance"] != 65535)
            points = scan["position"][hit].astype(float) - scan["ego_from_lidar"][0][:3, 3]
            names = np.array(scene["classes"])[scan["class"][hit]]
            masks = {name: np.isin(names, classes) for name, _, classes in CLASSES}
            yield points, scan["intensity"][hit], scan["incidence"][hit], masks


def kitti(folder):
    """Labelled scans."""
    for file in sorted(Path(folder).glob("*/velodyne/*.bin")):
        scan = np.fromfile(file, np.float32).reshape(-1, 4)
        labels = np.fromfile(file.parents[1] / "labels" / f"{file.stem}.label", np.uint32) & 0xFFFF
        masks = {name: np.isin(labels, ids) for name, ids, _ in CLASSES}
        yield scan[:, :3].astype(float), scan[:, 3], np.full(len(scan), np.nan), masks


def medians(rows):
    """Medians of all points, and of those in each bin of the cosine."""
    intensity, planes, told = rows
    cosine = np.where(np.isnan(told), planes, told)
    bins = [intensity[(cosine >= low) & (cosine < high + (high == 1))] for low, high in zip(EDGES, EDGES[1:])]
    return [np.median(of) if len(of) >= FEWEST else np.nan for of in [intensity, *bins]]


def draw(file, found):
    """Median intensity against the cosine, a panel for ours and one for theirs."""
    import matplotlib
    from matplotlib.figure import Figure

    middle = [(low + high) / 2 for low, high in zip(EDGES, EDGES[1:])]
    page = Figure(figsize=(8, 3), layout="constrained")
    for spot, (title, rows) in zip(page.subplots(1, 2, sharey=True), found.items()):
        for name, *_ in CLASSES:
            spot.plot(middle, medians(rows[name])[1:], "o-", markersize=3, label=name)
        spot.set(title=title, xlim=(0, 1), ylim=(0, 0.55), xlabel="cosine of incidence")
    page.axes[0].set_ylabel("median intensity")
    page.legend(*spot.get_legend_handles_labels(), loc="outside right center", fontsize=8)
    with matplotlib.rc_context({"svg.hashsalt": "sightline"}):
        page.savefig(file, metadata={"Date": None})


def main(folder, sequences, figure=None):
    found = {"sightline": measure(ours(folder)), "SemanticKITTI": measure(kitti(sequences))}
    print("ours / theirs: medians of all points and of those in bins of the cosine\n")
    print("| class | points | all | " + " | ".join(f"{a:g}–{b:g}" for a, b in zip(EDGES, EDGES[1:])) + " |")
    print("|---" * (len(EDGES) + 2) + "|")
    for name, *_ in CLASSES:
        counts = " / ".join(str(rows[name].shape[1]) for rows in found.values())
        pairs = zip(*(medians(rows[name]) for rows in found.values()))
        cells = [" / ".join("–" if np.isnan(value) else f"{value:.2f}" for value in pair) for pair in pairs]
        print(f"| {name} | {counts} | " + " | ".join(cells) + " |")
    rows = np.concatenate(list(found["sightline"].values()), 1)
    off = np.abs(rows[1] - rows[2])
    off = [np.nanquantile(off, share) for share in (0.5, 0.9)]
    print(f"\nour cosines by planes: {off[0]:.3f} (median), {off[1]:.3f} (90 %) from what is told")
    if figure:
        draw(figure, found)


if __name__ == "__main__":
    main(*sys.argv[1:])
