"""What the members are made of and what acts on them: rods, tendons, gravity, drag, actuators."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from tensctl.scene.complaint import complaint
from tensctl.scene.section import Section
from tensctl.scene.tables import Either, OfCritical, Ratio, Table, per_member
from tensctl.scene.values import Number, Texts, Vector

PerMember = float | Mapping[str, float]
Loads = Annotated[Mapping[str, tuple[float, float, float]], Table(Vector("N"))]

STANDARD_GRAVITY = 9.80665
"""m/s^2, of `[gravity]` without a value: the conventional value at the Earth's surface."""


class Rods(Section):
    """`[rods]`: rigid, uniform and slender.

    `radius` and `EI` move nothing: with them a run is checked for rods that touch, and for rods that would buckle.
    """

    mass: Annotated[PerMember, per_member(Number("kg", above=0))] = 1.0
    radius: Annotated[PerMember, per_member(Number("m", least=0))] = 0.0
    EI: Annotated[PerMember | None, per_member(Number("N m^2", above=0))] = None


class Tendons(Section):
    """`[tendons]`: one of `stiffness` and `EA` is set, and one of `rest_ratio` and `rest_length`.

    The other of each pair is None. A rest ratio may exceed 1: such a tendon starts slack.
    """

    stiffness: Annotated[PerMember | None, per_member(Number("N/m", above=0))] = None
    EA: Annotated[PerMember | None, per_member(Number("N", above=0))] = None
    rest_ratio: Annotated[PerMember | None, per_member(Number(above=0))] = None
    rest_length: Annotated[PerMember | None, per_member(Number("m", above=0))] = None
    damping: Annotated[PerMember | Ratio, Either(OfCritical(), per_member(Number("N s/m", least=0)))] = 0.0

    @classmethod
    def completed(cls, given: dict[str, Any]) -> dict[str, Any]:
        """Set stiffness and rest_ratio where neither they nor their alternatives are given."""
        for usual, other, default in (("stiffness", "EA", 100.0), ("rest_ratio", "rest_length", 0.8)):
            if usual in given and other in given:
                raise complaint(f"is given beside {usual}; expected only one of the two", other)
            if usual not in given and other not in given:
                given = given | {usual: default}
        return given


class Gravity(Section):
    """`[gravity]`: `g` is a number, downwards (-z, or -y of a planar structure), or a vector."""

    g: Annotated[float | tuple[float, float, float], Either(Number("m/s^2"), Vector("m/s^2"))] = STANDARD_GRAVITY


class Drag(Section):
    """`[drag]`: force -c v on each rod end."""

    coefficient: Annotated[float | Ratio, Either(Number("N s/m", least=0), OfCritical())]


class Actuators(Section):
    """`[actuators]`: tendons whose rest length a controller may change, the least it may ask for, speed, force and lag.

    `gangs` are motors that pull several tendons, each a table of gear ratios by tendon label. `force_max` bounds the
    tension of each actuated tendon wherever rest lengths are planned: shape paths and predictive control. `power_max`
    bounds what each motor gives or takes on shape paths, and in predictive control the speed of those with a limit.
    """

    tendons: Annotated[tuple[str, ...], Texts("tendon labels", '["t5_*"]')] = ("*",)
    gangs: Annotated[Mapping[str, Mapping[str, float]] | None, Table(Table(Number()), named=True)] = None
    floor: Annotated[float, Number("of the rest length", above=0, below=1)] = 1e-3
    rate_max: Annotated[float | None, Number("m/s", above=0)] = None
    force_max: Annotated[PerMember | None, per_member(Number("N", above=0))] = None
    power_max: Annotated[float | None, Number("W", above=0)] = None
    lag: Annotated[float, Number("s", least=0)] = 0.0
