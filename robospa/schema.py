"""Values from outside (messages, records, manifests, cards) as typed objects: one way for all.

A schema is a dataclass or a `msgspec.Struct` whose annotations say what is allowed:

    @dataclass(frozen=True)
    class Camera:
        name: Annotated[str, one_of(("head", "front"))]
        width: Annotated[int, Meta(ge=1, le=8192)] = 320
        labels: Annotated[tuple[str, ...], Meta(max_length=8)] = ()

    camera = read(Camera, value, "camera", DecodeError)

`msgspec.convert` does the work. Types are strict (true is no number, and neither is "3"), fields
without a default are required, unknown fields are ignored; `Any` and numpy arrays pass as they are.
`parse_json` makes such values of JSON with Python's own decoder, which alone can be made to see
that a field is there twice.

A refusal is raised as the caller's own error, whose one sentence names the field, what was expected
and what came:

    camera: 'width' must be a whole number >= 1, not 0
    camera: 'name' must be one of head, front, not 'top'
    camera lacks the field 'name'
    spec: 'cameras[1].width' must be a whole number, not '320'

Rules between fields (one at most as large as another, no name twice) have no place in annotations:
check them after `read`, or in `__post_init__`, whose ValueError comes out in the same way.
"""

import json
import re
import threading
from collections.abc import Callable, Iterable
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta

T = TypeVar("T")

_WORDS: dict[str, str] = {}
"""What a pattern asks for, in words."""


def pattern(regex: str, words: str) -> Meta:
    """The rule that a text matches `regex` as a whole; `words` say what that means."""
    whole = rf"^(?:{regex})\Z"
    if _WORDS.setdefault(repr(whole), words) != words:
        raise ValueError(f"the pattern {regex} is called {_WORDS[repr(whole)]!r} already")
    return Meta(pattern=whole)


def one_of(choices: Iterable[str]) -> Meta:
    """The rule that a text is one of `choices`."""
    known = tuple(choices)
    return pattern("|".join(map(re.escape, known)), f"one of {', '.join(known)}")


Identifier = Annotated[
    str,
    pattern(
        r"(?:[A-Za-z0-9_+-][A-Za-z0-9_.+-]{0,127})?",
        "at most 128 letters, digits and _ - . +, and not begin with a dot",
    ),
]
"""Text that is safe as part of a file's name; may be empty."""

Name = Annotated[
    str,
    pattern(
        r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}",
        "a plain name of at most 100 letters, digits and _ - ., which begins with none of - .",
    ),
]
"""Text that becomes part of a path: a task or split."""

SettingName = Annotated[
    str,
    pattern(
        r"[A-Za-z0-9_][A-Za-z0-9_.:,=+-]{0,119}",
        "a name of at most 120 letters, digits and _ - . : , = +, which begins with a letter, "
        "digit or _",
    ),
]
"""Text that says how something is put together: a robot, a scene mode."""
MAX_INTEGER = 2**53
"""Largest integer of a field: larger ones are not exact as a double."""
Integer = Annotated[int, Meta(ge=-MAX_INTEGER, le=MAX_INTEGER)]
Count = Annotated[int, Meta(ge=0, le=MAX_INTEGER)]
Number = Integer | Annotated[float, Meta(ge=-MAX_INTEGER, le=MAX_INTEGER)]
"""A finite number; a whole one stays an int."""
Sha256 = Annotated[str, pattern(r"[0-9a-f]{64}", "64 hexadecimal digits in lower case")]

_TYPES = {
    "int": "a whole number",
    "float": "a number",
    "str": "text",
    "bool": "true or false",
    "object": "a map",
    "array": "a list",
    "numpy.ndarray": "an array",
}
"""What is called how in a sentence."""
_STEP = re.compile(r"\.(\w+)|\[(\d+)\]")
_CONVERTING = threading.RLock()
"""Held while msgspec reads: two threads that meet a dataclass for the first time at once end the
process (seen with msgspec 0.22, signal 11)."""


def convert(value: object, schema: Any, **options: Any) -> Any:
    """`msgspec.convert`, by one thread at a time; raises what it raises."""
    with _CONVERTING:
        return msgspec.convert(value, schema, **options)


def read(
    schema: type[T], value: object, what: str, error: Callable[[str], Exception] = ValueError
) -> T:
    """`value` (None, numbers, texts, lists, maps) as a `schema`, or `error` with one sentence.

    `what` is what `value` is called in that sentence, such as "spec".
    """
    try:
        result: T = convert(value, schema)
    except msgspec.ValidationError as failure:
        raise error(_sentence(value, what, str(failure))) from None
    return result


def parse_json(text: str) -> Any:
    """The JSON value in `text`; NaN and infinities are numbers, as `json.loads` reads them.

    Raises ValueError if there is none, a field is there twice, it is nested without end, or holds
    text that cannot be written down.
    """
    try:
        value = _DECODER.decode(text)
    except RecursionError:
        raise ValueError("it is nested without end") from None
    except ValueError as error:
        raise ValueError(" ".join(str(error).split())[:200]) from None
    if "\\u" in text:
        try:
            json.dumps(value, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            raise ValueError("it holds half of a character (a lone surrogate)") from None
    return value


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; one that gives a field twice is refused: which value would be true?"""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for place, name in enumerate(names) if name in names[:place])
        raise ValueError(f"the field {twice[:80]!r} is there twice")
    return found


_DECODER = json.JSONDecoder(object_pairs_hook=_without_repeats)


def describe(value: object) -> str:
    """A short name for a value that came in place of another."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return repr(value)[:60]
    return f"a {type(value).__name__}"


def _sentence(value: object, what: str, failure: str) -> str:
    """What msgspec refused, such as "Expected `int` >= 1 - at `$.cameras[0].width`", in words."""
    text, _, path = failure.partition(" - at `")
    if path.startswith("key`"):
        rule = _WORDS.get(text.partition(" matching regex ")[2])
        keys = f"a map whose keys are each {rule}" if rule else "a map with text keys"
        text, path = f"Expected `{keys}`", path.partition("`$")[2]
    path = path.removeprefix("$").rstrip("`")
    name = path.removeprefix(".").replace("[...]", "")
    if missing := re.fullmatch(r"Object missing required field `(.+)`", text):
        return f"{what}{name and f': {name!r}'} lacks the field {missing[1]!r}"
    if unknown := re.fullmatch(r"Object contains unknown field `(.+)`", text, re.DOTALL):
        return f"{what}{name and f': {name!r}'} has the unknown field {unknown[1][:80]!r}"
    refused = re.fullmatch(r"Expected `([^`]+)`(?:, got `[^`]+`)?(.*)", text)
    if not refused:  # the words of a `__post_init__`
        return f"{what}: {text}"
    found, known = _at(value, path)
    came = f", not {describe(found)}" if known else ""
    return f"{what}{name and f': {name!r}'} must be {_expected(refused[1], refused[2])}{came}"


def _expected(kinds: str, bound: str) -> str:
    """The types and the bound that msgspec names, in words."""
    if bound.startswith(" matching regex "):
        return _WORDS.get(bound.removeprefix(" matching regex "), f"text{bound}")
    kinds = kinds.replace("int | float", "float")
    words = [_TYPES.get(kind, kind) for kind in kinds.split(" | ")]
    return (_TYPES.get(kinds) or " or ".join(words)) + bound


def _at(value: Any, path: str) -> tuple[object, bool]:
    """What lies at a path such as `.cameras[0].width`, and whether the path says where that is."""
    if "[...]" in path:
        return None, False
    for name, index in _STEP.findall(path):
        value = value[name] if name else value[int(index)]
    return value, True
