"""The scene as TOML text, defaults and units included.

Small on purpose: it knows strings, numbers, booleans, lists, tables and lists of tables, all a scene holds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from tensctl.scene.complaint import dotted, quoted
from tensctl.scene.section import Section
from tensctl.scene.tables import Ratio
from tensctl.scene.values import marker


def document(scene: Section) -> str:
    """Spell a section and all within it."""
    return "\n".join(_table(scene, ())).lstrip("\n") + "\n"


def _table(table: Section | Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Lines of a table: first its plain values, then the tables in it, since a header ends the values."""
    entries = [(key, value) for key, value in _entries(table) if value is not None]
    for key, value in entries:
        if not _is_nested(value):
            unit = "" if isinstance(value, Ratio) else _unit(table, key)
            yield f"{dotted([key])} = {_inline(value)}{unit}"
    for key, value in entries:
        if isinstance(value, Section | Mapping):
            yield from ("", f"[{dotted([*path, key])}]{_unit(table, key)}")
            yield from _table(value, (*path, key))
        elif _is_nested(value):
            for item in value:
                yield from ("", f"[[{dotted([*path, key])}]]")
                yield from _table(item, (*path, key))


def _entries(table: Section | Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    return table.entries() if isinstance(table, Section) else iter(table.items())


def _is_nested(value: Any) -> bool:
    return isinstance(value, Section | Mapping) or (
        isinstance(value, tuple) and bool(value) and isinstance(value[0], Section)
    )


def _unit(table: Section | Mapping[str, Any], key: str) -> str:
    if not isinstance(table, Section):
        return ""
    fields = {field.alias or name: field for name, field in type(table).model_fields.items()}
    found = marker(fields[key])
    return f"  # {found.unit}" if found and found.unit else ""


def _inline(value: Any) -> str:
    if isinstance(value, Ratio):
        return f"{{ ratio = {value.ratio!r} }}"
    if isinstance(value, tuple):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return quoted(value)
    return repr(value)
