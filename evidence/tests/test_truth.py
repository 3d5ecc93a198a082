"""Targets: where surfaces are, what a dense rig may see, and that a cache cannot be stale."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn")
from sightline_evidence.groups import GROUPS, groups_of
from sightline_evidence.truth import DENSE, KINDS, VISIBLE, Source, cached, points_on, rig, truth_of


def test_surfaces_are_where_they_were_put(small_file: Path) -> None:
    source = Source.read(small_file)
    (found,) = truth_of(source, [0])
    centres = source.grid.centres(found.keys)
    road = centres[found.labels == GROUPS.index("road")]
    assert len(road) > 1500 and np.all(np.abs(road[:, 1]) < 4.2) and np.all(np.abs(road[:, 2]) < 0.4)
    wall = centres[found.labels == GROUPS.index("building")]
    assert len(wall) > 300 and np.all(wall[:, 1] > 8.8)
    assert np.all(np.diff(found.keys) > 0) and found.labels.min() >= 1
    # The own body blocks and is no target.
    inside = np.all(np.abs(centres[:, :2]) < [1.9, 0.8], axis=1) & (centres[:, 2] > 0.4)
    assert not np.any(found.labels[inside] == GROUPS.index("vehicle"))
    np.testing.assert_allclose(found.body, [-2, -0.9, 2, 0.9], atol=1e-6)


def test_boxes_and_who_can_be_seen(small_file: Path) -> None:
    first, last = truth_of(Source.read(small_file), [0, 2])
    assert [KINDS[kind] for kind in first.kind] == ["vehicle", "pedestrian", "vehicle"]
    np.testing.assert_allclose(first.centre[0, :2], [9, 0], atol=1e-6)
    np.testing.assert_allclose(last.centre[0, :2], [9, 0], atol=1e-6)  # drives as fast as the ego
    np.testing.assert_allclose(first.size[0], [4, 1.8, 1.5], atol=1e-6)
    assert list(first.points >= VISIBLE) == [True, True, False]


def test_every_point_on_an_object_counts(small_file: Path) -> None:
    source = Source.read(small_file)
    scene = source.open(lidar=DENSE)
    poses = rig(source.described["mount"], np.array([-2, -0.9, 2, 0.9]))
    (scan,) = scene.scan(poses, ideal=True, frames=[0])
    here = scan.boxes.instance.astype(np.int64)
    counts = points_on(scan, here)
    for kind, name in (("pedestrian", "pedestrian"), ("car", "vehicle")):
        of_kind = np.array([one == kind for one in scan.boxes.kinds])
        met = (scan.class_id == scan.classes.index(name)) & (scan.instance != 65535)
        assert counts[of_kind].sum() == met.sum() > 50
    # A box has a margin, so that it holds its own points and a few of the ground under it.
    assert np.all(counts <= scan.boxes.points) and scan.boxes.points.sum() < 1.01 * counts.sum()


def test_cache_is_the_same_and_mends_itself(small_file: Path, tmp_path: Path) -> None:
    source = Source.read(small_file)
    (made,) = cached(source, source.digest(), [1], tmp_path)
    (file,) = tmp_path.iterdir()
    (read,) = cached(source, source.digest(), [1], tmp_path)
    for name, value in vars(made).items():
        np.testing.assert_array_equal(value, getattr(read, name))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    (mended,) = cached(source, source.digest(), [1], tmp_path)
    np.testing.assert_array_equal(mended.keys, made.keys)
    assert len(list(tmp_path.iterdir())) == 1


def test_another_scene_is_another_entry(small_file: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    described = json.loads(small_file.read_text())
    described["static"].pop()
    other.write_text(json.dumps(described))
    same = tmp_path / "same.json"
    shutil.copy(small_file, same)
    digests = [Source.read(path).digest() for path in (small_file, other, same)]
    assert digests[0] != digests[1] and digests[0] == digests[2]


def test_every_class_has_a_group() -> None:
    classes = ["road", "vehicle", "crane"]
    found = groups_of(classes, np.array([0, 1, 2, 65535], np.uint16))
    assert [GROUPS[group] for group in found] == ["road", "vehicle", "other", "unseen"]
