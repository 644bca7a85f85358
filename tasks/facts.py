"""What a task drew for a scene besides its objects, typed.

A task declares a frozen dataclass of it: written by `draw`, read by `goal`, `plan` and `slots`.

    @dataclass(frozen=True)
    class Facts(SceneFacts):
        stapler: str
        count: int

    Draft(objects, Facts(stapler="object_0", count=3))   # in `draw`
    Facts.of(scene).count                                # everywhere else

In the scene the facts are plain JSON values. A field at its default is left out, so that what only
some levels have needs a default that says "there is none" ("" or 0).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Protocol, Self


class HasFacts(Protocol):
    """A scene, as far as facts are concerned."""

    @property
    def facts(self) -> Mapping[str, Any]: ...


@dataclass(frozen=True)
class SceneFacts:
    """Base of all facts; fields are strings, numbers, and tuples of them."""

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values by field, without those at their default."""
        values = {f.name: (getattr(self, f.name), f.default) for f in fields(self)}
        return {
            name: _plain(value) for name, (value, default) in values.items() if value != default
        }

    @classmethod
    def of(cls, scene: HasFacts) -> Self:
        """The facts of a scene; what the class has no field for is left out."""
        known = {f.name: scene.facts[f.name] for f in fields(cls) if f.name in scene.facts}
        return cls(**{name: _frozen(value) for name, value in known.items()})


def _plain(value: Any) -> Any:
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value


def _frozen(value: Any) -> Any:
    return tuple(_frozen(item) for item in value) if isinstance(value, list | tuple) else value
