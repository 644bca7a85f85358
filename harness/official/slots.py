"""What the placeholders of the official sentences stand for in a scene of ours.

The official names of placeholders: one lower-case letter is an arm, everything else a thing or a
word. A value is a word, the side of an arm, or an object of the scene, which the checkout
describes. Arms that no official sentence names are left out, because that changes no sentence. The
arm is the one that the official expert takes, as the fact sheets have it.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from fnmatch import fnmatchcase

from robospa.tasks.colors import nearest
from robospa.tasks.instructions import ordinal
from robospa.tasks.scene import Scene, SceneObject

Value = str | SceneObject
Values = Mapping[str, Value]

CATEGORIES = {"payment_sign": "paymentsign"}
"""Official words for a category that are not our asset's name with spaces."""
VIEWERS = {"robot": "robot's", "opposite": "opposite", "left": "left", "right": "right"}
NOUNS = {
    "Pick_Tea_Box_Relational": "tea box",
    "Pick_Cans_Relational": "can",
    "Pick_Soaps_Relational": "soap bar",
}
"""What a task with equal things calls one of them; the others say "object"."""


class NoOfficialSentence(ValueError):
    """The official benchmark has no sentences for this scene, or none that fits it."""


def official_values(scene: Scene) -> Values:
    """The value of every official placeholder of `scene`, by its name. Raises NoOfficialSentence
    for a task that is not of the official benchmark."""
    found = next((made for name, made in SLOTS.items() if fnmatchcase(scene.task, name)), None)
    if found is None:
        raise NoOfficialSentence(f"{scene.task} is no official task: it has no official sentences")
    return found(scene)


def arms(names: Collection[str]) -> set[str]:
    """Those of the placeholders that stand for an arm."""
    return {name for name in names if len(name) == 1 and name.islower()}


def _side(scene: Scene, name: str) -> str:
    return "left" if scene.object(name).pose.position[0] < 0 else "right"


def _thing(scene: Scene, fact: str) -> SceneObject:
    return scene.object(scene.facts[fact])


def _letters(values: Sequence[Value], first: str = "A") -> dict[str, Value]:
    return {chr(ord(first) + i): value for i, value in enumerate(values)}


def _measure(scene: Scene) -> Values:
    rank = next(int(n) for fact, n in scene.facts.items() if fact.endswith("_rank"))
    return {"A": ordinal(rank)[0]}


def _reference(item: SceneObject) -> str:
    if item.asset == "block":
        return f"{nearest(tuple(item.params['color']))} block"
    if item.asset in ("mug", "pill_bottle") and "tint" in item.params:
        return f"{item.params['tint']} {item.asset.replace('_', '')}"
    return CATEGORIES.get(item.asset, item.asset.replace("_", " "))


def _distance(scene: Scene) -> Values:
    rank = ordinal(scene.facts["distance_rank"])[0]
    return {"A": _reference(_thing(scene, "reference")), "B": rank}


def _canonical(scene: Scene) -> Values:
    facts = scene.facts
    found = {
        "C": ordinal(facts["column"])[0],
        "col_dir": f"from {facts['column_direction'].replace('_', ' ')}",
    }
    if facts.get("row"):
        found["R"] = f"{ordinal(facts['row'])[0]} row"
        found["row_dir"] = f"from {facts['row_direction'].replace('_', ' ')}"
    return found


def _relational(scene: Scene) -> Values:
    noun = NOUNS.get(scene.task, "object")
    label = scene.facts["reference_label"].replace("_", "-")
    side = scene.facts["relation"].replace("_", "-")
    to = {"front": "in front of", "back": "at the back of"}.get(side, f"to the {side} of")
    how = "directly " if scene.level > 1 and "-" not in side else ""
    return {"R": f"{how}{to} the {label} {noun}"}


def _view(scene: Scene) -> Values:
    return {
        "P": f"the {scene.facts['position']} object",
        "V": VIEWERS[scene.facts["viewpoint"]],
    }


def _repeat(fact: str, one_arm: bool) -> Callable[[Scene], Values]:
    def values(scene: Scene) -> Values:
        found: dict[str, Value] = {"A": _thing(scene, fact)}
        if scene.facts["count"] > 1:
            found["B"] = str(scene.facts["count"])
        if one_arm:
            found["a"] = _side(scene, scene.facts[fact])
        return found

    return values


def _bottles(scene: Scene) -> Values:
    dustbin = _thing(scene, "dustbin")
    if scene.level > 1:
        return {"A": dustbin}
    return {"A": scene.object(scene.facts["bottles"][0]), "B": dustbin}


def _apart(scene: Scene) -> Values:
    facts = scene.facts
    if scene.level > 1:
        return {"A": facts["right_color"], "B": facts["left_color"]}
    side = "right" if facts["right"] else "left"
    return {"A": f"{facts[f'{side}_color']} block", "B": side}


def _bowls(scene: Scene) -> Values:
    plate, bowls = _thing(scene, "plate"), scene.facts["bowls"]
    bowl = scene.object(bowls[0])
    if scene.level == 1:
        return {"A": plate, "B": bowl, "a": _side(scene, bowls[0])}
    return {"A": bowl, "C": plate} if scene.level == 2 else {"A": plate, "B": bowl}


def _food(scene: Scene) -> Values:
    facts = scene.facts
    if scene.level > 1:
        return {"A": facts["forward_kind"], "B": facts["backward_kind"]}
    way = "forward" if facts["forward"] else "backward"
    return {"A": facts[f"{way}_kind"], "B": way, "a": _side(scene, facts[way][0])}


def _in_order(scene: Scene) -> Values:
    order = scene.facts["order"]
    things = _letters([scene.object(name) for name in order])
    return things | _letters([_side(scene, name) for name in order], "a")


def _nothing(scene: Scene) -> Values:
    return {}


Part = tuple[int, str, str]
"""The level from which on a placeholder is there, its name, and its value: a fact that names an
object, "left" or "right", "side:" and a fact, or "=" and a word."""


def _chain(*parts: Part) -> Callable[[Scene], Values]:
    def value(scene: Scene, what: str) -> Value:
        if what in ("left", "right"):
            return what
        if what.startswith("="):
            return what[1:]
        if what.startswith("side:"):
            return _side(scene, scene.facts[what[5:]])
        return _thing(scene, what)

    return lambda scene: {name: value(scene, what) for at, name, what in parts if scene.level >= at}


def _bottle_cup(scene: Scene) -> Values:
    found: dict[str, Value] = {"A": _thing(scene, "dustbin")}
    if scene.level == 1:
        found["B"] = _thing(scene, "bottle_0")
    if scene.level >= 4:
        found |= {"B": _thing(scene, "cup_0"), "C": _thing(scene, "coaster_0")}
    return found


SLOTS: Mapping[str, Callable[[Scene], Values]] = {
    "Press_Stapler_Repeat": _repeat("stapler", one_arm=True),
    "Lift_Pot_Repeat": _repeat("thing", one_arm=False),
    "Lift_Fan_Repeat": _repeat("thing", one_arm=True),
    "Click_Bell_Repeat": _repeat("bell", one_arm=True),
    "Put_Bottles_Dustbin": _bottles,
    "Move_Blocks_Apart": _apart,
    "Move_Playing_Cards_Away": lambda scene: (
        {"A": scene.object(scene.facts["boxes"][0])} if scene.level == 1 else {}
    ),
    "Place_Bowls_Plates": _bowls,
    "Separate_Fries_Bread": _food,
    "Hit_Blocks_Hammer_Order": _chain((1, "A", "hammer"), (1, "a", "side:hammer")),
    "Click_Objects_Order": _in_order,
    "Stamp_Seals_Order": lambda scene: (
        {"A": _thing(scene, "seal")}
        | _letters([color.capitalize() for color in scene.facts["colors"]], "B")
    ),
    "Click_Bell_Clockwise_Order": lambda scene: {
        "B": "top bell" if scene.level == 5 else scene.object(scene.facts["order"][0])
    },
    "Place_Phone_Press_Stapler": _chain(
        (1, "A", "phone"), (1, "B", "phone_stand"), (1, "a", "right"), (2, "C", "stapler"),
        (2, "c", "right"), (5, "D", "table_trash_bin"), (5, "E", "dustbin"), (5, "d", "left"),
    ),
    "Place_Bottle_Cup": _bottle_cup,
    "Hang_Mug_Stack_Blocks": _chain(
        (1, "A", "mug"), (1, "B", "rack"), (2, "C", "=red block"), (3, "D", "=green block"),
        (4, "E", "=blue block"), (5, "F", "=yellow block"),
    ),
    "Place_Object_Scale_Click": _chain(
        (1, "A", "bell"), (1, "B", "scale"), (1, "a", "left"), (2, "C", "object"),
        (2, "D", "stand"), (2, "b", "right"), (3, "E", "cards"), (3, "c", "side:cards"),
        (5, "d", "left"), (5, "e", "right"),
    ),
    "Place_Burger_Fries_Click_Bell": _chain(
        (1, "A", "burger"), (1, "B", "tray"), (1, "a", "left"), (2, "C", "fries"),
        (2, "b", "right"), (3, "D", "bell"), (3, "d", "side:bell"),
    ),
    "Click_Can_Place_Items": _chain(
        (1, "A", "can"), (1, "a", "left"), (2, "B", "basket"), (2, "C", "bread"),
        (2, "b", "right"), (3, "c", "left"), (4, "D", "pill_bottle"), (4, "d", "left"),
        (5, "e", "left"),
    ),
    "Stamp_Seals_Press_Stapler": _chain(
        (1, "a", "left"), (3, "b", "right"), (5, "C", "stapler"), (5, "c", "side:stapler")
    ),
    "Click_Bell_Open_Microwave_Place_Object": _chain(
        (1, "C", "bell"), (1, "a", "left"), (2, "M", "microwave"), (2, "b", "left"),
        (3, "c", "left"), (4, "A", "object"), (4, "B", "reference"), (4, "d", "side:object"),
        (5, "e", "left"),
    ),
    "Remember_Color_Cover": lambda scene: {"A": ", ".join(scene.facts["colors"])},
    "Press_Stapler_Memory": lambda scene: _letters([str(n) for n in scene.facts["counts"]]),
    # What the names of several tasks have in common; the first that fits counts.
    "Pick_*_Distance*": _distance,
    "Pick_*_Canonical*": _canonical,
    "Pick_*_Relational*": _relational,
    "Pick_*_Multi_View*": _view,
    "Pick_Blocks_*": _measure,
    "Rank_Blocks_*": _nothing,
    "Stack_Blocks_*_Order": _nothing,
    "Observe_*_Memory": _nothing,
    "Remember_Orientation_Restore": _nothing,
}  # fmt: skip
"""The placeholders of every official task, by its name or by a pattern of `fnmatch`."""
