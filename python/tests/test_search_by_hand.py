"""Search by ask and tell, and the atlas that scores without a cast."""

from __future__ import annotations

import numpy as np
import pytest

import sightline
from sightline import Scene


def far(poses, goal):
    """Less for placements farther from a goal, whatever order their LiDARs have."""
    return -np.sort(((poses[..., :3] - goal) ** 2).sum(axis=-1), axis=-1).sum(axis=-1)


def test_a_search_finds_the_goal_and_keeps_the_rules(scene) -> None:
    space = scene.space()
    middle = 0.5 * (space.lower + space.upper)[0, :3]
    goal = middle + [0.1, -0.1, 0.05]
    search, first = sightline.Search(space, seed=3), None
    assert search.result() is None
    while search.told < 3000:
        poses = search.ask()
        assert (poses == search.ask()).all() and (space.violations(poses) == 0).all()
        first = poses if first is None else first
        search.tell(far(poses, goal))
    best, value = search.result()
    assert value == far(best.poses[None], goal)[0]
    # Squared distances of n points from their mean add up to those between them over n: 6 pairs at least 0.2 m apart.
    most = -6 * 0.2**2 / 4
    assert 1.05 * most < value <= most + 1e-9 and far(first, goal).max() < 3 * most
    again = sightline.Search(space, seed=3)
    assert (again.ask() == first).all() and (sightline.Search(space, seed=4).ask()[0] != first[0]).any()


def worse_of_two(scores: sightline.Scores):
    return np.minimum(scores["near_gain"], scores["information_gain_share"])


def test_a_function_of_scores_is_an_objective(scene) -> None:
    told: list[dict] = []
    found = sightline.optimize(scene, objective=worse_of_two, evaluations=90, baselines=sightline.published()[:2], callback=told.append)
    assert len(found.baselines) == 2 and len(found.scores.names) == 3 and found.record["objective"] == "worse_of_two"
    # The result is the best of what was scored, and better than a draw of as many.
    values = worse_of_two(found.scores)
    assert found.scores.feasible[0] and found.record["value"] == values[0] == found.history[-1]["best_so_far"]
    assert [event["evaluations"] for event in told] == [one["evaluations"] for one in found.history]
    drawn = scene.score(scene.random_poses(90, seed=5))
    assert values[0] > np.max(worse_of_two(drawn)[drawn.feasible])
    # Equal calls give equal results; a target ends the search early.
    again = sightline.optimize(scene, objective=worse_of_two, evaluations=90, progress=False)
    assert again.best.poses.tobytes() == found.best.poses.tobytes() and again.baselines == []
    early = sightline.optimize(scene, objective=worse_of_two, target=found.history[0]["best_so_far"])
    assert len(early.history) == 1 and early.record["ended"] == "target"


def test_what_ends_a_search_for_a_function_goes_on_with_its_result(scene) -> None:
    def ends(error: BaseException):
        def callback(event: dict) -> None:
            if event["generation"] == 2:
                raise error

        return callback

    asked = {"objective": worse_of_two, "evaluations": 90}
    assert len(sightline.optimize(scene, callback=ends(StopIteration()), **asked).history) == 2
    for error in [KeyboardInterrupt(), OSError("full")]:
        with pytest.raises(type(error)) as raised:
            sightline.optimize(scene, callback=ends(error), **asked)
        assert len(raised.value.result.history) == 2 and raised.value.result.best is not None


def test_what_is_told_must_fit_what_was_asked(scene) -> None:
    search = sightline.Search(scene.space(), population=8)
    with pytest.raises(ValueError, match="values: nothing was asked; call ask first"):
        search.tell([1.0])
    poses = search.ask()
    with pytest.raises(ValueError, match=rf"values: has the length {len(poses) + 1}; give one for each placement, {len(poses)} in all"):
        search.tell(np.zeros(len(poses) + 1))
    values = np.full(len(poses), np.nan)
    search.tell(values)
    assert search.told == 0 and search.result() is None
    assert len(search.ask_placements()) == len(search.ask()) <= 8


def test_a_mount_without_room_is_told(small) -> None:
    _, described, *_ = small.__reduce__()[1]
    mount = described["mount"] | {"lidars": 16, "min_distance": 0.95}
    with pytest.raises(ValueError, match="widen it, or lower min_distance"):
        sightline.Search(Scene.from_dict(described | {"mount": mount}).space()).ask()


def test_an_atlas_gives_the_bits_of_scores(scene) -> None:
    rng = np.random.default_rng(6)
    poses = scene.random_poses(10)[:, :, :].reshape(-1, 6)
    atlas = scene.atlas(poses)
    assert len(atlas) == 40 and atlas.size_bytes > 0
    np.testing.assert_allclose(atlas.poses, poses, atol=1e-12)
    index = rng.integers(0, 40, (60, 4))
    index[0] = 7
    ours, theirs = atlas.score(index), scene.score(atlas.poses[index], self_hits=False)
    assert {"near_gain", "near_gain_3", "information_gain", "m_sog", "covered", "s_mig"} <= set(ours)
    for name, values in ours.items():
        assert values.tobytes() == theirs[name].tobytes(), name
    assert len(np.unique(ours["near_gain"])) > 50
    one = atlas.score(index[:, :1])["covered"]
    assert one.tobytes() == scene.score(atlas.poses[index[:, :1]])["covered"].tobytes()


def test_an_atlas_of_several_models() -> None:
    scene = Scene.load("scenes/highway.json", vehicle="scenes/vehicles/car.json", frames=2, backend="cpu")
    space = scene.space()
    poses = space.random(5)
    atlas = scene.atlas(poses.reshape(-1, 6), sensors=space.sensors * 5)
    index = np.arange(poses.shape[0] * poses.shape[1]).reshape(poses.shape[:2])
    ours = atlas.score(index)
    theirs = scene.score(atlas.poses[index], sensors=space.sensors)
    for name, values in ours.items():
        assert values.tobytes() == theirs[name].tobytes(), name


def test_wrong_atlases(small) -> None:
    atlas = small.atlas([[0, 0, 1.5, 0, 0, 0], [0, 0, 1.75, 0, 0, 0], [0, 0, 1.5, 0, 0, 0]])
    both = atlas.score([[0], [1], [2]])["covered"]
    assert both[0] == both[2] != both[1]
    for call, sentence in (
        (lambda: atlas.score([[3]]), r"index\[0, 0\]: is 3; give a whole number, 0 to 2"),
        (lambda: atlas.score([0, 1]), r"index: has the shape \[2\]"),
        (lambda: small.atlas(np.zeros((0, 6))), "poses: give an array"),
        (lambda: small.atlas(np.zeros(6)), "poses: give an array"),
        (lambda: small.atlas(5), "poses: give an array"),
        (lambda: small.atlas(np.zeros((2, 6)), sensors=["a", "b", "c"]), "sensors: has the length 3; give one name, or one for each pose, 2 in all"),
        (lambda: small.atlas(np.full((2, 6), np.nan)), "x = NaN"),
    ):
        with pytest.raises(ValueError, match=sentence):
            call()
