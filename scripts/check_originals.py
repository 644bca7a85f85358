"""Our clients beside the original ones, at the original servers: what arrives, and what is done.

    python scripts/check_originals.py PYTHON CHECKOUTS [CASE...]

PYTHON has openpi-client, vla-eval, fastapi, uvicorn, json_numpy, msgpack-numpy, msgspec, pyzmq,
requests, scipy, opencv-python-headless, einops, tqdm. CHECKOUTS is a folder with openpi,
AgiBot-World, X-VLA, XPolicyLab, RoboTwin (the parent of its commit 85c7f84), RoboTwin-main,
starVLA, lingbot-vla, openvla-oft (needs tensorflow), gr00t-n17, gr00t-n15, vllm-omni (its wheel).
In every case the original server runs its own code with a model that reports what it reads; it is
asked by the original client and by ours, with the same observations. Prints the table of
docs/clients.md, and ends with 1 if an action differs. Not part of the tests, because it needs all
that.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from originals import world

from robospa.clients import connect
from robospa.protocol.policy import TrialInfo
from robospa.protocol.transport import Timeouts

HERE = Path(__file__).resolve().parent / "originals"
QUICK = Timeouts(wait=20, connect=20, hello=20, reset=20, first_infer=20, infer=20, end=20)
TRIAL = TrialInfo(world.TASK, "aloha-agilex", world.TEXT, world.SEED)
Actions = NDArray[np.float64]
Seen = Mapping[str, Any]


def same(actions: Actions) -> Actions:
    """Joint actions need no translation."""
    return actions


def xvla_actions(actions: Actions) -> Actions:
    """Ours as X-VLA's client hands them to RoboTwin: -1 for closed; q and -q are one rotation."""
    found = unsigned(actions)
    found[:, [7, 15]] = 2 * found[:, [7, 15]] - 1
    return found


def unsigned(actions: Actions) -> Actions:
    """Theirs with quaternions of the same sign."""
    found = actions.copy()
    for start in (3, 11):
        found[:, start : start + 4] *= np.sign(found[:, start + 3 : start + 4])
    return found


@dataclass(frozen=True)
class Case:
    """An original; `query` are our options, `steps` are those of our queries, `words` go to the
    script.

    `ours` and `theirs` bring the actions of the two clients into one form.
    """

    title: str
    script: str
    folder: str
    scheme: str
    query: str = ""
    steps: tuple[int, ...] = (0, 6)
    words: tuple[str, ...] = ()
    ours: Callable[[Actions], Actions] = same
    theirs: Callable[[Actions], Actions] = same


CASES = {
    "openpi": Case(
        "openpi: `WebsocketPolicyServer`; `openpi_client` with the environment of the real Aloha",
        "openpi.py",
        "openpi",
        "openpi",
        steps=(0,),
    ),
    "starvla": Case(
        "StarVLA: `WebsocketPolicyServer`; its client of RoboTwin",
        "family.py",
        "starVLA",
        "starvla",
        words=("starvla",),
    ),
    "vllm": Case(
        "vLLM-Omni: its robot endpoint; `openpi_client` with the checkpoint's names",
        "family.py",
        "vllm-omni",
        "vllm",
        words=("vllm",),
    ),
    "lingbot": Case(
        "LingBot-VLA: `WebsocketPolicyServer`; its client with the names that its policy reads",
        "family.py",
        "lingbot-vla",
        "lingbot",
        words=("lingbot",),
    ),
    "go1": Case(
        "GO-1: `deploy.py`; RoboTwin's client (`wrists=swapped`)",
        "go1.py",
        "",
        "go1+http",
        "?wrists=swapped",
    ),
    **{
        f"gr00t-{way}": Case(f"GR00T: {title}", "gr00t.py", folder, "gr00t", words=(way,))
        for way, folder, title in (
            ("nested", "gr00t-n17", "`PolicyServer`, `Gr00tPolicy`'s checks; `PolicyClient`"),
            ("nd", "gr00t-n17", "the same, arrays in msgpack-numpy's form"),
            ("flat", "gr00t-n17", "the same behind its simulation wrapper"),
            ("n15", "gr00t-n15", "N1.5's `RobotInferenceServer` and its client"),
        )
    },
    **{
        f"oft-{way}": Case(
            f"OpenVLA-OFT: `deploy.py`; its ALOHA client (`actions={way}`)",
            "oft.py",
            "openvla-oft",
            "oft+http",
            f"?actions={way}",
            words=(way,),
        )
        for way in ("absolute", "relative")
    },
    "xvla": Case(
        "X-VLA: its FastAPI server; its RoboTwin client",
        "xvla.py",
        "X-VLA",
        "xvla+http",
        steps=(0, 30),
        ours=xvla_actions,
        theirs=unsigned,
    ),
    "xpolicylab": Case(
        "XPolicyLab: its WebSocket server; RoboTwin's client", "xpolicylab.py", "", "xpolicylab"
    ),
    "xpolicylab-ee": Case(
        "the same with poses (`space=ee`)",
        "xpolicylab.py",
        "",
        "xpolicylab",
        "?space=ee",
        words=("ee",),
    ),
    "robotwin": Case(
        "RoboTwin: `policy_model_server.py` with DP's windows; its client with DP's half",
        "robotwin.py",
        "RoboTwin",
        "robotwin+tcp",
        "?layout=dp&calls=both&history=1",
        steps=(0, 6, 12),
    ),
    "vla-eval": Case(
        "vla-eval: a server without chunks; its RoboTwin benchmark",
        "vla_eval_benchmark.py",
        "",
        "vla-eval",
        steps=(0, 1),
    ),
}


@contextmanager
def serving(python: str, case: Case, checkouts: Path) -> Iterator[tuple[int, Any]]:
    """The port of the original server, and its reports."""
    words = [python, str(HERE / case.script), "serve", str(checkouts / case.folder), *case.words]
    with (
        tempfile.TemporaryFile("w+") as log,
        subprocess.Popen(words, stdout=-1, stderr=log, text=True, cwd=HERE) as process,
    ):
        try:
            assert process.stdout is not None
            if not (first := process.stdout.readline()):
                log.seek(0)
                sys.exit(f"{case.script} did not start: {log.read().strip()[-300:]}")
            yield int(json.loads(first)["port"]), process.stdout
        finally:
            process.kill()


def ask_ours(case: Case, port: int, reports: Any) -> tuple[list[Seen], Actions]:
    """What the server reads of our client, and what our robot would do."""
    seen, rows = [], []
    with connect(f"{case.scheme}://127.0.0.1:{port}{case.query}", timeouts=QUICK) as policy:
        policy.reset(TRIAL)
        for step in case.steps:
            given = world.observation(step)
            if policy.spec.history:
                given["history"] = {
                    offset: world.observation(max(step + offset, 0))
                    for offset in policy.spec.history
                }
            chunk = policy.infer(given)
            rows.append(chunk[: policy.spec.execute])
            seen.append(json.loads(reports.readline()))
        policy.end({"success": True})
    return seen, np.concatenate(rows).astype(float)


def ask_theirs(
    python: str, case: Case, checkouts: Path, port: int, reports: Any
) -> tuple[list[Seen], Actions]:
    """The same of the original client."""
    folder = str(checkouts / case.folder)
    words = [python, str(HERE / case.script), "ask", folder, str(port), *case.words]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, cwd=HERE, check=False)
    if done.returncode:
        raise RuntimeError(f"the original client failed: {done.stderr[-2000:]}")
    actions = np.array(json.loads(done.stdout)["actions"])
    return [json.loads(reports.readline()) for _ in case.steps], actions


def differences(ours: Seen, theirs: Seen) -> list[str]:
    """What one query of ours has else than theirs."""
    found = [f"`{name}` sent extra" for name in ours if name not in theirs]
    found += [f"`{name}` not sent" for name in theirs if name not in ours]
    for name in (name for name in ours if name in theirs and ours[name] != theirs[name]):
        a, b = ours[name], theirs[name]
        if not isinstance(a, list) or not isinstance(b, list) or len(a) != 4 or len(b) != 4:
            found.append(f"`{name}` {a} for {b}")
        elif a[:2] != b[:2]:
            found.append(f"`{name}` {a[0]} {a[1]} for {b[0]} {b[1]}")
        elif a[3] is None:
            found.append(f"`{name}` of other values")
        elif off := float(np.abs(np.subtract(a[3], b[3])).max()):
            found.append(f"`{name}` off by {off:.0e}")
    return found


def compare(python: str, case: Case, checkouts: Path) -> tuple[str, bool]:
    """The row of the table, and whether the actions agree."""
    with serving(python, case, checkouts) as (port, reports):
        ours, mine = ask_ours(case, port, reports)
        theirs, original = ask_theirs(python, case, checkouts, port, reports)
    pairs = zip(ours, theirs, strict=True)
    found = sorted({text for a, b in pairs for text in differences(a, b)})
    length = min(len(mine), len(original))
    off = float(np.abs(case.ours(mine[:length]) - case.theirs(original[:length])).max())
    read = f"{len(case.steps)} {'queries' if len(case.steps) > 1 else 'query'}: "
    read += "; ".join(found) or "equal"
    done = f"{length} equal" if off == 0 else f"{length}, off by {off:.0e}"
    return f"| {case.title} | {read} | {done} |", off < 1e-6


def main() -> int:
    """Print the table; 1 if an action differs."""
    if len(sys.argv) < 3:
        print(__doc__)
        return 2
    python, checkouts = sys.argv[1], Path(sys.argv[2]).resolve()
    print("| server; original client | what the model reads of ours | actions |\n|---|---|---|")
    agreed = []
    for name in sys.argv[3:] or CASES:
        row, good = compare(python, CASES[name], checkouts)
        agreed.append(good)
        print(row, flush=True)
    return 0 if all(agreed) else 1


if __name__ == "__main__":
    sys.exit(main())
