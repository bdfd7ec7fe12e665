"""`[target]`: the shape wanted, or several one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import model_validator

from tensctl.scene.complaint import complaint, shown
from tensctl.scene.section import Section
from tensctl.scene.tables import Table
from tensctl.scene.values import Number, Numbers, Vector


class WantedShape(Section):
    """What is wanted of a shape; what is not named goes where the least change takes it."""

    height_scale: Annotated[float | None, Number("of the height at rest", above=0)] = None
    twist: Annotated[float | None, Number("rad, of the top ring about z")] = None
    tip: Annotated[tuple[float, ...] | None, Numbers("m, of the top ring's centre along x and y")] = None
    tilt: Annotated[tuple[float, ...] | None, Numbers("rad, of the top ring's normal towards x and y")] = None
    nodes: Annotated[Mapping[str, tuple[float, float, float]] | None, Table(Vector("m"))] = None

    @property
    def names_a_shape(self) -> bool:
        """Whether anything is wanted."""
        single = (self.height_scale, self.twist, self.tip, self.tilt)
        return any(value is not None for value in single) or bool(self.nodes)

    @model_validator(mode="after")
    def _pairs(self) -> Self:
        for key, unit in (("tip", "m"), ("tilt", "rad")):
            given = getattr(self, key)
            if given is not None and len(given) != 2:
                raise complaint(f"is {shown(given)}; expected two numbers, along x and y ({unit})", key)
        return self


class Waypoint(WantedShape):
    """`[[target.waypoint]]`: a shape on the way, or rounds of the tilt or tip reached before it about the axis."""

    circle: Literal["tilt", "tip"] | None = None
    turns: Annotated[float, Number("rounds, > 0 counter-clockwise")] = 1.0
    duration: Annotated[float | None, Number("s, from the waypoint before", above=0)] = None

    @model_validator(mode="after")
    def _shape_or_circle(self) -> Self:
        if self.names_a_shape == (self.circle is not None):
            had = "both a shape and a circle" if self.names_a_shape else "no shape"
            raise complaint(f"names {had}; expected height_scale, twist, tip, tilt or nodes, or circle alone")
        if self.turns == 0:
            raise complaint("is 0; expected how often to go round, < 0 clockwise", "turns")
        return self


class TargetStage(WantedShape):
    """`[target]`: where the shape should go, and when; or waypoints, each with a time of its own."""

    start: Annotated[float, Number("s", least=0)] = 0.0
    duration: Annotated[float, Number("s", above=0)] = 3.0
    clearance: Annotated[float | None, Number("m, between rods", least=0)] = None
    waypoint: tuple[Waypoint, ...] = ()

    @model_validator(mode="after")
    def _names_shapes(self) -> Self:
        if not self.names_a_shape and not self.waypoint:
            raise complaint("names no shape; expected height_scale, twist, tip, tilt or nodes, or [[target.waypoint]]")
        if self.names_a_shape and self.waypoint:
            raise complaint("names a shape and waypoints; expected one of the two: make the shape the first waypoint")
        return self
