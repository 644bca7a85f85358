"""Do equal pose actions end in equal states on other kinds of processor?

    python tools/pose_replay.py record FILE.npz          # the expert's motions as pose actions
    python tools/pose_replay.py compare FILE.npz         # play them under every ENVIRONMENT
    python tools/pose_replay.py play FILE.npz            # one line a recording: its final state

`record` keeps the oracle's motions as `ee` and `delta_ee` actions, and random walks, some of whose
poses are out of reach. `compare` plays the same numbers in processes whose OpenBLAS, C library and
numpy are told to do without parts of this processor, as on other ones, and prints a table.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

NO_AVX = "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F,-AVX512VL,-AVX512DQ"
PLAIN_NUMPY = "X86_V3 X86_V4 AVX512_ICL"
ENVIRONMENTS: dict[str, dict[str, str]] = {
    "this processor": {},
    "OpenBLAS for SkylakeX": {"OPENBLAS_CORETYPE": "SkylakeX"},
    "OpenBLAS for Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "OpenBLAS for Zen": {"OPENBLAS_CORETYPE": "Zen"},
    "OpenBLAS for Nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
    "OpenBLAS for Prescott": {"OPENBLAS_CORETYPE": "Prescott"},
    "C library without AVX and FMA": {"GLIBC_TUNABLES": NO_AVX},
    "numpy without AVX": {"NPY_DISABLE_CPU_FEATURES": PLAIN_NUMPY},
    "all three without AVX": {
        "OPENBLAS_CORETYPE": "Prescott",
        "GLIBC_TUNABLES": NO_AVX,
        "NPY_DISABLE_CPU_FEATURES": PLAIN_NUMPY,
    },
}
TRIALS = (
    ("Pick_Blocks_Size", 1),
    ("Pick_Cans_Relational", 3),
    ("Hit_Blocks_Hammer_Order", 2),
    ("Click_Can_Place_Items", 1),
    ("Place_Bowls_Plates", 2),
    ("Press_Stapler_Repeat", 3),
)
WALK = 300
"""Actions of a random walk."""
Trace = NDArray[np.float32]


def recordings() -> Iterator[tuple[str, Trace]]:
    """`task/level/seed/space/kind` and the actions, float32 (T, 16), of every recording."""
    from robospa.tasks.seeds import accepted

    for number, (task, level) in enumerate(TRIALS):
        seed = accepted(task, level)[0]
        for space in ("ee", "delta_ee"):
            yield f"{task}/{level}/{seed}/{space}/expert", expert_motion(task, level, seed, space)
            yield f"{task}/{level}/{seed}/{space}/walk", walk(number, space)


def expert_motion(task: str, level: int, seed: int, space: str) -> Trace:
    """The oracle's actions in one trial, sent as poses."""
    from disguised_oracle import Disguised

    from robospa.harness.running.action_files import ActionRecorder
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial
    from robospa.trial import TrialKey

    recorder = ActionRecorder()
    run_trial(
        SapienWorld(render=False),
        Disguised(space),
        TrialKey(task, level, seed),
        policy_seed=0,
        recorder=recorder,
    )
    return recorder.actions


def walk(seed: int, space: str) -> Trace:
    """Small random steps, as a policy that answers at 5 Hz sends them."""
    generator = np.random.default_rng(seed)
    rows = generator.normal(0.0, 0.004, (WALK, 2, 8))
    if space == "ee":
        rows[:, :, :3] = rows[:, :, :3].cumsum(axis=0)
        rows[:, :, :7] += (0.0, -0.05, 0.95, 0.7, 0.0, 0.7, 0.0)
        rows[:, :, 0] += (-0.25, 0.25)
    else:
        rows[:, :, 3] += 1.0
    rows[:, :, 3:7] /= np.linalg.norm(rows[:, :, 3:7], axis=2, keepdims=True)
    rows[:, :, 7] = generator.uniform(0.0, 1.0, (WALK, 2))
    return rows.reshape(WALK, 16).astype(np.float32)


def record(file: Path) -> None:
    """Write all recordings to `file`."""
    np.savez_compressed(file, **dict(recordings()))


def play(file: Path) -> Iterator[str]:
    """One line a recording: its name, the final state, physics steps, actions out of reach."""
    from robospa.harness.replay import replay
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.trial import TrialKey

    world = SapienWorld(render=False)
    with np.load(file) as data:
        for name in data.files:
            task, level, seed, space, _ = name.split("/")
            key = TrialKey(task, int(level), int(seed))
            found = replay(world, key, data[name], space)
            beyond = found.diagnostics.get("unreachable_actions", 0)
            yield f"{name} {found.digest} {found.physics_steps} {beyond}"


def compare(file: Path) -> bool:
    """Print how many recordings end alike in every environment; True if all do."""
    expected: dict[str, list[str]] = {}
    alike = True
    for title, variables in ENVIRONMENTS.items():
        done = subprocess.run(
            [sys.executable, __file__, "play", str(file)],
            env={**os.environ, **variables},
            capture_output=True,
            text=True,
            check=True,
        )
        lines = done.stdout.split("\n")
        found = {line.split()[0]: line.split()[1:] for line in lines if line.count("/") == 4}
        expected = expected or found
        cells = []
        for part in ("/ee/", "/delta_ee/"):
            names = [name for name in expected if part in name]
            same = sum(found.get(name) == expected[name] for name in names)
            alike &= same == len(names)
            cells.append(f"{same} of {len(names)}")
        print(f"| {title} | {' | '.join(cells)} |", flush=True)
    return alike


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("command", choices=("record", "compare", "play"))
    parser.add_argument("file", type=Path)
    options = parser.parse_args()
    sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "helpers"))
    if options.command == "record":
        record(options.file)
    elif options.command == "play":
        for line in play(options.file):
            print(line)
    elif not compare(options.file):
        sys.exit(1)


if __name__ == "__main__":
    main()
