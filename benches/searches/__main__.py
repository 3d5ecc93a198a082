"""Benchmark of searches: `sightline optimize` beside optimizers of other projects.

cargo build --release && pip install ./python cma optuna cmaes nevergrad pymoo matplotlib
python3 -m benches.searches [--problems uc,van] [--methods ours,pycma] [--seeds 10] [--out DIR]

Problems: the four own scenes (uc, hw, re, iy), a car on urban-crossing (car), a van with four requirements
on a street (van, docs/guide/van.md), and two scenes at once (two). Where ../shared is there, also a Lexus
(lexus) and a steep street (hill). `--problems variants` are problems with one more option: both scenes mirrored,
free phases, fog, --fix, --symmetric, --inject. Ours alone runs them; each is compared with what its plain
relative found, scored for the same question. Methods: ours at several --evaluations, swaps
(greedy and exchanges on the grid: `--method swaps`), and the peers random, pycma (BIPOP; pycma-start
from the best baseline, as ours), tpe and optuna-cma (Optuna), de (nevergrad), ga (pymoo). Ours always
runs: peers get its work and its equipment.

Work is sensor poses cast × frames. A peer may spend the work of our run of equal seed, or --work if given.
They search the box of the mounts; a placement whose LiDARs are too close is not cast and costs more than
any score, and so do guards and unmet requirements. A vehicle's equipment is that which ours found, of
which peers search the poses. They search over --peer-frames, since ours begins with few frames, too, and
peers that cast all frames of a scene get few placements. Their best eight are confirmed over
all frames, which is not counted as work.

Writes DIR/table.md, DIR/PROBLEM.svg, and DIR/results/PROBLEM.METHOD.SEED.json; a finished run is not run
again, so that the same command goes on after a stop. --kept writes tables and figures of the runs that are there,
and runs nothing. Better placements go to best_known.json.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path

if __package__ in (None, ""):
    sys.path[0] = str(Path(__file__).resolve().parents[2])

from benches.searches.bench import OWN, Bench
from benches.searches.peers import PEERS
from benches.searches.problems import ROOT, problems
from benches.searches.variants import variants

METHODS = (*OWN, *PEERS)
KEYS = tuple(problems(Path()))
VARIANTS = tuple(variants(problems(Path())))


def names(known: tuple[str, ...], groups: dict[str, tuple[str, ...]] | None = None):
    """A parser of names with commas between them; a group stands for its names."""
    groups = groups or {}

    def parse(text: str) -> list[str]:
        found = [name for part in text.split(",") if part for name in groups.get(part, (part,))]
        unknown = [name for name in found if name not in known]
        if unknown or not found:
            raise argparse.ArgumentTypeError(f"{text!r} is none of {', '.join((*known, *groups))}")
        return found

    return parse


def count(text: str) -> int:
    """A whole number of 1 or more."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number of 1 or more")
    return int(text)


def frames(text: str) -> int | None:
    """A whole number of 1 or more; None for `ours`."""
    return None if text == "ours" else count(text)


def counts(text: str) -> list[int]:
    """Rising whole numbers with commas between them."""
    return sorted({count(part) for part in text.split(",")})


def parsed(arguments: list[str] | None = None) -> argparse.Namespace:
    """The arguments."""
    parser = argparse.ArgumentParser(prog="benches.searches", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--problems", type=names((*KEYS, *VARIANTS), {"variants": VARIANTS}), default=list(KEYS),
        help=f"of {','.join(KEYS)} [all], and variants: {','.join(VARIANTS)}")
    add("--methods", type=names(METHODS), default=list(METHODS), help=f"of {','.join(METHODS)} [all]")
    add("--seeds", type=count, default=10, help="seeds 1 to this [10]")
    add("--evaluations", type=counts, default=[45, 90, 180, 360], help="of ours, one run each")
    add("--compare", type=count, default=180, help="evaluations of our run in the table of margins")
    add("--work", type=count, help="sensor poses × frames of each peer, instead of those of ours")
    add("--peer-frames", type=frames, default=4,
        help="frames of each scene that peers search over; `ours`: as many as ours ended with [4]")
    add("--options", type=shlex.split, default=[], help="more options for `optimize`, in one text")
    add("--kept", action="store_true", help="tables and figures of the runs that are there; runs nothing")
    add("--out", type=Path, default=Path("runs/searches"), help="folder of results [runs/searches]")
    add("--program", type=Path, default=ROOT / "target/release/sightline", help="the program")
    add("--best-known", type=Path, default=Path(__file__).with_name("best_known.json"))
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Runs the benchmark; prints the table."""
    args = parsed(arguments)
    if args.kept and not any((args.out / "results").glob("*.json")):
        print(f"{args.out}: holds no results; leave out --kept to make them", file=sys.stderr)
        return 2
    args.out.mkdir(parents=True, exist_ok=True)
    args.out, args.program = args.out.resolve(), args.program.resolve()
    if not args.kept and not args.program.exists():
        print(f"{args.program}: is not there; build it with `cargo build --release`", file=sys.stderr)
        return 2
    known = problems(args.out)
    known |= variants(known)
    print(Bench(args).run([known[key] for key in args.problems]), end="")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("stopped; the same command goes on")
