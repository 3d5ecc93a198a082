"""How large each study is, and what it is made of."""

from __future__ import annotations

from dataclasses import dataclass

from .learners.trees import Settings

#: Kinds of worlds.
KINDS = ("street", "highway", "residential", "yard", "town")


@dataclass(frozen=True)
class Design:
    """How large a study is."""

    name: str
    #: Kinds and seeds of worlds.
    train: tuple[tuple[str, int], ...]
    test: tuple[tuple[str, int], ...]
    learner: Settings = Settings()
    seeds: tuple[int, ...] = (1,)
    #: Frames of each world.
    frames: int = 1
    #: OpenDRIVE maps that towns are made on where they are at hand (``--xodr``), with the seeds of their traffic.
    train_towns: tuple[tuple[str, int], ...] = ()
    test_towns: tuple[tuple[str, int], ...] = ()
    #: Whether the own four scenes are tested on, too.
    own: bool = False
    #: ``study``: all sorts; ``towns``: placements of the standard run.
    placements: str = "study"
    #: Random layouts in each of twelve strata.
    random: int = 0
    #: The engine searches so many times, on so many training worlds at once.
    searches: int = 0
    searched: int = 0
    evaluations: int = 0
    #: Poses in the mount, and low ones, of the pool that candidates are searched in; 0: no search.
    poses: tuple[int, int] = (0, 0)


def _worlds(*seeds: int) -> tuple[tuple[str, int], ...]:
    return tuple((kind, seed) for seed in seeds for kind in KINDS)


_ALL = (
    Design(
        name="quick",
        train=(*_worlds(1), ("street", 2)),
        test=(("street", 101), ("highway", 101), ("residential", 101), ("town", 101)),
        own=True,
        frames=2,
        random=1,
        searches=1,
        searched=2,
        evaluations=60,
        poses=(100, 40),
        seeds=(1, 2),
    ),
    Design(
        name="standard",
        train=_worlds(1, 2, 3, 4),
        # Candidates were made on the first run, with seeds 101 to 103. One was chosen on the second, 201 to 203, and
        # tried on the third, 301 to 303. No run before this one looked at 401 to 403, Town03 and Town04.
        test=_worlds(401, 402, 403),
        train_towns=(("Town01", 1), ("Town06", 1)),
        test_towns=(("Town03", 2), ("Town04", 2)),
        own=True,
        frames=2,
        random=3,
        searches=2,
        searched=3,
        evaluations=180,
        poses=(400, 160),
        seeds=(1, 2),
        learner=Settings(points=90_000),
    ),
    # The standard run's four in the mount, in towns on real road maps alone. Every map is tested on with two
    # seeds of houses and traffic that no run has looked at; two maps are trained on.
    Design(
        name="towns",
        train=_worlds(1, 2),
        test=(),
        train_towns=(("Town01", 1), ("Town06", 1)),
        test_towns=tuple((town, seed) for town in ("Town02", "Town03", "Town04", "Town05", "Town10HD") for seed in (11, 12)),
        frames=2,
        placements="towns",
        seeds=(1, 2),
        learner=Settings(points=60_000),
    ),
)

#: By name.
DESIGNS = {design.name: design for design in _ALL}
