"""Workers that die are replaced, and none outlives its parent, whatever it was started for."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from textwrap import indent

import pytest
from collect_fakes import order

from robospa.harness.datasets.workers import EpisodeJob, MakerError, maker_at, pool_opener
from robospa.harness.pool import MOST_DEATHS, JobProcess, Pool, WorkerDied, WorkerStuck
from robospa.harness.seeds.attempt import Attempt
from robospa.harness.settings import Compute
from robospa.tasks.seeds import ListKey

KEY = ListKey("Pick_Blocks_Size", 1)


class Mortal:
    """A worker that dies so often at an odd job."""

    def __init__(self, deaths: list[int], most: int) -> None:
        self.deaths, self.most = deaths, most
        self.killed = False

    def run(self, job: int) -> int:
        if job == 13:
            raise ValueError("not this one")
        if job % 2 and len(self.deaths) < self.most:
            self.deaths.append(job)
            raise WorkerDied("gone")
        return -job

    def kill(self) -> None:
        self.killed = True


class Started(list[Mortal]):
    """Starts mortals, and keeps them."""

    def __init__(self, most: int = 0) -> None:
        self.most = most

    def __call__(self) -> Mortal:
        self.append(Mortal([], self.most))
        return self[-1]


def test_the_job_of_a_worker_that_died_is_begun_again() -> None:
    deaths: list[int] = []
    with Pool[int, int](lambda: Mortal(deaths, MOST_DEATHS - 1), 1) as pool:
        assert pool.submit(7).result() == -7
    assert deaths == [7] * (MOST_DEATHS - 1)


def test_a_job_at_which_every_worker_dies_is_given_up_and_the_rest_goes_on() -> None:
    started = Started(1)
    with Pool(started, 2, crashed=lambda job: 0) as pool:
        futures = [pool.submit(job) for job in (4, 7, 6)]
        assert [future.result() for future in futures] == [-4, 0, -6]
    assert all(worker.killed for worker in started) and len(started) <= 2 + MOST_DEATHS
    with Pool(Started(1), 1, deaths=1) as pool, pytest.raises(WorkerDied, match="gone"):
        pool.submit(7).result()


def test_a_worker_is_replaced_after_so_many_jobs() -> None:
    started = Started()
    with Pool(started, 1, jobs_each=3) as pool:
        assert [pool.submit(job).result() for job in range(7)] == [-job for job in range(7)]
    assert len(started) == 3 and all(worker.killed for worker in started)


def test_an_error_is_raised_and_the_worker_goes_on() -> None:
    started = Started()
    with Pool(started, 1) as pool:
        with pytest.raises(ValueError, match="not this"):
            pool.submit(13).result()
        assert pool.submit(2).result() == -2
    assert len(started) == 1


def test_what_waits_at_the_end_is_cancelled_and_a_pool_can_grow() -> None:
    pool = Pool(Started(), 0)
    waiting = pool.submit(2)
    pool.grow(2)
    assert waiting.result() == -2 and pool.workers == 2
    idle = Pool(Started(), 0)
    waiting = idle.submit(2)
    idle.close()
    pool.close()
    assert waiting.cancelled()


def calculator(seconds: float) -> Callable[[str], object]:
    """What evaluates expressions in another process."""
    return eval


class Unsendable(Exception):
    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


def test_a_process_does_one_job_after_the_other_and_says_how_it_died() -> None:
    process: JobProcess[str, object] = JobProcess(calculator, 1.0, seconds=20.0)
    assert process.run("1 + 1") == 2
    with pytest.raises(ZeroDivisionError):
        process.run("1 / 0")
    with pytest.raises(RuntimeError, match="Unsendable: 1 and 2"):
        process.run("(_ for _ in ()).throw(__import__('test_pool').Unsendable(1, 2))")
    assert process.run("__import__('sys').stdin.read()") == ""
    here = os.environ.get("PYTHONPATH")
    assert process.run("__import__('os').environ.get('PYTHONPATH')") == here
    assert process.run("__import__('sys').path") == sys.path
    os.kill(process.pid, signal.SIGINT)
    assert process.run("2 + 2") == 4
    os.kill(process.pid, signal.SIGSEGV)
    with pytest.raises(WorkerDied, match="signal 11"):
        process.run("3 + 3")
    process.kill()


def test_a_process_that_takes_too_long_is_ended() -> None:
    process: JobProcess[str, object] = JobProcess(calculator, 1.0, seconds=0.2, nice=3)
    with pytest.raises(WorkerStuck, match=r"0\.2 s"):
        process.run("__import__('time').sleep(60)")
    with pytest.raises(WorkerDied):
        process.run("1")
    process.kill()


def test_a_collection_replaces_a_process_that_dies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FAKE_DEATHS", str(tmp_path / "deaths"))
    with (
        pool_opener(Compute(workers=2), "collect_fakes:FakeMaker") as open_pool,
        open_pool(1) as pool,
    ):
        assert pool.workers == 1
        assert pool.submit(order(tmp_path).job(KEY, 1_000_001)).result().accepted
    assert (tmp_path / "deaths").exists()
    start = partial(JobProcess[EpisodeJob, Attempt], maker_at, "collect_fakes:NoSuchMaker")
    with Pool(start, 1) as pool, pytest.raises(MakerError, match="NoSuchMaker"):
        pool.submit(order(tmp_path).job(KEY, 1)).result()


USES = {
    "evaluation": """
from robospa.harness.running.worker import LocalExecutor
from robospa.harness.running.worker import WorkerConfig
worker = LocalExecutor(WorkerConfig(out, "hold"), 1).start("worker-000")""",
    "films": """
from robospa.harness.running.films import Films
from robospa.harness.running.worker import WorkerConfig
from fake_runs import trial_record
from film_fakes import KEYS
Films(WorkerConfig(out, "hold")).add([trial_record(KEYS[0], False)])""",
    "probe": """
from robospa.harness.running.evaluate import probe_world
from robospa.harness.running.worker import WorkerConfig
slow = {"object_list": [], "timeout": 60}
world = {"world": "multiprocessing.connection:wait", "world_arguments": slow}
probe_world(WorkerConfig(out, "hold", **world), False)
""",
    "collection": """
from collect_fakes import order
from robospa.harness.datasets.workers import pool_opener
from robospa.harness.settings import Compute
from robospa.tasks.seeds import ListKey
with pool_opener(Compute(workers=1)) as opened, opened(1) as pool:
    pool.submit(order(out).job(ListKey("Pick_Blocks_Size", 1), 1)).result()""",
    "seeds": """
from robospa.harness.seeds.attempt import expert_pool
from robospa.tasks.seeds import ListKey
with expert_pool(1) as pool:
    pool.submit((ListKey("Pick_Blocks_Size", 1), 1)).result()""",
    "replay": """
from types import SimpleNamespace
from robospa.harness.factory import load_function
from robospa.leaderboard import replay
from fake_runs import trial_record
from film_fakes import KEYS
replay.drawn = lambda *_: KEYS[:1]
replay.read_traces = lambda *_: {KEYS[0]: ()}
replay.spec_of = lambda *_: SimpleNamespace(space="joint")
valid = SimpleNamespace(
    manifest=SimpleNamespace(bundle="b"), keys=KEYS, settings=None,
    run=SimpleNamespace(records={KEYS[0]: trial_record(KEYS[0])}))
where = SimpleNamespace(world="sapien", parts="robospa.harness.trial:task_parts")
replay.replay(valid, "challenge", 1, where)""",
    "scenes": """
from fake_runs import trial_record
from film_fakes import KEYS
from robospa.leaderboard import rules
rules.FEW = 0
records = {key: trial_record(key) for key in KEYS}
rules.check_scenes(records, "robospa.harness.trial:task_parts", 2)""",
}
DRIVER = """
import os, signal, sys, threading, time
from pathlib import Path
out = Path(sys.argv[1])

def children():
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = stat.read_text().rpartition(")")[2].split()[:2]
        except OSError:
            continue
        if int(parent) == os.getpid() and state != "Z":
            yield stat.parent.name

def kill_parent():
    while not (found := list(children())):
        time.sleep(0.005)
    time.sleep(float(sys.argv[2]))  # while it starts, and while it works
    (out / "children").write_text(" ".join(found))
    os.kill(os.getpid(), signal.SIGKILL)

threading.Thread(target=kill_parent, daemon=True).start()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is no /proc")
@pytest.mark.parametrize(
    ("use", "after"),
    [("evaluation", 0.0), ("scenes", 0.0), *((u, 0.4) for u in USES if u != "scenes")],
)
def test_no_process_outlives_its_parent(tmp_path: Path, use: str, after: float) -> None:
    script = tmp_path / "driver.py"
    # What ends first, or fails as what is faked here does, waits to be killed.
    script.write_text(f"{DRIVER}try:\n{indent(USES[use], '    ')}\nfinally:\n    time.sleep(60)\n")
    done = subprocess.run(
        [sys.executable, str(script), str(tmp_path), str(after)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=120,
    )
    assert done.returncode == -signal.SIGKILL
    children = [int(pid) for pid in (tmp_path / "children").read_text().split()]
    assert children
    assert_gone(children)


STOPPED = """
import os, signal, sys, time
from pathlib import Path
from robospa.harness.running.worker import LocalExecutor

class Slow:
    def __reduce__(self):
        code = "__import__('pathlib').Path(%r).write_text(str(__import__('os').getpid()))"
        return eval, (code % sys.argv[1] + " and __import__('time').sleep(60)",)

worker = LocalExecutor(Slow(), 1).start("worker-000")
while not Path(sys.argv[1]).exists() or not Path(sys.argv[1]).read_text():
    time.sleep(0.01)
os.kill(int(Path(sys.argv[1]).read_text()), signal.SIGSTOP)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nobody can end a stopped process")
def test_a_worker_that_is_stopped_while_it_starts_ends_with_its_driver(tmp_path: Path) -> None:
    """Its configuration is read when it is stopped, which imports most of the package."""
    mark = tmp_path / "worker"
    done = subprocess.run([sys.executable, "-c", STOPPED, str(mark)], timeout=120)
    assert done.returncode == -signal.SIGKILL
    assert_gone([int(mark.read_text())])


def assert_gone(pids: list[int]) -> None:
    """All these processes end soon."""
    until = time.monotonic() + 30
    while (left := [pid for pid in pids if _is_there(pid)]) and time.monotonic() < until:
        time.sleep(0.01)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert not left


def _is_there(pid: int) -> bool:
    """Whether the process exists and is not one that only waits to be reaped."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


SCRIPT = """
import numpy as np
import robospa

class MyPolicy:
    spec = robospa.PolicySpec(name="mine", cameras=(), action="joint", horizon=25)

    def reset(self, trial):
        pass

    def infer(self, observation):
        return np.repeat(observation["state"][None], 25, 0).astype(np.float32)

run = robospa.evaluate(MyPolicy, tasks="Pick_Blocks_Size", levels=[1], trials=1, workers=1,
                       step_scale=0.05, out="run")
print(len(run.records), "records")
"""


@pytest.mark.sim
@pytest.mark.parametrize("given", ["file", "standard input"])
def test_a_script_needs_no_guard(tmp_path: Path, given: str) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    arguments = ["script.py"] if given == "file" else ["-"]
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=tmp_path,
        input=SCRIPT if given != "file" else "",
        text=True,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=300,
    )
    assert done.stdout.endswith("1 records\n"), done.stderr
