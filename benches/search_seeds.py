"""How good `sightline optimize` is: against Table 7, random placements and pycma, over seeds.

cargo build --release
python3 benches/search_seeds.py [--seeds 10] [--random 10000] [--scenes a.json ...] [--out DIR]

For every scene and seed: the default `optimize`, and pycma with its default options on the same
variables, from the middle of the mount and from the best layout of Table 7. pycma may evaluate as many
placements as the search and its swaps cast sensor poses for, over as many frames as the search ended
with; it is told more than 1000 for a broken rule or guard, and its best eight are confirmed over all
frames, as those of `optimize` are. Random placements are drawn once a scene, scored over two frames,
and the best 20 over all. All scores are this program's, over all frames of the scene.

Writes table.md and table.json; what is there already is not run again, so an interrupted measurement
goes on. pycma is optional (pip install cma==4.5.0 numpy); without it its rows say so. `--options` are
handed to `optimize`, to compare settings: give each another --out. One seed takes some 2 minutes a
scene on two quiet cores with pycma, the random placements about 5 minutes a scene.
"""

import argparse
import json
import random
import shlex
import statistics
import subprocess
import sys
from pathlib import Path

try:
    import warnings

    warnings.filterwarnings("ignore")
    import cma

    NO_PYCMA = None
except ImportError as error:
    NO_PYCMA = str(error)

ROOT = Path(__file__).resolve().parent.parent
OWN = ["urban-crossing", "highway", "residential", "industrial-yard"]
FINALISTS = 8
RANDOM_FINALISTS = 20
STEP_SIZE = 0.3
FIELDS = ["x", "y", "z", "roll", "pitch", "yaw"]


class Scene:
    """A scene with its P-SOG built once, and scores of placements in it."""

    def __init__(self, path, out, program):
        self.path, self.name, self.program = path, path.stem, program
        scene = json.load(open(path))
        psog = out / f"{self.name}.psog.npz"
        if not psog.exists():
            self.run("psog", "build", path, "--out", psog, "--quiet")
        scene["psog"] = {"file": psog.name}
        self.scored = out / f"{self.name}.json"
        self.scored.write_text(json.dumps(scene))
        self.batch = out / f"{self.name}.jsonl"
        mount = scene["mount"]
        self.rules = scene["mount"]
        if mount.get("keep_out") or mount.get("symmetric") or mount.get("equal_height"):
            sys.exit(f"{path}: pycma and random placements here know min_distance alone")
        angles = [mount.get(field, [0, 0]) for field in FIELDS[3:]]
        self.low = mount["min"] + [angle[0] for angle in angles]
        self.high = mount["max"] + [angle[1] for angle in angles]
        self.free = [k for k in range(6) if self.high[k] > self.low[k]]
        self.variables = len(self.free) * mount["lidars"]

    def run(self, *args):
        command = [str(arg) for arg in (self.program, *args)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"{shlex.join(command)}\n{done.stderr}")
        return done.stdout

    def poses(self, shares):
        """Poses of variables in [0, 1]."""
        poses = []
        for start in range(0, self.variables, len(self.free)):
            pose = list(self.low)
            for k, share in zip(self.free, shares[start:]):
                pose[k] = self.low[k] + share * (self.high[k] - self.low[k])
            poses.append(pose)
        return poses

    def broken(self, poses):
        """Missing distance between LiDARs, in metres."""
        least, total = self.rules.get("min_distance", 0.0), 0.0
        for i, a in enumerate(poses):
            for b in poses[:i]:
                apart = sum((p - q) ** 2 for p, q in zip(a[:3], b[:3])) ** 0.5
                total += max(0.0, least - apart)
        return total

    def scores(self, placements, frames):
        """m_sog_scaled of each, None where a guard is violated or there is none."""
        with open(self.batch, "w") as file:
            for index, poses in enumerate(placements):
                lidars = [dict(zip(FIELDS, pose)) for pose in poses]
                file.write(json.dumps({"name": f"p{index}", "lidars": lidars}) + "\n")
        frames = ["--frames", frames] if frames else []
        args = [self.scored, self.batch, *frames, "--backend", "cpu", "--format", "json", "--quiet"]
        scores = json.loads(self.run("score", *args))["scores"]
        return [None if s["guards"] else s["m_sog_scaled"] for s in scores]

    def best(self, scored, count):
        """The best score over all frames among the `count` best of (score, poses)."""
        scored = sorted((s for s in scored if s[0] is not None), key=lambda s: -s[0])[:count]
        found = [s for s in self.scores([poses for _, poses in scored], None) if s is not None]
        return max(found, default=None)


def optimized(scene, seed, out, options):
    """result.json of a run."""
    folder = out / f"{scene.name}-{seed}"
    if not (folder / "result.json").exists():
        args = ["optimize", scene.path, "--seed", seed, "--out", folder, "--backend", "cpu"]
        scene.run(*args, "--quiet", "--format", "json", *options)
    return json.load(open(folder / "result.json"))


def with_pycma(scene, seed, start, evaluations, frames):
    options = {"bounds": [0, 1], "seed": seed, "verbose": -9}
    search = cma.CMAEvolutionStrategy(start, STEP_SIZE, options)
    done, scored = 0, []
    while done < evaluations and not search.stop():
        points = search.ask()
        placements = [scene.poses(point) for point in points]
        broken = [scene.broken(poses) for poses in placements]
        kept = [poses for poses, missing in zip(placements, broken) if missing == 0]
        scores = iter(scene.scores(kept, frames) if kept else [])
        costs = []
        for poses, missing in zip(placements, broken):
            score = next(scores) if missing == 0 else None
            scored.append((score, poses))
            costs.append(1e3 + missing if score is None else -score)
        search.tell(points, costs)
        done += len(points)
    return scene.best(scored, FINALISTS)


def drawn(scene, count):
    """The best of random placements."""
    source, scored = random.Random(1), []
    while len(scored) < count:
        some = []
        while len(some) < min(2000, count - len(scored)):
            poses = scene.poses([source.random() for _ in range(scene.variables)])
            if scene.broken(poses) == 0:
                some.append(poses)
        scored += zip(scene.scores(some, 2), some)
    return scene.best(scored, RANDOM_FINALISTS)


def shares_of(scene, lidars):
    fields = [[lidar.get(field, 0.0) for field in FIELDS] for lidar in lidars]
    span = lambda k: scene.high[k] - scene.low[k]
    return [(pose[k] - scene.low[k]) / span(k) for pose in fields for k in scene.free]


def measure(scene, args, cache, save):
    """One entry of table.json."""
    entry = cache.setdefault(scene.name, {"runs": {}, "pycma": {}})
    for seed in range(1, args.seeds + 1):
        run = optimized(scene, seed, args.out, args.options)
        best = run["best"]
        assert not best["violations"] and not best["scores"]["guards"], (scene.name, seed)
        fair = lambda b: not b["violations"] and not b["scores"]["guards"]
        table_7 = max((b for b in run["baselines"] if fair(b)), key=lambda b: b["objective"])
        entry["table 7"] = [table_7["objective"], table_7["placement"]["name"]]
        cast = sum(method["poses_cast"] for method in run["methods"])
        entry["runs"][str(seed)] = {
            "score": best["objective"],
            "seconds": run["timings"]["total"],
            "evaluations": -(-cast // scene.rules["lidars"]),
            "frames": run["search_frames"],
        }
        mine = entry["runs"][str(seed)]
        starts = {
            "middle": [0.5] * scene.variables,
            "Table 7": shares_of(scene, table_7["placement"]["lidars"]),
        }
        for name, start in starts.items():
            known = entry["pycma"].setdefault(name, {})
            if NO_PYCMA is None and not args.no_pycma and str(seed) not in known:
                found = with_pycma(scene, seed, start, mine["evaluations"], mine["frames"])
                known[str(seed)] = found
        save()
        print(scene.name, seed, mine, {n: k.get(str(seed)) for n, k in entry["pycma"].items()},
              file=sys.stderr, flush=True)
    if args.random and entry.get("random", [0])[0] != args.random:
        entry["random"] = [args.random, drawn(scene, args.random)]
        save()
    return entry


def table(entries, seeds):
    """Margins of the search in per cent of the other's score; above zero it is better."""
    lines = [
        f"m_sog_scaled over all frames, seeds 1 to {seeds}; margins of `optimize` in per cent",
        "",
        "| scene | against | its score, median | margin, median | margin, worst seed | seeds better |",
        "|---|---|---|---|---|---|",
    ]
    for name, entry in entries.items():
        mine = {s: r["score"] for s, r in entry["runs"].items() if int(s) <= seeds}

        def row(against, others):
            if isinstance(others, str):
                lines.append(f"| {name} | {against} | {others} | | | |")
                return
            known = {s: o for s, o in others.items() if s in mine and o is not None}
            margins = [100 * (mine[s] - o) / abs(o) for s, o in known.items()]
            if not margins:
                return row(against, "no placement that keeps every rule and guard")
            better = sum(margin > 0 for margin in margins)
            lines.append(
                f"| {name} | {against} | {statistics.median(known.values()):.4e} "
                f"| {statistics.median(margins):.1f} | {min(margins):.1f} "
                f"| {better} of {len(margins)} |"
            )

        score, layout = entry["table 7"]
        row(f"best of Table 7, {layout}", dict.fromkeys(mine, score))
        if "random" in entry:
            count, score = entry["random"]
            row(f"best of {count} random", dict.fromkeys(mine, score))
        else:
            row("random", "left out: --random 0")
        for start, found in entry["pycma"].items():
            missing = "left out: " + (f"{NO_PYCMA}; pip install cma" if NO_PYCMA else "--no-pycma")
            row(f"pycma from {'the ' * (start == 'middle')}{start}", found or missing)
        runs = [r for s, r in entry["runs"].items() if int(s) <= seeds]
        seconds = [run["seconds"] for run in runs]
        spent = sorted({run["evaluations"] for run in runs})
        lines.append(
            f"| {name} | `optimize` itself: {spent[0]} to {spent[-1]} placements cast, "
            f"{statistics.median(seconds):.0f} s, at most {max(seconds):.0f} s "
            f"| {statistics.median(mine.values()):.4e}, worst {min(mine.values()):.4e} | | | |"
        )
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--random", type=int, default=10000, help="random placements; 0 for none")
    parser.add_argument("--no-pycma", action="store_true")
    parser.add_argument("--scenes", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("runs/search-seeds"))
    parser.add_argument("--program", type=Path, default=ROOT / "target/release/sightline")
    parser.add_argument("--options", type=shlex.split, default=[], help="for optimize")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / "table.json"
    cache = json.load(open(kept)) if kept.exists() else {}

    def save():
        kept.write_text(json.dumps(cache, indent=1))

    if NO_PYCMA is not None and not args.no_pycma:
        print(f"pycma is left out: {NO_PYCMA}", file=sys.stderr)
    paths = args.scenes or [ROOT / "scenes" / f"{name}.json" for name in OWN]
    scenes = [Scene(path.resolve(), args.out, args.program) for path in paths]
    entries = {scene.name: measure(scene, args, cache, save) for scene in scenes}
    text = table(entries, args.seeds)
    (args.out / "table.md").write_text(text)
    print(text, end="")


main()
