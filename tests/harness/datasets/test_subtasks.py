"""A frame belongs to the subtask that is done next."""

from __future__ import annotations

import numpy as np

from robospa.harness.datasets.maker import subtask_of_frames, subtask_texts
from robospa.harness.trial import task_parts
from robospa.tasks.events import Event
from robospa.trial import TrialKey


def test_a_frame_belongs_to_the_subtask_that_is_done_next() -> None:
    events = [
        Event(0.5, "grasped", "b"), Event(1.0, "subtask_done", "b", 1),
        Event(2.0, "subtask_done", "a", 0), Event(2.0, "success"),
    ]  # fmt: skip
    found = subtask_of_frames(events, np.array([0.0, 0.9, 1.0, 1.9, 2.0, 3.0]))
    assert found.dtype == np.int32 and found.tolist() == [1, 1, 0, 0, -1, -1]
    assert subtask_of_frames([], np.zeros(2)).tolist() == [-1, -1]


def test_texts_name_the_objects() -> None:
    parts = task_parts(TrialKey("Place_Bowls_Plates", 2, 1_000_000, split="train"))
    texts = subtask_texts(parts.tracker, parts.scene)
    assert len(texts) == parts.tracker.total
    assert texts[0].startswith(f"1 of {len(texts)}: the ") and "bowl" in texts[0]
