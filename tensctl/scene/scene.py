"""The scene: one frozen object with everything that a user asks for."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from tensctl.errors import SceneError
from tensctl.scene.complaint import complaint, sentence
from tensctl.scene.physics import Actuators, Drag, Gravity, Loads, Rods, Tendons
from tensctl.scene.recipe import Recipe, recipe
from tensctl.scene.section import Section
from tensctl.scene.stages import (
    AccuracyStage,
    ControllabilityStage,
    EquilibriumStage,
    LinearizeStage,
    LqgStage,
    LqrStage,
    MpcStage,
    ReportStage,
    SensorsStage,
    SimulationStage,
)
from tensctl.scene.target import TargetStage
from tensctl.scene.toml import document
from tensctl.scene.values import Text


class Scene(Section):
    """What a user asks: a structure, its materials and loads, and the stages to go through.

    Attributes are the keys of the scene file. A stage that nobody asked for is None; `rods`, `tendons` and
    `actuators` are always there, with defaults. Keys that Python reserves have another name: `class` is
    `cls`, `from` and `to` of a push are `start` and `stop`; both spellings are read.

    Parameters
    ----------
    structure : dict or structure
        Recipe (`kind`, and what the kind needs), or anything with a method `as_recipe()`.
    **sections
        Other sections, as dicts: `rods=dict(mass=1.0)`; an empty dict asks for a stage with its defaults.

    Raises
    ------
    SceneError
        One sentence that names the first wrong key, its value and what is expected.
    """

    not_yet: ClassVar[tuple[str, ...]] = ("sweep",)

    title: Annotated[str, Text(empty=True)] = ""
    structure: Recipe
    rods: Rods = Field(default_factory=Rods)
    tendons: Tendons = Field(default_factory=Tendons)
    gravity: Gravity | None = None
    loads: Loads | None = None
    drag: Drag | None = None
    actuators: Actuators = Field(default_factory=Actuators)
    sensors: SensorsStage | None = None
    equilibrium: EquilibriumStage | None = None
    linearize: LinearizeStage | None = None
    controllability: ControllabilityStage | None = None
    lqr: LqrStage | None = None
    lqg: LqgStage | None = None
    mpc: MpcStage | None = None
    target: TargetStage | None = None
    simulation: SimulationStage | None = None
    accuracy: AccuracyStage | None = None
    report: ReportStage | None = None

    def __init__(self, **sections: Any) -> None:
        try:
            super().__init__(**sections)
        except ValidationError as error:
            raise SceneError(sentence(error)) from None

    @field_validator("structure", mode="before")
    @classmethod
    def _recipe(cls, given: Any) -> Any:
        return recipe(given)

    @model_validator(mode="after")
    def _controller_has_its_section(self) -> Self:
        wanted = "none" if self.simulation is None else self.simulation.controller
        if wanted != "none" and getattr(self, wanted) is None:
            raise complaint(
                f'is "{wanted}"; expected a section [{wanted}] in the scene, or another controller',
                "simulation",
                "controller",
            )
        return self

    @model_validator(mode="after")
    def _estimator_has_sensors(self) -> Self:
        if self.lqg is not None and self.sensors is None:
            raise complaint("is there, but nothing is measured; expected a section [sensors] beside it", "lqg")
        if self.mpc is not None and self.mpc.feedback == "outputs" and self.sensors is None:
            raise complaint('is "outputs"; expected a section [sensors] that says what is measured', "mpc", "feedback")
        return self

    @property
    def stages(self) -> dict[str, bool]:
        """Every stage in the order of the work, and whether it is asked for."""
        names = list(type(self).model_fields)
        return {name: getattr(self, name) is not None for name in names[names.index("equilibrium") :]}

    def replaced(self, **sections: Any) -> Scene:
        """Return the same scene with some sections changed, checked like a new one."""
        return Scene(**dict(self.entries()) | sections)

    def to_toml(self) -> str:
        """Spell the scene with every default written out; loading the text gives an equal scene."""
        return document(self)
