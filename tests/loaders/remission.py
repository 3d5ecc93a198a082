"""Holds the intensity of scans against the cosine of incidence, beside the remission of SemanticKITTI's scans.

    remission.py OURS KITTI [FIGURE.svg]

OURS: a folder of `sightline scan --layout npz`; KITTI: a folder of sequences with `velodyne` and `labels`. Our cosines
are told by the scan, theirs are those of planes through neighbouring points. Needs numpy, scipy.
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
COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#17becf", "#7f7f7f", "#bcbd22", "#e377c2")


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
    """Of all points, and of those in each bin of the cosine."""
    intensity, planes, told = rows
    cosine = np.where(np.isnan(told), planes, told)
    bins = [intensity[(cosine >= low) & (cosine < high + (high == 1))] for low, high in zip(EDGES, EDGES[1:])]
    return [np.median(of) if len(of) >= FEWEST else np.nan for of in [intensity, *bins]]


def draw(file, found):
    """Median intensity against the cosine, a panel for ours and one for theirs."""
    middle = [(low + high) / 2 for low, high in zip(EDGES, EDGES[1:])]
    wide, high, top = 250, 200, 0.5
    parts = ['<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 690 260" font-family="sans-serif" font-size="11">',
             '<rect width="690" height="260" fill="#fff"/>']
    for panel, (title, rows) in enumerate(found.items()):
        left, floor = 40 + 280 * panel, 225
        parts.append(f'<text x="{left + wide / 2}" y="16" text-anchor="middle">{title}</text>')
        for tick in range(6):
            y, x = floor - high * tick / 5, left + wide * tick / 5
            parts.append(f'<path d="M{left} {y:g}h{wide}" stroke="#ddd"/>')
            parts.append(f'<text x="{left - 4}" y="{y + 4:g}" text-anchor="end">{tick * top / 5:.1f}</text>')
            parts.append(f'<text x="{x:g}" y="{floor + 14}" text-anchor="middle">{tick / 5:g}</text>')
        for (name, *_), colour in zip(CLASSES, COLOURS):
            at = [(left + wide * cosine, floor - high * value / top)
                  for cosine, value in zip(middle, medians(rows[name])[1:]) if not np.isnan(value)]
            line = " ".join(f"{x:.0f},{y:.0f}" for x, y in at)
            parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
            parts += [f'<circle cx="{x:.0f}" cy="{y:.0f}" r="3" fill="{colour}"/>' for x, y in at]
    for row, ((name, *_), colour) in enumerate(zip(CLASSES, COLOURS)):
        parts.append(f'<rect x="585" y="{30 + 18 * row}" width="12" height="12" fill="{colour}"/>')
        parts.append(f'<text x="603" y="{40 + 18 * row}">{name}</text>')
    parts.append('<text x="305" y="256" text-anchor="middle">cosine of incidence; median intensity</text></svg>')
    Path(file).write_text("\n".join(parts) + "\n")


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
