"""Questions of pointing: a picture and a sentence go out, a point comes back, and the simulator
says whether it is on the object that is asked for.

Spatial and basic tasks alone: they ask for one object, and the head camera shows all of theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.protocol.calls import plain_call, read_calls
from robospa.tasks.events import Event
from robospa.tasks.task import Tracker

if TYPE_CHECKING:
    from robospa.harness.policy_calls import PolicyCaller
    from robospa.harness.trial import TrialState

RADIUS = 0.02
"""How far beside an object a point may be and still mean it, as a share of the picture's width:
6 px of 320."""


def answer_question(run: TrialState, answers: PolicyCaller) -> str:
    """Ask the policy of the scene that is loaded, and note what it points at; the end reason.

    What it points at is noted as an object that was taken, so that choices are counted as of other
    trials.
    """
    spec = answers.policy.spec
    call, *_ = read_calls(answers.next_answer(run, spec), spec)
    camera = next(c for c in spec.cameras if c.name == call.camera)
    shown = run.stopwatch.call("rendering", run.world.identify, camera)
    found = meant(shown, call.at or (0.0, 0.0))
    name = run.parts.scene.everything[found].name if found >= 0 else ""
    right = name == asked_for(run.parts.tracker)
    feedback = "done" if right else "another object" if name else "nothing there"
    size = [camera.width, camera.height]
    run.calls.append({**plain_call(call), "size": size, "step": 0, "feedback": feedback})
    if right:
        run.note((Event(0.0, "subtask_done", name, 0), Event(0.0, "success")))
    elif name:
        run.note((Event(0.0, "wrong_object", name),))
    return "success" if right else "done"


def asked_for(tracker: Tracker) -> str:
    """The object that the task of a question asks for."""
    return next(name for name, role in tracker.roles.items() if role.subtasks)


def meant(
    shown: NDArray[np.int16], at: Sequence[float], usable: NDArray[np.bool_] | None = None
) -> int:
    """What the point [u, v] in a picture is on, as `World.identify` numbers it: the object there,
    else the nearest one within RADIUS, else what is there. `usable` says which pixels count, where
    these are not those of all objects."""
    height, width = shown.shape
    column, row = at[0] * width, at[1] * height
    usable = shown >= 0 if usable is None else usable
    pixel = min(int(row), height - 1), min(int(column), width - 1)
    here = int(shown[pixel])
    if usable[pixel]:
        return here
    rows, columns = np.nonzero(usable)
    far = np.hypot(columns + 0.5 - column, rows + 0.5 - row)
    if not len(far) or far.min() > RADIUS * width:
        return here
    nearest = far.argmin()
    return int(shown[rows[nearest], columns[nearest]])


def point_on(mask: NDArray[np.bool_]) -> tuple[float, float]:
    """A point [u, v] on what `mask` (height, width) covers: the pixel of it that is nearest to the
    mean of all."""
    rows, columns = np.nonzero(mask)
    nearest = np.hypot(columns - columns.mean(), rows - rows.mean()).argmin()
    height, width = mask.shape
    return float((columns[nearest] + 0.5) / width), float((rows[nearest] + 0.5) / height)


def box_of(mask: NDArray[np.bool_]) -> list[int]:
    """The box around what `mask` covers: left, top, right and bottom [px], the last two beyond."""
    rows, columns = np.nonzero(mask)
    return [int(x) for x in (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)]
