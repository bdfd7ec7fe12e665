"""The structure that a scene asks for: a shell, a prism, or every node and member given, in space or in a plane."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from tensctl.scene.complaint import complaint, shown
from tensctl.scene.section import Section
from tensctl.scene.tables import Either, Table
from tensctl.scene.values import Axes, Choice, Number, Texts, Vector

Pins = Annotated[tuple[str, ...] | dict[str, str], Either(Texts("node labels", '["P1_*_1"]'), Table(Axes()))]
PlanePins = Annotated[tuple[str, ...] | dict[str, str], Either(Texts("node labels", '["a"]'), Table(Axes("xy")))]
Metres = Annotated[float, Number("m", above=0)]
Ends = Table(Texts("node names", '["a", "b"]', least=2), named=True)


class ShellRecipe(Section):
    """`kind = "shell"`: n elements around, m stages high, on a cylinder."""

    kind: Literal["shell"] = "shell"
    n: Annotated[int, Number(least=3, whole=True)]
    m: Annotated[int, Number(least=1, whole=True)]
    cls: Annotated[Literal[1, 2], Choice(1, 2)] = Field(default=1, alias="class")
    primal: bool = Field(default=False, strict=True)
    radius: Metres = 1.0
    height: Metres = 1.0
    overlap: Annotated[float, Number("m")] = Field(
        default_factory=lambda given: 0.3 if given["cls"] == 1 else given["height"] / 2
    )
    twist: Annotated[float, Number("rad")] = Field(
        default_factory=lambda given: 1.4 if given["cls"] == 1 else 2 * math.pi / given["n"]
    )
    pins: Pins = ()


class PrismRecipe(Section):
    """`kind = "prism"`: n rods between two regular polygons."""

    kind: Literal["prism"] = "prism"
    n: Annotated[int, Number(least=3, whole=True)]
    radius: Metres = 1.0
    height: Metres = 1.0
    twist: Annotated[float, Number("rad")] = Field(default_factory=lambda given: prestressed_twist(given["n"]))
    pins: Pins = ()


class NetworkRecipe(Section):
    """`kind = "network"`: nodes (m), rods and tendons by name; a tendon of more than two nodes is a cable."""

    kind: Literal["network"] = "network"
    nodes: Annotated[Mapping[str, tuple[float, float, float]], Table(Vector("m"), named=True)]
    rods: Annotated[Mapping[str, tuple[str, ...]], Ends]
    tendons: Annotated[Mapping[str, tuple[str, ...]], Ends]
    pins: Pins = ()


class PlanarRecipe(Section):
    """`kind = "planar"`: a network in the plane z = 0, whose third dimension is left out."""

    kind: Literal["planar"] = "planar"
    nodes: Annotated[Mapping[str, tuple[float, float]], Table(Vector("m", size=2), named=True)]
    rods: Annotated[Mapping[str, tuple[str, ...]], Ends]
    tendons: Annotated[Mapping[str, tuple[str, ...]], Ends]
    pins: PlanePins = ()


Recipe = Annotated[ShellRecipe | PrismRecipe | NetworkRecipe | PlanarRecipe, Field(discriminator="kind")]
_KINDS = '"shell", "prism", "network" or "planar"'


def prestressed_twist(n: int) -> float:
    """Twist at which an n-rod prism holds prestress, pi/2 + pi/n rad."""
    return math.pi / 2 + math.pi / n


def recipe(given: Any) -> Any:
    """Prepare a structure for reading: ask an object with `as_recipe()` for it, refuse unknown kinds."""
    if isinstance(given, Section):
        return given
    if hasattr(given, "as_recipe"):
        return given.as_recipe()
    if not isinstance(given, Mapping):
        raise complaint(f"is {shown(given)}; expected a table with a kind, or a structure")
    kind = given.get("kind")
    if kind is None:
        raise complaint(f"is missing; expected {_KINDS}", "kind")
    if kind not in ("shell", "prism", "network", "planar"):
        raise complaint(f"is {shown(kind)}; expected {_KINDS}", "kind")
    return given
