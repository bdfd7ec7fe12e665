"""The values that a scene may hold, each with the words that say what is expected.

A marker stands in a field's annotation, `Annotated[float, Number("N/m", above=0)]`: it reads a value and
complains in the same words whether the value is missing, of the wrong type or out of range. NumPy scalars and
arrays pass for numbers and lists; booleans and strings do not pass for numbers.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from tensctl.scene.complaint import complaint, shown

# A number beyond it is a slip: a product of a few such is no number any more.
_LARGEST = 1e100


class Value(ABC):
    """A kind of value: what it looks like, in code and in words."""

    unit: str = ""

    @property
    @abstractmethod
    def words(self) -> str:
        """What is expected, after "expected ..."."""

    @abstractmethod
    def fits(self, value: Any) -> bool:
        """Whether a value has the right shape; its contents are read after that."""

    @abstractmethod
    def contents(self, value: Any) -> Any:
        """Read a value that fits."""

    def read(self, value: Any) -> Any:
        """Read any value, or raise a complaint."""
        value = value.tolist() if hasattr(value, "tolist") else value  # NumPy's scalars and arrays
        if not self.fits(value):
            raise self.complaint(value)
        return self.contents(value)

    def complaint(self, value: Any) -> PydanticCustomError:
        """Say that a value is not what is expected."""
        return complaint(f"is {shown(value)}; expected {self.words}")

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)


@dataclass(frozen=True)
class Number(Value):
    """A finite number within bounds: `above` and `below` exclude their ends, `least` includes it."""

    unit: str = ""
    above: float | None = None
    least: float | None = None
    below: float | None = None
    whole: bool = False

    @property
    def words(self) -> str:
        bounds = ((">", self.above), (">=", self.least), ("<", self.below))
        limits = " and ".join(f"{sign} {bound:g}" for sign, bound in bounds if bound is not None)
        unit = f"({self.unit})" if self.unit else ""
        return " ".join(filter(None, ["a whole number" if self.whole else "a finite number", limits, unit]))

    def fits(self, value: Any) -> bool:
        return isinstance(value, Integral if self.whole else Real) and not isinstance(value, bool)

    def contents(self, value: Any) -> float | int:
        size = abs(value)
        if not size <= _LARGEST:
            slip = f", {_LARGEST:g} in size at most" if size < math.inf else ""
            raise complaint(f"is {shown(value)}; expected {self.words}{slip}")
        number = int(value) if self.whole else float(value)
        inside = (
            (self.above is None or number > self.above)
            and (self.least is None or number >= self.least)
            and (self.below is None or number < self.below)
        )
        if not inside:
            raise self.complaint(value)
        return number


@dataclass(frozen=True)
class Numbers(Value):
    """A list of finite numbers, as many as `size` says, at least one without."""

    unit: str = ""
    size: int | None = None

    @property
    def words(self) -> str:
        count = "" if self.size is None else f"{self.size} "
        return f"a list of {count}finite numbers" + (f" ({self.unit})" if self.unit else "")

    def fits(self, value: Any) -> bool:
        return isinstance(value, list | tuple) and (len(value) > 0 if self.size is None else len(value) == self.size)

    def contents(self, value: Any) -> tuple[float, ...]:
        try:
            return tuple(Number().read(x) for x in value)
        except PydanticCustomError:
            raise self.complaint(value) from None


@dataclass(frozen=True)
class Vector(Numbers):
    """Three finite numbers, unless another size is said."""

    size: int | None = 3


@dataclass(frozen=True)
class Text(Value):
    """A string that is not empty, unless it may be."""

    noun: str = "text"
    empty: bool = False

    @property
    def words(self) -> str:
        return f"{self.noun} in quotes"

    def fits(self, value: Any) -> bool:
        return isinstance(value, str) and (self.empty or bool(value))

    def contents(self, value: Any) -> str:
        return str(value)


@dataclass(frozen=True)
class Texts(Value):
    """A list of strings, at least `least` of them."""

    noun: str
    example: str
    least: int = 0

    @property
    def words(self) -> str:
        few = f"at least {self.least} " if self.least else ""
        return f"a list of {few}{self.noun} such as {self.example}"

    def fits(self, value: Any) -> bool:
        return (
            isinstance(value, list | tuple)
            and len(value) >= self.least
            and all(isinstance(x, str) and x for x in value)
        )

    def contents(self, value: Any) -> tuple[str, ...]:
        return tuple(map(str, value))


class Choice(Value):
    """One of a few values, of the same type: true is not 1."""

    def __init__(self, *options: object) -> None:
        self.options = options

    @property
    def words(self) -> str:
        return " or ".join(map(shown, self.options))

    def fits(self, value: Any) -> bool:
        return any(type(value) is type(option) and value == option for option in self.options)

    def contents(self, value: Any) -> Any:
        return value


class KindOf(Value):
    """One of a few kinds, or some of a kind by a pattern of labels, `kind:pattern`."""

    def __init__(self, *kinds: str, example: str) -> None:
        self.kinds, self.example = kinds, example

    @property
    def words(self) -> str:
        return f"{', '.join(map(shown, self.kinds))}, or some of these by label such as {shown(self.example)}"

    def fits(self, value: Any) -> bool:
        kind, colon, pattern = value.partition(":") if isinstance(value, str) else ("", "", "")
        return kind in self.kinds and bool(pattern) == bool(colon)

    def contents(self, value: Any) -> str:
        return str(value)


@dataclass(frozen=True)
class Axes(Value):
    """Some of the directions x, y and z, or of those that there are."""

    axes: str = "xyz"

    @property
    def words(self) -> str:
        return f'some of the letters in "{self.axes}"'

    def fits(self, value: Any) -> bool:
        return isinstance(value, str) and 0 < len(value) == len(set(value)) and set(value) <= set(self.axes)

    def contents(self, value: Any) -> str:
        return "".join(sorted(value))


def marker(field: FieldInfo) -> Value | None:
    """The marker in a field's annotation, if it has one."""
    return next((found for found in field.metadata if isinstance(found, Value)), None)


def expected(field: FieldInfo) -> str:
    """What a field expects, in words."""
    found = marker(field)
    return found.words if found else "a table"
