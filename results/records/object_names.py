"""Events and evidence name objects as the scene does (`object_1`); readers want to know which."""

from __future__ import annotations

import re
from collections.abc import Mapping

from robospa.results.records.trial_record import TrialRecord


def described(text: str, record: TrialRecord) -> str:
    """`text` with the names of the scene's objects replaced by what the record calls them.

    A record that was written before records described their objects leaves `text` as it is.
    """
    known = record.diagnostics.get("objects")
    return with_names(text, known) if isinstance(known, dict) else text


def with_names(text: str, names: Mapping[str, object]) -> str:
    """`text` with the names of the scene's objects replaced by what `names` calls them."""
    if "object_" not in text:
        return text
    return re.sub(r"\bobject_\d+\b", lambda found: str(names.get(found[0], found[0])), text)
