"""From a wrong value to one sentence: which key, what it is, what is expected."""

from __future__ import annotations

import json
import re
import reprlib
from collections.abc import Mapping, Sequence

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_LONGEST = 60  # characters of a value that a sentence quotes; more would bury what is expected


def complaint(text: str, *path: str) -> PydanticCustomError:
    """Make the error of a validator: what is wrong with its value, or with one at `path` inside it."""
    return PydanticCustomError("tensctl", "{text}", {"text": text, "path": path})


def shown(value: object) -> str:
    """A value as a scene file would spell it, cut short where it is long."""
    if value is None or isinstance(value, bool):
        return {None: "nothing", True: "true", False: "false"}[value]
    if isinstance(value, str):
        return quoted(value if len(value) <= _LONGEST else f"{value[:_LONGEST]}...")
    if isinstance(value, Mapping):
        return "a table" if value else "an empty table"
    text = f"[{', '.join(map(shown, value))}]" if isinstance(value, list | tuple) else reprlib.repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def quoted(text: str) -> str:
    """A string in quotes, with the escapes of TOML: those of JSON, and one for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def sentence(error: ValidationError) -> str:
    """The first complaint of a validation, as one sentence for the user."""
    first = error.errors(include_url=False)[0]
    context = first.get("ctx", {})
    place = dotted([*_without_kind(first["loc"]), *context.get("path", ())])
    if first["type"] == "tensctl":
        text = context["text"]
    else:
        text = f"is {shown(first['input'])}; expected {_expected(first['type'], context, first['msg'])}"
    return f"{place} {text}".strip() + ("" if text.endswith("?") else ".")


def dotted(path: Sequence[str | int]) -> str:
    """A place in the scene as TOML spells it: `tendons.stiffness."t5_*"`, `simulation.push[0].node`."""
    parts = [f"[{key}]" if isinstance(key, int) else f".{_key(key)}" for key in path]
    return "".join(parts).removeprefix(".")


def _key(key: str) -> str:
    return key if _BARE_KEY.fullmatch(key) else quoted(key)


def _without_kind(loc: tuple[str | int, ...]) -> list[str | int]:
    """Leave out the name of the recipe, which pydantic puts between a structure and its keys."""
    return [*loc[:1], *loc[2:]] if loc[:1] == ("structure",) else list(loc)


def _expected(kind: str, context: Mapping[str, object], message: str) -> str:
    words = {
        "bool_type": "true or false",
        "tuple_type": "a list",
        "literal_error": f"{context.get('expected')}",
    }
    return words.get(kind, message[:1].lower() + message[1:]).replace("'", '"')
