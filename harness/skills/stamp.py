"""Stamp: take an object, bring it down onto a target as often as asked, and leave it there."""

from __future__ import annotations

from functools import partial

from robospa.harness.skills.motion import travel
from robospa.harness.skills.pick import pick
from robospa.harness.skills.place import (
    can_follow,
    grip_offset,
    place,
    place_targets,
    reachable_placements,
)
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace
from robospa.tasks.plan import Pick, Place, Stamp

LIFT = 0.08
"""How high the object is lifted from where it stood [m]."""
PRESSED = 0.002
"""How far above the target's surface the object is brought [m]: nearer than it may be, to count."""
ATTEMPTS = 3


def stamp(ws: Workspace, call: Stamp) -> Steps:
    """All stamps with one grasp; the last one leaves the object on its target."""
    down = Place(call.object, on=call.on, drop=PRESSED, arm=call.arm)
    yield from pick(ws, Pick(call.object, LIFT, call.arm), partial(can_follow, ws, down))
    arm = ws.held.index(call.object)
    for _ in range(call.times - 1):
        offset = grip_offset(ws, arm, call.object)
        found = reachable_placements(
            ws, arm, offset, place_targets(ws, down), call.lift, ws.joints[arm]
        )
        if not found:
            raise SkillFailed(f"{call.object} cannot be brought to {call.on}")
        travel(ws, arm, found[0].above)
        ws.add(arm, found[0].joints)
        ws.add(arm, found[0].above)
        yield from ws.flush()
    yield from place(ws, down)
