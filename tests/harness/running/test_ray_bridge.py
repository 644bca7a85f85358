"""Who gets a place where, and what is told when Ray loses something: without a cluster."""

from __future__ import annotations

from concurrent.futures import Future
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import pytest

from robospa.harness.running import ray_bridge
from robospa.harness.running.ray_bridge import Bridge, RaySettings
from robospa.harness.running.ray_messages import Heard, pack_config, pack_heard
from robospa.harness.running.worker import WorkerConfig

pytest.importorskip("ray")


class Call:
    """A method of an actor, or its answer to come."""

    def __init__(self) -> None:
        self.answers: list[Future[Any]] = []

    def remote(self, *_: Any) -> Call:
        self.answers.append(Future())
        return self

    def future(self) -> Future[Any]:
        return self.answers[-1]


class Actor:
    def __init__(self, node: str) -> None:
        self.node = node
        self.killed = False
        self.begin, self.hear, self.send = Call(), Call(), Call()


class FakeRay:
    """As much of Ray as the bridge asks for; also stands for the actor's class."""

    def __init__(self, **cpus: float) -> None:
        self.cpus = dict(cpus)
        self.actors: list[Actor] = []

    def nodes(self) -> list[dict[str, Any]]:
        return [
            {
                "NodeID": name.encode().hex().ljust(56, "0"),
                "NodeManagerAddress": name,
                "Alive": True,
                "Resources": {"CPU": cpus},
            }
            for name, cpus in self.cpus.items()
        ]

    def remote(self, *cls: Any) -> Any:
        if cls:
            return self
        self.actors.append(Actor(self.node))
        return self.actors[-1]

    def options(self, scheduling_strategy: Any, **_: Any) -> FakeRay:
        self.node = bytes.fromhex(scheduling_strategy.node_id).rstrip(b"\0").decode()
        return self

    def kill(self, actor: Actor, no_restart: bool) -> None:
        actor.killed = True


class Rig:
    """A bridge and the driver's end of its pipe."""

    def __init__(self, ray: FakeRay, wish: RaySettings) -> None:
        self.driver, theirs = Pipe()
        self.bridge = Bridge(theirs, ray, pack_config(WorkerConfig(Path("run"), "hold")), wish)
        self.bridge._look()

    def tell(self, *message: Any) -> None:
        self.driver.send(message)
        self.step()

    def step(self) -> None:
        self.bridge._look()
        self.bridge.step(0.0)

    def told(self) -> list[tuple[Any, ...]]:
        found = []
        while self.driver.poll():
            found.append(self.driver.recv())
        return found


def ready(actor: Actor) -> None:
    """The actor's worker is there."""
    actor.hear.answers[-1].set_result(pack_heard(Heard(((("ready", None), {}),), b"", None)))


@pytest.fixture
def ray() -> FakeRay:
    return FakeRay(small=1.0, large=3.0)


def test_the_room_is_what_fits_and_grows_with_the_cluster(ray: FakeRay) -> None:
    rig = Rig(ray, RaySettings(cpus=1.5))
    assert rig.told() == [("room", 2)]
    ray.cpus["new"] = 3.1
    rig.step()
    assert rig.told() == [("room", 4)]
    assert Rig(ray, RaySettings(workers=3)).told() == [("room", 3)]


@pytest.mark.parametrize(
    ("has", "room"),
    [({"CPU": 8.0, "GPU": 1.0}, 8), ({"CPU": 32.0, "GPU": 1.0}, 10), ({"CPU": 32.0}, 0)],
)
def test_a_share_of_a_gpu_counts_too(ray: FakeRay, has: dict[str, float], room: int) -> None:
    assert Rig(ray, RaySettings(gpus=0.1)).bridge._fits(has) == room


def test_workers_go_where_most_is_free(ray: FakeRay) -> None:
    rig = Rig(ray, RaySettings())
    for name in "abcde":
        rig.tell("hire", name)
    assert sorted(actor.node for actor in ray.actors) == ["large", "large", "large", "small"]
    rig.tell("kill", "a")
    assert ray.actors[0].killed
    assert len(ray.actors) == 5  # "e" has got the place of "a"


def test_a_node_that_is_unfit_is_left_out_and_named(ray: FakeRay) -> None:
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    ray.actors[0].begin.answers[0].set_result(["unfit", "it has numpy 1 instead of 2"])
    rig.step()
    rig.step()
    assert ray.actors[1].node == "small"
    told = rig.told()
    assert ("waiting", "a") in told
    assert ("room", 1) in told
    assert "large cannot be used: it has numpy 1 instead of 2" in dict(told)["news"]


def test_a_run_whose_nodes_are_all_unfit_cannot_go_on() -> None:
    ray = FakeRay(only=1.0)
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    ray.actors[0].begin.answers[0].set_result(["unfit", "robospa cannot be imported there"])
    rig.step()
    rig.step()
    assert "robospa cannot be imported" in dict(rig.told())["trouble"]


def test_a_worker_that_was_never_ready_is_placed_again_and_three_times_is_enough() -> None:
    ray = FakeRay(only=1.0)
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    for n in range(ray_bridge.BAD_STARTS):
        assert len(ray.actors) == n + 1
        ray.actors[-1].begin.answers[0].set_exception(RuntimeError("no such thing"))
        rig.step()
    rig.step()
    told = rig.told()
    assert not any(what == "gone" for what, *_ in told)
    assert "workers do not start there (no such thing)" in dict(told)["trouble"]


def test_a_worker_that_was_ready_is_gone_with_its_actor(ray: FakeRay) -> None:
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    ray.actors[0].begin.answers[0].set_result(["placed"])
    rig.step()
    ready(ray.actors[0])
    rig.step()
    ray.actors[0].hear.answers[-1].set_exception(RuntimeError("the node is gone"))
    rig.step()
    assert ("gone", "a", "Ray lost it on large") in rig.told()


def test_a_worker_that_sends_what_cannot_be_read_is_gone(ray: FakeRay) -> None:
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    ray.actors[0].begin.answers[0].set_result(["placed"])
    rig.step()
    ready(ray.actors[0])
    rig.step()
    ray.actors[0].hear.answers[-1].set_result(b"\x80\x04N.")
    rig.step()
    (text,) = [rest[1] for what, *rest in rig.told() if what == "gone"]
    assert text.startswith("large sent what cannot be read: ")
    assert ray.actors[0].killed


@pytest.mark.parametrize(
    ("answer", "text"),
    [
        (["failed", "OSError: no space left"], "(OSError: no space left)"),
        (("maybe", 1), "(it answered ('maybe', 1))"),
    ],
)
def test_a_worker_that_cannot_begin_says_why(answer: Any, text: str) -> None:
    ray = FakeRay(only=1.0)
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    for _ in range(ray_bridge.BAD_STARTS):
        ray.actors[-1].begin.answers[0].set_result(answer)
        rig.step()
    rig.step()
    assert text in dict(rig.told())["trouble"]


def test_what_a_killed_worker_still_says_is_not_heard(ray: FakeRay) -> None:
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    ray.actors[0].begin.answers[0].set_result(["placed"])
    rig.step()
    rig.tell("kill", "a")
    rig.told()
    ready(ray.actors[0])
    rig.step()
    assert rig.told() == []


def test_cpus_that_others_have_are_mentioned_once(
    ray: FakeRay, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig(ray, RaySettings())
    rig.tell("hire", "a")
    monkeypatch.setattr(ray_bridge, "BUSY_SECONDS", -1.0)
    rig.step()
    rig.step()
    news = [text for what, text, *_ in rig.told() if what == "news"]
    assert news == ["1 workers wait for CPUs that other jobs of the Ray cluster use"]
