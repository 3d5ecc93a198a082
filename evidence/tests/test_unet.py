"""The U-Net learns the small world from random rigs, maps and boxes, repeats itself, and goes on where it was cut off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="torch is not installed")
pytest.importorskip("sklearn")
from sightline_evidence import truth, worlds
from sightline_evidence.groups import GROUPS
from sightline_evidence.layouts import Layout
from sightline_evidence.learners import judge, shared, unet
from sightline_evidence.metrics.detection import Objects

unet.one_thread()
SMALL = unet.Settings(steps=200, width=8, rate=5e-3, cell=2)


@pytest.fixture(scope="module")
def lessons(small_file: Path) -> list[shared.Lesson]:
    world = worlds.world("small", small_file, "train", 3)
    return shared.lessons([(world, truth.truth_of(world.source(), world.frames))], SMALL.cell)


@pytest.fixture(scope="module")
def samples(lessons: list[shared.Lesson]) -> list[unet.Sample]:
    at = shared.lesson_at(lessons, seed=1)
    return [at(step) for step in range(14)]


def test_learns_maps_and_centres_and_nothing_from_shuffled_labels(
    samples: list[unet.Sample], small_file: Path
) -> None:
    grid = unet.coarse(truth.Source.read(small_file).grid, 2)
    trained = unet.train(lambda step: samples[step % 11], seed=1, settings=SMALL)
    assert np.mean(trained.curve[-10:]) < 0.3 * np.mean(trained.curve[:10])
    right, chance = shared.quality(trained, samples[11:])
    assert right > 0.5 > 2 * chance
    for given in samples[11:]:
        _, sure, objects = trained.predict(grid, given.image)
        assert np.all((sure > 0) & (sure <= 1)) and np.all(np.diff(objects.score) <= 0)
    # The car before the vehicle is at 9 to 11 m in all frames.
    best = objects.kind.index("vehicle")
    assert 7.5 < objects.centre[best, 0] < 12.5 and abs(objects.centre[best, 1]) < 1.5
    np.testing.assert_allclose(objects.size[best], [4, 1.8, 1.5], rtol=0.3)
    wrong = shared.shuffled(lambda step: samples[step % 11], seed=1)
    fooled, _ = shared.quality(unet.train(wrong, seed=1, settings=SMALL), samples[11:])
    assert fooled < chance + 0.1


def test_same_seed_same_net(samples: list[unet.Sample]) -> None:
    few = unet.Settings(steps=4, width=8, cell=2)
    curves = [unet.train(lambda step: samples[step], seed, few).curve for seed in (1, 1, 2)]
    assert curves[0] == curves[1] != curves[2]


def test_a_training_that_was_cut_off_ends_the_same(samples: list[unet.Sample], tmp_path: Path) -> None:
    few, file = unet.Settings(steps=12, width=8, cell=2), tmp_path / "net.pt"

    def cut(step: int) -> unet.Sample:
        if step == 8:
            raise KeyboardInterrupt
        return samples[step]

    with pytest.raises(KeyboardInterrupt):
        unet.train(cut, 1, few, file)
    with pytest.raises(ValueError, match="ended at step 8 of 12"):
        unet.Unet.load(file)
    whole = unet.train(lambda step: samples[step], 1, few)
    resumed = unet.train(lambda step: samples[step], 1, few, file)
    assert resumed.curve == whole.curve
    kept = unet.Unet.load(file)
    assert np.array_equal(kept.groups(samples[0].image), whole.groups(samples[0].image))
    with pytest.raises(ValueError, match="was trained with"):
        unet.train(lambda step: samples[step], 1, SMALL, file)
    file.write_bytes(b"no net")
    with pytest.raises(ValueError, match="net.pt: is no learner"):
        unet.Unet.load(file)


def test_targets_are_where_the_boxes_are(samples: list[unet.Sample]) -> None:
    for given in samples[:3]:
        target = given.target
        assert given.image.shape[0] == unet.CHANNELS and np.all(np.isfinite(given.image))
        assert len(target.cells) == 2  # the hidden car is no target
        peaks = np.argwhere(target.heat.max(axis=0) == 1)
        assert {int(i * target.labels.shape[1] + j) for i, j in peaks} == set(target.cells.tolist())


def test_every_step_has_another_rig_and_the_same_one_again(lessons: list[shared.Lesson], samples: list[unet.Sample]) -> None:
    assert len({given.image.tobytes() for given in samples}) == len(samples)
    again = shared.lesson_at(lessons, seed=1)
    assert np.array_equal(again(7).image, samples[7].image)
    assert not np.array_equal(shared.lesson_at(lessons, seed=2)(7).image, samples[7].image)


def test_rigs_fill_the_mount_and_some_stand_around_the_body() -> None:
    mount = {"min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3]}
    body = np.array([-2.2, -0.9, 2.2, 0.9])
    rng = np.random.default_rng(1)
    rigs = [shared.rig(rng, mount, body) for _ in range(300)]
    assert {len(poses) for poses in rigs} == {1, 2, 3, 4, 5, 6}
    every = np.concatenate(rigs)
    low = every[:, 2] < 2.2
    inside = (np.abs(every[:, 0]) < 2.2) & (np.abs(every[:, 1]) < 0.9)
    assert 0.1 < low.mean() < 0.3 and not inside[low].any()
    assert np.all(np.abs(every[~low, :2]) <= 0.6) and np.all(every[~low, 2] <= 2.8)
    assert 0.3 < np.mean([poses[:, 3].any() for poses in rigs]) < 0.7


def test_who_predicts_the_truth_gets_all(lessons: list[shared.Lesson]) -> None:
    lesson = lessons[0]
    layout = Layout("one", "box", np.array([[0, 0, 2.5, 0, 0, 0.0]]))
    kept = lesson.truth.points >= truth.VISIBLE
    kinds = [truth.KINDS[kind] for kind in lesson.truth.kind[kept]]

    class Knows:
        settings = SMALL
        moved = 0.0

        def predict(self, grid: truth.Grid, seen: np.ndarray, most: int) -> tuple[np.ndarray, None, Objects]:
            t = lesson.truth
            centre = t.centre[kept] + [self.moved, 0, 0]
            return lesson.target.labels, None, Objects(centre, t.size[kept], t.yaw[kept], kinds, np.ones(len(kinds)))

    world = worlds.World("small", lesson.world.path, "test", [lesson.frame], "")
    found = judge.judge(world, [lesson.truth], layout, 1, Knows())  # type: ignore[arg-type]
    assert found["metrics"] == {"birds_eye_miou": 1.0, "centre_recall": 1.0, "centre_ap": pytest.approx(1.0)}
    assert set(found["detail"]["iou_by_class_map"]) <= set(GROUPS)
    far = Knows()
    far.moved = 3.0
    metrics = judge.judge(world, [lesson.truth], layout, 1, far)["metrics"]  # type: ignore[arg-type]
    # Three metres off is a match at four metres alone.
    assert metrics["centre_recall"] == 0.0 and metrics["centre_ap"] == pytest.approx(0.25)


def test_no_points_is_an_empty_image() -> None:
    grid = unet.coarse(truth.Grid((0, 0, 0), (1, 1, 1), (9, 7, 6)), 2)
    assert grid.shape == (5, 4, 6)
    assert not unet.image(grid, np.zeros((0, 3))).any()
