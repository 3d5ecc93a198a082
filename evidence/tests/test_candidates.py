"""Candidates against the engine and a slow second reading; searches against trying everything."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="scikit-learn is not installed")
pytest.importorskip("scipy", reason="SciPy is not installed")
import sightline
from sightline_evidence import candidates, layouts, pool, scores, worlds
from sightline_evidence.candidates import CANDIDATES, Ground
from sightline_evidence.truth import Source, body_of


@pytest.fixture(scope="module")
def source(small_file: Path) -> Source:
    return Source.read(small_file)


@pytest.fixture(scope="module")
def ground(source: Source) -> Ground:
    scene = worlds.opened(source)
    (scan,) = scene.scan(layouts.published()[0].poses, ideal=True, frames=[1])
    return Ground.of(scene.psog, source.grid, body_of(scene), scan.boxes)


def at_one(source: Source) -> sightline.Scene:
    return worlds.at(source, 1, worlds.opened(source).psog)


def test_a_later_start_is_the_same_frame(source: Source) -> None:
    poses = layouts.published()[2].poses
    whole = worlds.opened(source)
    later = worlds.at(source, 2, whole.psog)
    np.testing.assert_array_equal(whole.cast(poses, frame=2)["t_hit"], later.cast(poses)["t_hit"])


def test_gain_is_that_of_the_engine(small_file: Path, source: Source, published: list[sightline.Placement]) -> None:
    world = worlds.world("small", small_file, "test", 1)
    placed = layouts.published()[:3]
    found = scores.of_world(world, placed, frames=3)
    scene = worlds.opened(source, 3)
    whole = scene.psog.entropy().sum()
    shares = []
    for frame in range(3):
        there = worlds.at(source, frame, scene.psog)
        (scan,) = there.scan(placed[0].poses, ideal=True, frames=[0])
        full = Ground.of(scene.psog, source.grid, body_of(scene), scan.boxes)
        shares.append([candidates.values(full, candidates.look(there, full, one.poses))["gain"] for one in placed])
    np.testing.assert_allclose(np.mean(shares, axis=0) * whole, found["information_gain"], rtol=1e-9)
    np.testing.assert_allclose(
        np.array(found["covered_occupied"]) * len(scene.psog), found["covered_nonzero"], rtol=1e-9
    )


def test_near_gain_of_the_engine_is_its_formula(source: Source) -> None:
    """And nearly the candidate, whose near ground is counted from the body."""
    placed = layouts.published()[:3]
    scene = worlds.opened(source, 3)
    psog, keys = scene.psog, scene.psog.index.astype(np.int64)
    plan = np.hypot(*source.grid.centres(keys)[:, :2].T)
    commonest = [psog.classes[one] for one in psog.counts.argmax(axis=1)]
    near_ground = (plan <= 10) & np.isin(commonest, ["road", "sidewalk"])
    told = psog.entropy() * np.round(80 / np.maximum(10, plan)).clip(1)
    weight = np.zeros(int(np.prod(source.grid.shape)))
    weight[keys] = (told / told.sum() + near_ground / near_ground.sum() / 4) / 1.25
    covered = [[worlds.at(source, frame, psog).covered(one.poses) for frame in range(3)] for one in placed]
    expected = [np.mean([weight[voxels].sum() for voxels in frames]) for frames in covered]
    of_engine = scene.score([sightline.Placement(one.poses) for one in placed])["near_gain"]
    np.testing.assert_allclose(of_engine, expected, rtol=1e-6)


def test_weights_are_shares_and_mean_what_they_say(ground: Ground) -> None:
    for name, weight in ground.weights.items():
        assert weight.sum() == pytest.approx(1) and weight.min() >= 0, name
    centres = ground.grid.centres(ground.keys)
    assert not ground.weights["gain_low"][centres[:, 2] >= 2.9].any()
    told = np.flatnonzero(ground.weights["gain"] > 0)
    ratio = ground.weights["gain_path"][told] / ground.weights["gain"][told]
    aside = np.abs(centres[told, 1])
    assert ratio[aside.argmin()] > ratio[aside.argmax()]


def test_points_in_boxes_are_those_of_the_actors(source: Source, ground: Ground) -> None:
    scene = at_one(source)
    poses = layouts.published()[8].poses
    seen = candidates.look(scene, ground, poses)
    (scan,) = worlds.opened(source).scan(poses, ideal=True, frames=[1])
    # By instance: ``boxes.points`` leaves out what rounding puts outside of a box's own surface.
    np.testing.assert_array_equal(seen.points, [(scan.instance == one).sum() for one in scan.boxes.instance])
    assert seen.points.max() > 20


def test_union_of_poses_is_the_placement(source: Source, ground: Ground) -> None:
    scene = at_one(source)
    poses = layouts.published()[8].poses
    whole = candidates.look(scene, ground, poses)
    each = [candidates.look(scene, ground, pose[None]) for pose in poses]
    np.testing.assert_array_equal(np.unique(np.concatenate([one.covered for one in each])), whole.covered)
    np.testing.assert_array_equal(np.unique(np.concatenate([one.hit for one in each])), whole.hit)
    np.testing.assert_array_equal(sum(one.points for one in each), whole.points)
    assert sum(one.hits for one in each) == whole.hits


def test_all_candidates_have_a_value(ground: Ground, source: Source) -> None:
    seen = candidates.look(at_one(source), ground, layouts.published()[0].poses)
    found = candidates.values(ground, seen)
    assert list(found) == list(CANDIDATES) and all(np.isfinite(list(found.values())))
    assert all(0 <= value <= 1 for name, value in found.items() if name not in candidates.SUMS)
    blind = candidates.look(at_one(source), ground, np.array([[0.0, 0, 2.5, 0, -np.pi / 2, 0]]))
    assert all(candidates.values(ground, blind)[name] < value for name, value in found.items())


def test_search_finds_the_best_pair_in_the_pool(small_file: Path, tmp_path: Path) -> None:
    """Against all pairs, by the value of the pair as one placement."""
    world = worlds.world("small", small_file, "train", 2)
    mount = world.source().described["mount"]
    poses, kinds = pool.drawn(mount, 8, 4, seed=3)
    assert np.all(poses[kinds == pool.INSIDE][:, :3] >= np.array(mount["min"]) - 1e-4)
    assert np.all((poses[kinds == pool.LOW][:, 2] >= 0.6) & (poses[kinds == pool.LOW][:, 2] <= 1.0))
    pool.cast(world, poses, tmp_path)
    for name in ("gain", "distinct_voxels", "near_field", "actors_5", "blend", "near_and_ground", "near_and_field"):
        totals = pool.objective(name, ["small"], tmp_path)
        allowed = [np.ones(len(poses), bool)] * 2
        _, found = pool.search(totals, poses, allowed, 0.0)
        pairs = [totals([a])[b] for a, b in itertools.combinations(range(len(poses)), 2)]
        assert found <= max(pairs) + 1e-9
        assert found >= np.sort(pairs)[-3] - 1e-9, name


def test_search_keeps_the_distance(small_file: Path) -> None:
    poses = np.array([[0.0, 0, z, 0, 0, 0] for z in (2.2, 2.25, 2.5)])
    chosen, _ = pool.search(lambda rest: np.array([3.0, 2.0, 1.0]), poses, [np.ones(3, bool)] * 2, 0.2)
    assert chosen == [0, 2]
    with pytest.raises(ValueError, match="draw more poses"):
        pool.search(lambda rest: np.zeros(3), poses, [np.array([True, True, False])] * 2, 0.2)
