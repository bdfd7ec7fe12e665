"""Values that are tables or of several kinds: a number or one by label, a coefficient or a ratio.

In a table by label the keys are patterns with `*`, in the order given: a later key that matches wins over an
earlier one. Which labels exist is known to the structure alone, and checked there.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic_core import PydanticCustomError

from tensctl.scene.complaint import complaint, shown
from tensctl.scene.values import Number, Value


class Table(Value):
    """A table of values by label pattern or, where `named`, by names that the scene itself gives."""

    def __init__(self, item: Value, *, named: bool = False) -> None:
        self.item, self.named, self.unit = item, named, item.unit

    @property
    def words(self) -> str:
        return f"a table by {'name' if self.named else 'label'}, each {self.item.words}"

    def fits(self, value: Any) -> bool:
        return isinstance(value, Mapping)

    def contents(self, value: Any) -> dict[str, Any]:
        for key in value:
            self._check(key)
        return {str(key): self._entry(str(key), entry) for key, entry in value.items()}

    def _check(self, key: Any) -> None:
        if not (isinstance(key, str) and key):
            raise complaint(f"has the key {shown(key)}; expected {self.words}")
        if self.named and (key == "ratio" or not re.fullmatch(r"[\w+-]+", key)):
            raise complaint('is no name; expected letters, digits, "_", "+" or "-", and not "ratio"', key)

    def _entry(self, key: str, entry: Any) -> Any:
        try:
            return self.item.read(entry)
        except PydanticCustomError as error:
            inner = error.context or {}
            raise complaint(inner["text"], key, *inner["path"]) from None


@dataclass(frozen=True)
class Ratio:
    """A damping given as a fraction of critical damping of the lowest flexible mode at the equilibrium."""

    ratio: float


@dataclass(frozen=True)
class OfCritical(Value):
    """The table `{ ratio = x }`."""

    @property
    def words(self) -> str:
        return "{ ratio = a number >= 0 }"

    def fits(self, value: Any) -> bool:
        return isinstance(value, Ratio) or (isinstance(value, Mapping) and set(value) == {"ratio"})

    def contents(self, value: Any) -> Ratio:
        given = value.ratio if isinstance(value, Ratio) else value["ratio"]
        return Ratio(Table(Number(least=0)).contents({"ratio": given})["ratio"])


class Either(Value):
    """The first of several kinds whose shape a value has."""

    def __init__(self, *kinds: Value) -> None:
        self.kinds = kinds
        self.unit = max(kind.unit for kind in kinds)  # "" where a kind has none

    @property
    def words(self) -> str:
        return ", or ".join(kind.words for kind in self.kinds)

    def fits(self, value: Any) -> bool:
        return any(kind.fits(value) for kind in self.kinds)

    def contents(self, value: Any) -> Any:
        return next(kind for kind in self.kinds if kind.fits(value)).contents(value)


def per_member(number: Number) -> Either:
    """A number for all members, or a table of numbers by label pattern."""
    return Either(number, Table(number))
