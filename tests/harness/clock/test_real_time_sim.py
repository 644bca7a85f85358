"""Real time in the simulator: without latency nothing changes, and every trial comes again."""

from dataclasses import replace

import pytest

from robospa.baselines.reactive import Reactive
from robospa.harness.clock.policy_clock import PolicyClock, parse_latency, parse_switching
from robospa.harness.clock.real_time import ENTRY
from robospa.harness.replay import replay
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.results.records.runs import differences
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim

KEYS = [TrialKey(task, 1, 100000) for task in ("Press_Stapler_Repeat", "Pick_Blocks_Size")]


def play(
    world: SapienWorld,
    key: TrialKey,
    clock: PolicyClock | None,
    recorder: ActionRecorder | None = None,
) -> TrialRecord:
    policy = Reactive(chunk=8, rate=16.67, feedback=True)
    return run_trial(world, policy, key, policy_seed=5, clock=clock, recorder=recorder)


def test_without_latency_it_is_the_paused_clock_at_the_same_rate() -> None:
    world = SapienWorld(render=False, control="fixed_rate", action_steps=15)
    for key in KEYS:
        paused, real = play(world, key, None), play(world, key, PolicyClock())
        rest = {n: v for n, v in real.diagnostics.items() if n != ENTRY}
        assert differences(paused, replace(real, diagnostics=rest)) == []
        assert paused.success and paused.physics_steps <= 15 * paused.steps
    world.close()


def test_a_trial_comes_again_to_the_bit_in_another_order_and_from_its_actions() -> None:
    clock = PolicyClock(parse_latency("p0=20ms,p100=500ms"), parse_switching("arrival"))
    worlds = [SapienWorld(render=False, control="fixed_rate", action_steps=15) for _ in range(2)]
    first = [play(worlds[0], key, clock) for key in KEYS]
    recorder = ActionRecorder()
    play(worlds[1], KEYS[1], clock)
    again = play(worlds[1], KEYS[0], clock, recorder)
    assert differences(first[0], again) == []
    assert first[0].diagnostics[ENTRY] == again.diagnostics[ENTRY]
    assert again.diagnostics[ENTRY]["blind"] > 0 and again.diagnostics[ENTRY]["held"] > 0
    replayed = replay(worlds[0], KEYS[0], recorder.actions, "joint", policy_seed=5)
    assert replayed.digest == again.digest
    for world in worlds:
        world.close()
