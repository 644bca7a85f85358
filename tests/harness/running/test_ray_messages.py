"""What travels inside Ray comes back as it was, is checked on arrival, and is never pickled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import pytest

from robospa.harness.running import ray_messages, ray_node
from robospa.harness.running.ray_bridge import RaySettings
from robospa.harness.running.ray_executor import NoCluster, RayExecutor
from robospa.harness.running.ray_messages import (
    Heard,
    pack_config,
    pack_heard,
    pack_order,
    unpack_config,
    unpack_heard,
    unpack_order,
)
from robospa.harness.running.worker import WorkerConfig
from robospa.protocol.codec import decode, encode
from robospa.protocol.errors import DecodeError, EncodeError
from robospa.protocol.policy import CameraSpec, PolicySpec
from robospa.protocol.transport import Timeouts
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Blocks_Size", 3, 100000)
TRACE = f"actions/{KEY.slug}.npz"
RECORD = TrialRecord(
    key=KEY,
    category="GAC",
    instruction="größter Block",
    scene_digest="ab",
    end="success",
    success=True,
    done=2,
    best=2,
    total=2,
    candidates=4,
    steps=9,
    physics_steps=45,
    policy_calls=3,
    digest="cd",
    actions_digest="ef",
    wall_time=0.1 + 0.2,
    events=({"time": 0.02, "kind": "subtask_done", "index": 0},),
    latency={"p50": 1.5},
    diagnostics={"idle": 0},
)
CONFIG = WorkerConfig(
    Path("/runs/mine"),
    ("ws://gpu1:8000", "ws://gpu2:8000"),
    {"timeouts": Timeouts(wait=7.5), "token": None, "options": {"state": [1, 2.5, "x"]}},
    "run_fakes:FakeWorld",
    {"render": None, "control": "rest_to_rest"},
    "run_fakes:parts",
    7,
    "first",
    frozenset((KEY, replace(KEY, level=1))),
    {"Pick_Blocks_Size": "ws://gpu1:8000", "Stack": ("ws://gpu1:8000", "ws://gpu2:8000")},
    {"ws://gpu1:8000": PolicySpec("mine", (CameraSpec("head", 64, 48),), history=(-1,))},
    0.5,
)
SAID: tuple[tuple[tuple[Any, ...], Mapping[str, bytes]], ...] = (
    (("ready", None), {}),
    (("beat", 12, "asking"), {}),
    (("done", RECORD), {TRACE: b"\x80\x04N.", f"videos/{KEY.slug}.mp4": bytes(100_000)}),
    (("lost", KEY, "the line went dead", True, "broken"), {}),
    (("fatal", "no such policy"), {}),
)


def test_every_setting_of_a_worker_comes_back() -> None:
    plain = WorkerConfig(Path("run"), "hold")
    same = [f.name for f in fields(CONFIG) if getattr(CONFIG, f.name) == getattr(plain, f.name)]
    assert same == []
    assert unpack_config(pack_config(CONFIG)) == CONFIG
    assert unpack_config(pack_config(plain)) == plain


@pytest.mark.parametrize("order", [("stop",), ("run", KEY, 2, "ws://gpu1:8000")])
def test_every_order_comes_back(order: tuple[Any, ...]) -> None:
    assert unpack_order(pack_order(order)) == order


def test_all_that_a_worker_says_comes_back() -> None:
    heard = Heard(SAID, b"\xffoutput", "signal 9")
    assert unpack_heard(pack_heard(heard)) == heard
    there = (("ready", Path("/tmp/on/the/node/0000.jsonl")), {})
    assert unpack_heard(pack_heard(Heard((there,), b"", None))) == Heard(SAID[:1], b"", None)


def test_what_nobody_says_is_not_sent() -> None:
    with pytest.raises(EncodeError, match="no order 'dance'"):
        pack_order(("dance",))
    with pytest.raises(EncodeError, match="does not say 'dance'"):
        pack_heard(Heard(((("dance",), {}),), b"", None))


def test_settings_that_cannot_travel_are_told_before_anything_starts(tmp_path: Path) -> None:
    pytest.importorskip("ray")
    config = replace(CONFIG, world_arguments={"asset": object()})
    with pytest.raises(NoCluster, match=r"settings cannot be sent .* type object"):
        RayExecutor(config, RaySettings("local"))


def changed(packed: bytes, name: str, value: Any) -> bytes:
    return encode({**decode(packed), name: value})


def said(number: int, **changes: Any) -> bytes:
    """SAID[number] with other fields."""
    whole = decode(pack_heard(Heard(SAID, b"", None)))
    return encode({**whole, "said": [{**whole["said"][number], **changes}]})


LINE = decode(pack_heard(Heard(SAID, b"", None)))["said"][2]["record"]
RUN = pack_order(("run", KEY, 1, "hold"))
SETTINGS = pack_config(CONFIG)
QUIET = pack_heard(Heard((), b"", None))


@pytest.mark.parametrize(
    ("unpack", "packed", "text"),
    [
        (unpack_order, b"\x80\x04N.", "follow the message's end"),
        (unpack_order, "stop", "came as a str"),
        (unpack_order, encode(["stop"]), "an order is not a map"),
        (unpack_order, encode({}), "an order lacks the field 'kind'"),
        (unpack_order, changed(RUN, "kind", "dance"), "'kind' must be one of run, stop"),
        (unpack_order, changed(RUN, "attempt", 0), "'attempt' must be a whole number"),
        (unpack_order, changed(RUN, "key", "all"), "a trial is not a map"),
        (unpack_order, changed(RUN, "key", {"task": "A"}), "a trial: .* missing"),
        (unpack_order, changed(RUN, "key", asdict(replace(KEY, task="../A"))), "no plain name"),
        (unpack_config, changed(SETTINGS, "policy", [1]), "neither a text nor a list"),
        (unpack_config, changed(SETTINGS, "video", "some"), "'video' must be one of"),
        (unpack_config, changed(SETTINGS, "step_scale", "1"), "'step_scale' must be a number"),
        (unpack_config, changed(SETTINGS, "options", {"timeouts": {}}), "lacks the field 'wait'"),
        (unpack_config, changed(SETTINGS, "expects", {"ws://a": {}}), "spec lacks"),
        (unpack_heard, changed(QUIET, "output", "text"), "'output' must be binary"),
        (unpack_heard, changed(QUIET, "gone", 9), "'gone' must be text"),
        (unpack_heard, changed(QUIET, "said", [1]), "a worker's message is not a map"),
        (unpack_heard, said(0, kind="dance"), "'kind' must be one of ready, beat"),
        (unpack_heard, said(1, state="asleep"), "'state' must be one of"),
        (unpack_heard, said(2, record="{}"), "a record: not a trial record"),
        (unpack_heard, said(2, record=LINE.replace('"steps":9', '"steps":-9')), "steps -9 is no"),
        (unpack_heard, said(2, files={"actions/../run.json": b""}), "is no file of a trial"),
        (unpack_heard, said(2, files={"logs/x.log": b""}), "is no file of a trial"),
        (unpack_heard, said(2, files={TRACE: "text"}), "must be binary"),
        (unpack_heard, said(3, retry=1), "'retry' must be true or false"),
        (unpack_heard, said(3, fault="mine"), "'fault' must be one of"),
    ],
)
def test_what_is_wrong_is_refused_and_named(
    unpack: Callable[[Any], Any], packed: Any, text: str
) -> None:
    with pytest.raises(DecodeError, match=text):
        unpack(packed)


@pytest.fixture
def worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ray_node.NodeWorker:
    """What an actor looks after, without Ray."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))
    monkeypatch.setattr(ray_node.tempfile, "gettempdir", lambda: str(tmp_path))
    fakes = {"world": "run_fakes:FakeWorld", "parts": "run_fakes:parts"}
    config = WorkerConfig(tmp_path / "elsewhere", "run_fakes:FakePolicy", **fakes)  # type: ignore[arg-type]
    made = ray_node.NodeWorker(pack_config(config), "worker-000")
    assert [m[0] for m, _ in unpack_heard(made.hear(60.0)).said] == ["ready"]
    return made


def test_a_worker_hands_over_its_record_and_trace(worker: ray_node.NodeWorker) -> None:
    worker.send(pack_order(("run", KEY, 2, "run_fakes:FakePolicy")))
    *_, (message, files) = unpack_heard(worker.hear(60.0)).said
    assert message[0] == "done"
    assert (message[1].key, message[1].attempts, set(files)) == (KEY, 2, {TRACE})
    worker.send(pack_order(("stop",)))
    assert unpack_heard(worker.hear(60.0)).gone == "exit code 0"


def test_an_order_that_cannot_be_read_ends_the_worker_and_is_told(
    worker: ray_node.NodeWorker,
) -> None:
    worker.send(b"\x80\x04N.")
    gone = unpack_heard(worker.hear(60.0)).gone
    assert gone is not None
    assert gone.startswith("it was sent what cannot be read: ")


def test_what_goes_wrong_in_an_actor_is_told_in_words(
    worker: ray_node.NodeWorker, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(self: object) -> bytes:
        raise OSError("no space left")

    monkeypatch.setattr(ray_node.NodeWorker, "_output", full)
    heard = unpack_heard(worker.hear(0.0))
    assert heard.gone == "OSError: no space left"
    worker._hand.kill()


def test_nothing_of_ray_is_pickled_by_us() -> None:
    for path in Path(ray_messages.__file__).parent.glob("ray_*.py"):
        assert "import pickle" not in path.read_text()
