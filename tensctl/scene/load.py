"""From a scene file, TOML or JSON, to a scene."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import Any

from tensctl.errors import SceneError
from tensctl.scene.complaint import shown
from tensctl.scene.given import place
from tensctl.scene.scene import Scene


def load_scene(path: str | PathLike[str]) -> Scene:
    """Read one scene file; `.json` is read as JSON, everything else as TOML.

    Raises
    ------
    SceneError
        A file that cannot be read or is not in its format (with line and column), or what `Scene` refuses.
    """
    path = place("path", path, "a scene file, TOML or JSON,", SceneError)
    read: tuple[str, Callable[[str], Any]] = ("JSON", _json) if path.suffix == ".json" else ("TOML", tomllib.loads)
    content = _parsed(path, _text(path), *read)
    if not isinstance(content, dict):
        raise SceneError(f"{path}: the file holds {shown(content)}; expected a table with a section structure.")
    try:
        return Scene(**content)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise SceneError(f"{path} does not exist; expected a scene file, TOML or JSON.") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{path} is no text in UTF-8 (byte {error.start}); expected TOML or JSON.") from None
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror}.") from None


def _parsed(path: Path, text: str, format_name: str, parse: Callable[[str], Any]) -> Any:
    try:
        return parse(text)
    except (tomllib.TOMLDecodeError, json.JSONDecodeError, _RepeatedKeyError) as error:
        raise SceneError(f"{path} is no valid {format_name}: {error}.") from None
    except RecursionError:
        raise SceneError(f"{path} is no valid {format_name}: it is nested too deeply.") from None


class _RepeatedKeyError(ValueError):
    """A key that one JSON object has twice."""


def _json(text: str) -> Any:
    return json.loads(text, object_pairs_hook=_without_repeats)


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Refuse repeated keys, as TOML does; JSON readers silently keep the last."""
    table = dict(pairs)
    if len(table) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise _RepeatedKeyError(f"the key {shown(twice)} appears twice in one table")
    return table
