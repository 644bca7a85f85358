"""Phrasings of the tasks in which several kinds of action alternate: stamps, clicks, placements."""

from __future__ import annotations

from collections.abc import Sequence

from robospa.tasks.instructions.words import Slots, with_common
from robospa.tasks.instructions.words_procedural import dustbin

STAPLER = (
    ("the stapler", "the desk stapler"),
    ("the paper stapler", "the stapling tool", "the office stapler"),
)
BELL = (
    ("the bell", "the call bell"),
    ("the desk bell", "the service bell", "the counter bell", "the reception bell"),
)

TIMES = {
    1: (("once", "one time"), ("exactly once", "a single time", "just once")),
    2: (("twice", "two times"), ("exactly twice", "just twice", "exactly 2 times")),
    3: (
        ("three times", "3 times"),
        ("exactly three times", "just three times", "exactly 3 times"),
    ),
}
"""How often, as an adverb."""


def stamps(level: int) -> Slots:
    """{seal}, {pad}, {times} up to level 2; from level 3 on the same of both sides.

    At level 5 also {stapler}.
    """
    if level < 3:
        return with_common(
            {
                "seal": (
                    ("the seal", "the stamp", "the hand stamp"),
                    ("the rubber stamp", "the stamper", "the stamping seal"),
                ),
                "pad": (
                    ("the pad", "the square pad"),
                    ("the colored square", "the colored pad", "the flat square pad"),
                ),
                "times": TIMES[level],
            }
        )
    slots: Slots = {"left_times": TIMES[2], "right_times": TIMES[1 if level == 3 else 2]}
    for at in ("left", "right"):
        slots[f"{at}_seal"] = (
            (f"the {at} seal", f"the {at} stamp"),
            (f"the seal on the {at}", f"the {at} rubber stamp", f"the {at} stamper"),
        )
        slots[f"{at}_pad"] = (
            (f"the {at} pad", f"the {at} square"),
            (f"the pad on the {at}", f"the {at} mat", f"the {at} colored pad"),
        )
    if level == 5:
        slots["stapler"] = STAPLER
    return with_common(slots)


def bottles_and_cups(bottles: int, cups: int) -> Slots:
    """{bottles}, {bin}, {side} as for the dustbin; {cup} and {coaster} from one cup on.

    With two cups {cup} is each of them and {coaster} one of its own.
    """
    slots = dustbin(bottles)
    if cups == 1:
        slots["cup"] = (
            ("the cup", "the drinking cup"),
            ("the tumbler", "the only cup", "the cup without a handle"),
        )
        slots["coaster"] = (
            ("the coaster", "the drink coaster"),
            ("the cup mat", "the coaster for drinks", "the drink mat"),
        )
    elif cups == 2:
        slots["cup"] = (
            ("each cup", "each of the two cups"),
            ("every one of the two cups", "each tumbler", "each drinking cup"),
        )
        slots["coaster"] = (
            ("its own coaster", "a coaster of its own"),
            ("a separate coaster", "a different coaster", "a drink mat of its own"),
        )
    return slots


def phone(presses: int, dump: bool) -> Slots:
    """{phone}, {stand}; {stapler} and {times} if there are presses; {bin}, {dustbin} to `dump`."""
    slots: Slots = {
        "phone": (
            ("the phone", "the mobile phone"),
            ("the smartphone", "the cell phone", "the touchscreen phone", "the handset"),
        ),
        "stand": (
            ("the phone stand", "the stand"),
            ("the phone holder", "the stand for phones", "the phone rest"),
        ),
    }
    if presses:
        slots["stapler"] = STAPLER
        slots["times"] = TIMES[presses]
    if dump:
        slots["bin"] = (
            ("the small trash bin", "the little bin"),
            ("the desktop bin", "the tabletop trash bin", "the small desk bin"),
        )
        slots["dustbin"] = (
            ("the dustbin on the left", "the large bin at the robot's left"),
            ("the waste bin left of the table", "the big bin on the left-hand side"),
        )
    return with_common(slots)


def mug(colors: Sequence[str]) -> Slots:
    """{mug}, {rack}; one slot for each block's colour ({red}, ...), and {area} with the first."""
    slots: Slots = {
        "mug": (
            ("the mug", "the coffee mug"),
            ("the china mug", "the tea mug", "the ceramic mug", "the handled cup"),
        ),
        "rack": (
            ("the rack", "the mug rack"),
            ("the mug holder", "the mug tree", "the mug stand"),
        ),
    }
    for color in colors:
        slots[color] = (
            (f"the {color} block", f"the {color} cube"),
            (f"the {color} brick", f"the {color}-colored block", f"the {color}-colored cube"),
        )
    if colors:
        slots["area"] = (
            ("near the robot on the left", "at the left near the robot"),
            (
                "on the near left side of the table",
                "at the table's near left",
                "at the robot's near left",
            ),
        )
    return with_common(slots)


def meal(level: int) -> Slots:
    """{burger}, {tray} (its left half); from level 2 on {fries}, from level 3 on {bell}."""
    slots: Slots = {
        "burger": (
            ("the burger", "the hamburger"),
            ("the round burger", "the grilled burger", "that hamburger", "the beef burger"),
        ),
        "tray": (
            ("the left half of the tray", "the left side of the tray"),
            (
                "the left part of the tray",
                "the tray's left side",
                "the serving tray's left half",
            ),
        ),
    }
    if level >= 2:
        slots["fries"] = (
            ("the box of fries", "the carton of fries"),
            ("the packet of fries", "the fries box", "the pack of fries"),
        )
    if level >= 3:
        slots["bell"] = BELL
    return with_common(slots)


THINGS: Slots = {
    "mouse": (
        ("the computer mouse", "the mouse"),
        ("the PC mouse", "the wireless mouse", "the desktop mouse"),
    ),
    "stapler": STAPLER,
    "rubikscube": (
        ("the Rubik's cube", "the puzzle cube"),
        ("the magic cube", "the colorful cube", "the twisty cube"),
    ),
    "toycar": (
        ("the toy car", "the small car"),
        ("the model car", "the miniature car", "the little car"),
    ),
    "remote_control": (
        ("the remote control", "the remote"),
        ("the TV remote", "the remote controller", "the television remote"),
    ),
}
"""What may be put on the display stand, by asset."""


def scale(level: int, thing: str) -> Slots:
    """{bell}, {scale}; from level 2 on {object} (asset `thing`), {stand}; from 3 on {cards}."""
    slots: Slots = {
        "bell": BELL,
        "scale": (
            ("the scale", "the electronic scale"),
            ("the weighing scale", "the digital scale", "the kitchen scale"),
        ),
    }
    if level >= 2:
        slots["object"] = THINGS[thing]
        slots["stand"] = (
            ("the display stand", "the stand"),
            ("the pedestal", "the showcase stand", "the presentation stand"),
        )
    if level >= 3:
        slots["cards"] = (
            ("the deck of cards", "the pack of playing cards"),
            ("the pack of cards", "the card deck", "the card pack"),
        )
    return with_common(slots)
