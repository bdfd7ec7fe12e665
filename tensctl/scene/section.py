"""What every section of a scene has in common: frozen, no unknown keys, no missing ones, errors in words.

pydantic holds the sections; the words come from the markers in `values`, so that every complaint about a key
says the same thing whatever was wrong with its value.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from tensctl.errors import SceneError
from tensctl.scene.complaint import complaint, sentence, shown
from tensctl.scene.values import expected


class Section(BaseModel):
    """A table of the scene file; its attributes are its keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_by_name=True, validate_by_alias=True)
    not_yet: ClassVar[tuple[str, ...]] = ()  # keys that the design names and a later version will understand

    @model_validator(mode="before")
    @classmethod
    def _given(cls, given: Any) -> Any:
        """Refuse what is no table, keys that do not exist, and the lack of keys that must be there."""
        if isinstance(given, cls):
            return given
        if not isinstance(given, Mapping):
            raise complaint(f"is {shown(given)}; expected a table with the keys {', '.join(cls.key_names())}")
        present = {key: value for key, value in given.items() if value is not None}  # JSON's null: not given
        for key in present:
            if key not in cls.key_names() and key not in cls.model_fields:
                raise complaint(cls._unknown(str(key)), str(key))
        for name, field in cls.model_fields.items():
            key = field.alias or name
            if key != name and key in present and name in present:
                raise complaint(f"is given twice, as {key} and as {name}", key)
            if field.is_required() and key not in present and name not in present:
                raise complaint(f"is missing; expected {expected(field)}", key)
        return cls.completed(present)

    @classmethod
    def checked(cls, **given: Any) -> Self:
        """The section from arguments of a call, refused in the scene's own words.

        Raises
        ------
        SceneError
            One sentence that names the first wrong argument, its value and what is expected.
        """
        try:
            return cls(**given)
        except ValidationError as error:
            raise SceneError(sentence(error)) from None

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """Fill in defaults that depend on what else is given; most sections have none."""
        return given

    @classmethod
    def key_names(cls) -> list[str]:
        """Keys of the section as the scene file spells them."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    @classmethod
    def _unknown(cls, key: str) -> str:
        if key in cls.not_yet:
            return "is planned, but not supported yet"
        near = difflib.get_close_matches(key, cls.key_names(), n=1)
        if near:
            return f"is no key of a scene; did you mean {near[0]}?"
        known = ", ".join(cls.key_names())
        return f"is no key of a scene; expected {f'one of {known}' if known else 'an empty section'}"

    def entries(self) -> Iterator[tuple[str, Any]]:
        """Keys as the scene file spells them, with their values."""
        for name, field in type(self).model_fields.items():
            yield field.alias or name, getattr(self, name)
