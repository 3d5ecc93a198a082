"""A node that is lost takes nothing with it."""

from __future__ import annotations

import pytest

ray = pytest.importorskip("ray")

from ray.cluster_utils import Cluster  # noqa: E402

from sightline import Scene, distributed  # noqa: E402
from sightline._pool import Pool  # noqa: E402

from .conftest import SMALL  # noqa: E402


@pytest.fixture
def cluster():
    """Two nodes of one core each on this machine."""
    cluster = Cluster(
        initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False}
    )
    second = cluster.add_node(num_cpus=1)
    ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
    yield lambda: cluster.remove_node(second, allow_graceful=False)
    ray.shutdown()
    cluster.shutdown()


def test_a_lost_node_changes_no_byte(cluster, monkeypatch) -> None:
    monkeypatch.setattr(distributed, "CHUNK_SECONDS", 0.1)
    # Both nodes at work from the start: a worker alone could be done before the other stands.
    run = Pool.run

    def run_with_all(pool: Pool, *arguments, **named) -> None:
        standing, _ = ray.wait(list(pool._flying), num_returns=2, timeout=120)
        assert len(standing) == 2
        run(pool, *arguments, **named)

    monkeypatch.setattr(Pool, "run", run_with_all)
    scene = Scene.from_dict(SMALL, backend="cpu")
    poses = scene.random_poses(20_000, seed=1)
    told, lost = [], []

    def progress(done) -> None:
        told.append(done)
        if done.workers == 2 and not lost:
            lost.append(done)
            cluster()

    assert distributed.score([scene], poses, progress=progress) == [scene.score(poses)]
    assert lost and told[-1].done == len(poses)
