"""Write down what the code computes, to show that a change of its structure changed none of it.

    python tools/same_results.py write FOLDER [--only scenes,wire,trials,tables] [--run RUN]
    python tools/same_results.py compare BEFORE AFTER

`scenes`: digest of three scenes of each of the 355 variants, with all sentences of both splits.
`wire`: the bytes of one message of every kind.
`trials`: records of 630 trials (the oracle in every variant, random joints and poses, scripted
mistakes) without their times. `tables`: tables, reports and comparisons of RUN in every format;
give both sides the same RUN, such as BEFORE/trials/oracle, since its times are in the reports.
`compare` prints what differs and ends with 1 if anything does.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

SEEDS = (100000, 100001, 750000)
TIMES = ("wall_time", "timing", "latency", "attempts")
"""Fields of a record that depend on the machine."""
MISTAKES = ("neighbour", "beside", "drops", "swaps", "repeats", "hasty")
EVALUATIONS: dict[str, tuple[str, ...]] = {
    "oracle": ("oracle", "--tasks", "all,basic", "--trials", "1"),
    "random": ("random", "--tasks", "all,basic", "--levels", "2", "--trials", "1"),
    "ee": ("same_results:pose_walk", "--tasks", "all,basic", "--levels", "1", "--trials", "1"),
    "delta_ee": ("same_results:delta_walk", "--tasks", "spatial", "--levels", "3", "--trials", "1"),
    "fixed_rate": (
        *("random", "--tasks", "GAC,OCE", "--levels", "1", "--trials", "1"),
        *("--control", "fixed_rate"),
    ),
    **{
        kind: (f"same_results:{kind}", "--tasks", "GAC,CPI,MIP", "--levels", "1,4")
        for kind in MISTAKES
    },
}
"""Policy and options of every run of `trials`."""
SCALES = {"random": "0.02", "ee": "0.02", "delta_ee": "0.02", "fixed_rate": "0.05"}
"""Share of the step limit for policies that never succeed."""


class PoseWalk:
    """Walks both end-effectors at random in `ee` or `delta_ee` actions, some out of reach."""

    def __init__(self, action: str) -> None:
        from robospa.protocol.policy import PolicySpec

        self.spec = PolicySpec(name=action, cameras=(), action=action, horizon=4, seeded=True)
        self._seed = 0

    def reset(self, trial: object) -> None:
        """Start the walk of this trial."""
        self._seed = trial.policy_seed

    def infer(self, observation: object) -> NDArray[np.float32]:
        """The next four poses, float32 (4, D)."""
        generator = np.random.default_rng([self._seed, int(observation["step"])])
        if self.spec.action == "ee":
            walk = np.asarray(observation["ee"], dtype=float).reshape(1, 16).repeat(4, axis=0)
        else:
            walk = np.zeros((4, 14))
        width = walk.shape[1] // 2
        walk += generator.normal(0.0, 0.04, walk.shape)
        walk[:, [width - 1, 2 * width - 1]] = generator.uniform(0.0, 1.0, (4, 2))
        return walk.astype(np.float32)


pose_walk, delta_walk = partial(PoseWalk, "ee"), partial(PoseWalk, "delta_ee")


def __getattr__(name: str) -> Callable[[], object]:
    """`same_results:KIND` is the policy that makes mistakes of that kind."""
    if name not in MISTAKES:
        raise AttributeError(name)

    from robospa.baselines import oracle

    return lambda: oracle.FailingOracle(kind=name)


def write_scenes(folder: Path) -> None:
    """One line per scene: its digest and a hash of its sentences."""
    from robospa.tasks import catalog
    from robospa.tasks.instructions import SPLITS
    from robospa.tasks.sentences import instruction, sentences

    lines = []
    for name, task in catalog.tasks().items():
        for level in sorted(task.levels):
            for seed in SEEDS:
                scene = catalog.build_scene(name, level, seed)
                said = [(instruction(scene, s), *sentences(scene, s)) for s in SPLITS]
                lines.append(f"{name} {level} {seed} {scene.digest} {_hash(json.dumps(said))}")
    (folder / "scenes.txt").write_text("\n".join(lines) + "\n")


def write_wire(folder: Path) -> None:
    """One line per kind of message: a hash of its bytes."""
    from robospa.observation import CameraSpec
    from robospa.protocol import messages
    from robospa.protocol.policy import PolicySpec, TrialInfo
    from robospa.trial import TrialKey

    spec = PolicySpec("name", (CameraSpec("head", 64, 48),), history=(-1, -5), execute=3)
    trial = TrialInfo("T", "aloha-agilex", "do it", 11, "abc", TrialKey("T", 3, 7), {"a": 1})
    image = np.arange(64 * 48 * 3, dtype=np.uint8).reshape(48, 64, 3)
    observation = {
        "images": {"head": image},
        "state": np.linspace(0, 1, 14, dtype=np.float32),
        "ee": np.zeros((2, 8), np.float32),
        "instruction": "do it",
        "step": 3,
        "history": {-1: {"images": {"head": image}}},
        "privileged": {"poses": {"a": [0.5, None, True]}},
    }
    chunk = np.linspace(-1, 1, 28, dtype=np.float32).reshape(2, 14)
    made = (
        messages.Hello(0, messages.VERSION, "server", spec),
        messages.Reset(1, trial),
        messages.Ready(1),
        messages.Infer(2, observation),
        messages.Actions(2, chunk, {"infer_ms": 1.5}),
        messages.Error(3, messages.BUSY, "wait", True),
        messages.End(4, {"success": True, "steps": 9}),
        messages.Ended(4),
    )
    lines = [f"{m.type} {hashlib.sha256(messages.pack(m)).hexdigest()[:16]}" for m in made]
    (folder / "wire.txt").write_text("\n".join(lines) + "\n")


def write_trials(folder: Path) -> None:
    """One file of records a run, sorted by key, without their times."""
    for name, (policy, *options) in EVALUATIONS.items():
        out = folder / "trials" / name
        scale = ("--step-scale", SCALES[name]) if name in SCALES else ()
        trials = () if "--trials" in options else ("--trials", "1")
        words = ("eval", policy, *options, *trials, *scale, "--run-seed", "0", "--workers", "2")
        _robospa(*words, "--out", str(out), codes=(0, 1))  # 1: some trials could not be run
        records = [json.loads(line) for path in out.rglob("*.jsonl") for line in path.open()]
        have = {str(r["key"]) for r in records if r["end"] != "infrastructure"}
        kept = [r for r in records if r["end"] != "infrastructure" or str(r["key"]) not in have]
        if not kept:
            raise SystemExit(f"{name}: no trial was run")
        (folder / f"trials-{name}.txt").write_text("".join(sorted(map(_stripped, kept))))


def _stripped(record: dict[str, Any]) -> str:
    record["diagnostics"].pop("final", None)  # the digest of the state says it exactly
    return json.dumps({k: v for k, v in record.items() if k not in TIMES}, sort_keys=True) + "\n"


def write_tables(folder: Path, run: Path) -> None:
    """Everything that is made from the records of `run`, and from the published numbers."""
    tables = folder / "tables"
    _robospa("paper", "--out", str(tables / "paper"), "--no-figures")
    _robospa("paper", "--out", str(tables / "beside"), "--no-figures", "--run", str(run))
    _robospa("report", str(run), "--out", str(tables / "report"))
    _robospa("report", str(run), "--with-published", "--out", str(tables / "published"))
    for name, words in {
        "compare.txt": ("compare", str(run), "pi0.5"),
        "failures.txt": ("report", str(run), "--failures"),
        "lint.txt": ("report", str(run), "--lint"),
    }.items():
        (tables / name).write_text(_robospa(*words, codes=(0, 1)))


def _robospa(*words: str, codes: tuple[int, ...] = (0,)) -> str:
    here = Path(__file__).resolve().parent  # from where it finds the policies of this file
    command = [sys.executable, "-m", "robospa", *words]
    done = subprocess.run(command, capture_output=True, text=True, cwd=here)
    if done.returncode not in codes:
        sys.exit(f"robospa {' '.join(words)} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return done.stdout


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def differences(before: Path, after: Path) -> Iterable[str]:
    """One sentence for every file that differs; figures (drawn) and videos are left out."""
    files = {p.relative_to(s) for s in (before, after) for p in s.rglob("*") if p.is_file()}
    for name in sorted(files):
        if name.parts[0] == "trials" or name.suffix in (".png", ".mp4", ".webm", ".pdf", ".svg"):
            continue
        if not (before / name).exists() or not (after / name).exists():
            yield f"{name}: only in {before if (before / name).exists() else after}"
            continue
        first, second = (_lines(side / name) for side in (before, after))
        if first != second:
            pairs = zip(first, second, strict=False)
            row = next((i for i, (a, b) in enumerate(pairs) if a != b), len(first))
            wrong = sum(a != b for a, b in zip(first, second, strict=False))
            wrong += abs(len(first) - len(second))
            old, new = ((side[row : row + 1] or [""])[0][:300] for side in (first, second))
            yield f"{name}: {wrong} lines differ, first {row + 1}:\n  - {old}\n  + {new}"


def _lines(path: Path) -> list[str]:
    text = path.read_bytes().decode("utf8", "replace")
    text = re.sub(r"(?<=base64,)[A-Za-z0-9+/=]+", "...", text)
    return text.splitlines()


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    write = commands.add_parser("write")
    write.add_argument("folder", type=Path)
    write.add_argument("--only", default="scenes,wire,trials,tables")
    write.add_argument("--run", type=Path, default=None)
    compare = commands.add_parser("compare")
    compare.add_argument("before", type=Path)
    compare.add_argument("after", type=Path)
    options = parser.parse_args()
    if options.command == "compare":
        found = list(differences(options.before, options.after))
        print("\n".join(found) or "nothing differs")
        sys.exit(1 if found else 0)
    folder = options.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    run = (options.run or folder / "trials" / "oracle").resolve()
    parts: dict[str, Callable[[Path], None]] = {
        "scenes": write_scenes,
        "wire": write_wire,
        "trials": write_trials,
        "tables": partial(write_tables, run=run),
    }
    for part in options.only.split(","):
        if part not in parts:
            parser.error(f"unknown part {part!r}; known are {', '.join(parts)}")
        print(part, flush=True)
        parts[part](folder)


if __name__ == "__main__":
    main()
