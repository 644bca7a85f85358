"""Objects in a colour of choice: any asset of `TINTS` takes the parameter {"tint": "green"}.

The tint replaces the colour of the body, and grey that of prints and trims which would otherwise
look like a second colour. Shapes, mass and grasps stay those of the look.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from robospa.tasks.colors import NAMED
from robospa.tasks.objects.build import fill_phrases
from robospa.tasks.shapes import ObjectModel


@dataclass(frozen=True)
class Tint:
    """Indices of an asset's shapes that make up its `body`, and of those that turn grey."""

    body: tuple[int, ...]
    trim: tuple[int, ...] = ()


TINTS: Mapping[str, Tint] = {
    "mug": Tint((0, 1, 4)),
    "pill_bottle": Tint((1, 4)),
    "cup": Tint((0, 1), (3,)),
    "can": Tint((1,), (3,)),
    "stapler": Tint((5,), (3, 6)),
    "bell": Tint((4,), (3, 6)),
    "apple": Tint((1,)),
    "payment_sign": Tint((3,)),
    "tea_box": Tint((0,), (2, 3)),
    "sauce_can": Tint((2,), (4, 5)),
    "bowl": Tint((0, 2), (1, 3, 4)),
    "toycar": Tint((2, 4), (5, 7)),
    "fan": Tint((3, 4, 5), (7, 9)),
    "tissue_box": Tint((0,), (1,)),
    "french_fries": Tint((2,), (3,)),
}


def tinted(model: ObjectModel, word: str) -> ObjectModel:
    """`model` with a body in the named colour `word`; ValueError for one that does not exist."""
    if word not in NAMED:
        raise ValueError(f"no colour {word!r}; use one of {', '.join(NAMED)}")
    rule = TINTS[model.asset]
    body, trim = NAMED[word], NAMED["gray" if word != "gray" else "white"]
    shapes = list(model.shapes)
    for index in rule.body:
        shapes[index] = replace(shapes[index], color=body, metallic=0.0)
    for index in rule.trim:
        shapes[index] = replace(shapes[index], color=trim)
    return replace(
        model,
        shapes=tuple(shapes),
        phrases=fill_phrases(
            word,
            f"{{}} {model.noun}", f"{model.noun} in {{}}", f"{{}}-coloured {model.noun}",
            f"{model.noun} that is {{}}", f"{model.noun} of {{}} colour",
        ),
    )  # fmt: skip
