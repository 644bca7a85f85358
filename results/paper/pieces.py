"""What of the official benchmark a run had, piece by piece, as its manifest records it."""

from __future__ import annotations

from dataclasses import dataclass

from robospa.results.records.manifest import Facts, LayoutSettings, RunSettings
from robospa.results.scoring.model_results import ModelResults, suite_of
from robospa.results.scoring.setting import OFFICIAL
from robospa.text import listed

CHECKOUT = "official-checkout"
RULES = "tasks, rules, thresholds, step limits"


@dataclass(frozen=True)
class Pieces:
    """What of a run is `official`, and what is `other` than officially ("another renderer")."""

    official: tuple[str, ...]
    other: tuple[str, ...]


def pieces_of(results: ModelResults) -> Pieces:
    """The pieces of a run."""
    return pieces(suite_of(results), results.manifest.settings)


def pieces(suite: str, settings: RunSettings) -> Pieces:
    """The pieces of a run of `suite` with the `settings` of its manifest; of what the manifest does
    not say, nothing is official."""
    said = _hash(settings.instructions)
    sentences = f"sentences{said}" if said else ""
    if suite == CHECKOUT:
        return _of_checkout(settings.world.arguments)
    if suite.startswith(OFFICIAL):
        return _of_world(settings.layout or LayoutSettings(), settings.world.arguments, sentences)
    official, other = [RULES, "layouts", "the robot"], ["other object meshes", "another renderer"]
    other += ["other seeds"]
    (official if sentences else other).append(sentences or "other sentences")
    return Pieces(tuple(official), tuple(other))


def _of_checkout(world: Facts) -> Pieces:
    config = world.get("config") or "the usual one"
    return Pieces(
        (
            RULES,
            "layouts",
            "objects",
            "sentences",
            "the robot with its meshes",
            f"simulator, planner and renderer (of the user's checkout, configuration: {config})",
        ),
        ("other seeds (valid on the user's machine)", "another machine"),
    )


def _of_world(layout: LayoutSettings, world: Facts, sentences: str) -> Pieces:
    official, other = [RULES, "the robot's joints and cameras"], []
    if layout.assets == "official":
        official.append(f"objects{_hash(layout.digest, 'archive')}")
        other.append("boxes, pads, covers and T blocks made here")
    else:
        other.append("other object meshes")
    if names := layout.switches:
        official.append(f"quirks of scenes ({', '.join(names)})")
    (official if sentences else other).append(sentences or "other sentences")
    meshes = str(world.get("robot_assets", "builtin"))
    full = {"official": " (thinned)"}.get(meshes, "")
    if meshes.startswith("official"):
        official.append(f"the robot's meshes{full}")
    else:
        other.append("other robot meshes")
    if world.get("settle") == "official":
        official.append("the start after 11 s")
    else:
        other.append("another start (when nothing moves)")
    other += ["other draws of layouts", "other seeds", "motions without the official planner"]
    return Pieces(tuple(official), (*other, "another renderer"))


def told(results: ModelResults) -> str:
    """The pieces of a run in a sentence; `in_official_world` says whom it is for."""
    found = pieces_of(results)
    return (
        f"{results.name} ({suite_of(results) or 'suite not stated'}) has of the official benchmark "
        f"{listed(found.official)}; it has {listed(found.other)}."
    )


def _hash(value: object, what: str = "hash") -> str:
    """` (hash 0123456789ab)`; empty if there is none."""
    return f" ({what} {str(value)[:12]})" if value else ""
