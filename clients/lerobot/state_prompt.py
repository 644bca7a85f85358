"""The state that pi0.5 prints into its prompt: versions of LeRobot differ in its length."""

from __future__ import annotations

from typing import Any

from robospa.clients.model_policy import import_torch

STATE = "observation.state"
STATE_STEP = "Pi05PrepareStateTokenizerProcessorStep"


class StateWidth:
    """A processor step that pads or cuts the state before pi0.5 prints it into its prompt."""

    def __init__(self, width: int) -> None:
        self.width = width

    def __call__(self, transition: Any) -> Any:
        """The transition with a state of `width` numbers, zeros appended."""
        torch = import_torch()
        changed = dict(transition)
        observation = dict(changed["observation"])
        state = observation[STATE]
        lacking = self.width - state.shape[-1]
        observation[STATE] = torch.nn.functional.pad(state, (0, lacking)) if lacking > 0 else state
        changed["observation"] = observation
        return changed


def print_state(before: Any, width: int) -> None:
    """Make the processors of pi0.5 print `width` numbers of state; ValueError for others'."""
    steps = list(before.steps)
    places = [i for i, step in enumerate(steps) if type(step).__name__ == STATE_STEP]
    if not places:
        raise ValueError("option state_prompt is for pi0.5: these processors print no state")
    steps[places[0]].max_state_dim = width  # LeRobot < 0.5 pads to this itself
    steps.insert(places[0], StateWidth(width))
    before.steps = steps
