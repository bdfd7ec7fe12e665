"""Arguments of a call from Python, read as the values of a scene are and refused in the same words."""

from __future__ import annotations

from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import PydanticCustomError

from tensctl.errors import SynthesisError, TensctlError
from tensctl.scene.complaint import dotted, shown
from tensctl.scene.values import Value

# Where objects that are not made by their own name come from.
_MADE_BY = {
    "Cost": "the Cost of tc.weights",
    "Dynamics": "the Dynamics of tc.build_dynamics",
    "Equilibrium": "the Equilibrium of tc.find_equilibrium",
    "HarmonicModel": "the HarmonicModel of tc.harmonics",
    "HarmonicOutputs": "what tc.harmonic_outputs gives",
    "LinearModel": "the LinearModel of tc.linearize",
    "Scene": "a Scene, such as tc.load_scene gives,",
    "Sensors": "what tc.sensors gives",
    "ShapePath": "the ShapePath of tc.plan_shape",
    "Structure": "a Structure, such as dynamics.structure,",
}


def argument(name: str, value: Any, kind: Value, error: type[TensctlError] = SynthesisError) -> Any:
    """A value as a scene would read it.

    Raises
    ------
    TensctlError
        Of the class given: what the value is, and what is expected.
    """
    try:
        return kind.read(value)
    except PydanticCustomError as wrong:
        said = wrong.context or {}
        raise error(f"{dotted([*name.split('.'), *said['path']])} {said['text']}.") from None


def real(name: str, value: Any, expected: str, error: type[TensctlError] = SynthesisError) -> np.ndarray:
    """An array of real numbers.

    Raises
    ------
    TensctlError
        Of the class given: what the value is, and what is expected.
    """
    with suppress(TypeError, ValueError):  # rows of different lengths, objects that are no numbers
        found = np.asarray(value)
        if found.dtype.kind in "biufO":
            return found.astype(float)
    raise error(f"{name} is {shown(value)}; {expected} is expected.")


def endless(value: object) -> bool:
    """Whether a value is infinity, for arguments that may be without bound."""
    return isinstance(value, float) and value == np.inf


def place(name: str, value: object, expected: str, error: type[TensctlError] = SynthesisError) -> Path:
    """The path of a file or folder.

    Raises
    ------
    TensctlError
        Of the class given: of what type the value is, and what is expected.
    """
    if not isinstance(value, str | PathLike):
        raise error(f"{name} is of type {type(value).__name__}; {expected} is expected.")
    return Path(value)


def check_kind(kind: type, *, error: type[TensctlError] = SynthesisError, **given: object) -> None:
    """Refuse an object of another kind.

    Raises
    ------
    TensctlError
        Of the class given: the argument, what it is, and what is expected.
    """
    for name, value in given.items():
        if not isinstance(value, kind):
            expected = _MADE_BY.get(kind.__name__, f"a tc.{kind.__name__}")
            raise error(f"{name} is of type {type(value).__name__}; {expected} is expected.")
