"""The stages that a scene may ask for; the presence of a section asks for its stage."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from tensctl.scene.complaint import complaint, shown
from tensctl.scene.section import Section
from tensctl.scene.tables import Table, per_member
from tensctl.scene.values import Choice, KindOf, Number, Numbers, Text, Texts, Vector

Output = Annotated[str, KindOf("nodes", "velocities", "lengths", "tensions", example="nodes:P4_*")]
Tolerance = Annotated[float, Number(above=0, below=1)]
Size = float | dict[str, float]
Method = Literal["splitting2", "splitting4", "splitting6", "dopri5", "rosenbrock", "cvodes", "idas"]


class EquilibriumStage(Section):
    """`[equilibrium]`: where the structure rests."""

    tol: Tolerance = 1e-12
    max_iterations: Annotated[int, Number(least=1, whole=True)] = 200


class LinearizeStage(Section):
    """`[linearize]`: the linear model at rest, with the outputs asked for.

    An output is a kind, "tensions", or some of a kind by a pattern of labels, "tensions:t5_*"; `mix` adds weighted sums
    of outputs by name. `on_boundary` says what a tendon on the slack boundary is taken for.
    """

    outputs: tuple[Output, ...] = ("nodes", "tensions")
    mix: Annotated[Mapping[str, Mapping[str, float]] | None, Table(Table(Number()), named=True)] = None
    on_boundary: Literal["refuse", "taut", "slack"] = "refuse"

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        if len(set(self.outputs)) < len(self.outputs):
            raise complaint(f"is {shown(self.outputs)}; expected each output once", "outputs")
        return self


class MoveRequest(Section):
    """`[[controllability.move]]`: which tendons to pull to move a node."""

    node: Annotated[str, Text("a node label")]
    by: Annotated[tuple[float, float, float], Vector("m")]
    goal: Literal["least change", "fewest tendons"] = "least change"
    tension_min: Annotated[float, Number("N", least=0)] = 0.0


class ControllabilityStage(Section):
    """`[controllability]`: which tendons move what, and what no tendon moves."""

    horizon: Annotated[float | None, Number("s", above=0)] = None
    place: Annotated[int | None, Number("actuators", least=1, whole=True)] = None
    redundancy: Annotated[bool, Choice(True, False)] = False
    move: tuple[MoveRequest, ...] = ()


class CostStage(Section):
    """Weights of the modes' energy and of the inputs, and sizes that count 1 in the cost."""

    energy_weight: Annotated[float, Number(above=0)] = 1.0
    input_weight: Annotated[float, Number(above=0)] = 1.0
    nodes: Annotated[Size | None, per_member(Number("m", above=0))] = None
    tensions: Annotated[Size | None, per_member(Number("N", above=0))] = None
    rest_lengths: Annotated[Size | None, per_member(Number("m", above=0))] = None


class FeedbackStage(CostStage):
    """State or output feedback by a Riccati equation.

    `way` says whether a cyclically symmetric structure is designed harmonic by harmonic; auto: where that is faster.
    """

    stabilisable_only: bool = Field(default=False, strict=True)
    way: Literal["auto", "harmonics", "dense"] = "auto"

    @model_validator(mode="after")
    def _leaves_out_densely(self) -> Self:
        if self.way == "harmonics" and self.stabilisable_only:
            raise complaint('is "harmonics", which leave no mode out; expected "dense" with stabilisable_only', "way")
        return self


class LqrStage(FeedbackStage):
    """`[lqr]`: state feedback, of the sampled loop where a period is given."""

    dt: Annotated[float | None, Number("s", above=0)] = None


class SensorsStage(Section):
    """`[sensors]`: what is measured, each by the standard deviation of a sample."""

    lengths: Annotated[Size | None, per_member(Number("m", above=0))] = None
    tensions: Annotated[Size | None, per_member(Number("N", above=0))] = None
    nodes: Annotated[Size | None, per_member(Number("m", above=0))] = None
    seed: Annotated[int, Number(least=0, whole=True)] = 0

    @model_validator(mode="after")
    def _measures(self) -> Self:
        if self.lengths is None and self.tensions is None and self.nodes is None:
            raise complaint("measures nothing; expected lengths, tensions or nodes, each with its noise")
        return self


class LqgStage(FeedbackStage):
    """`[lqg]`: output feedback from the sensors."""

    force_noise: Annotated[Size, per_member(Number("N s^1/2", least=0))] = 0.1
    dt: Annotated[float, Number("s", above=0)] = 0.02
    order: Annotated[int | None, Number("states", least=1, whole=True)] = None

    @model_validator(mode="after")
    def _reduced_densely(self) -> Self:
        if self.way == "harmonics" and self.order is not None:
            raise complaint('is "harmonics", which keep all states; expected "dense" with order', "way")
        return self


class FollowRequest(Section):
    """`[[mpc.follow]]`: an output that leaves what it is on the path, by a change that is linear between times."""

    output: Annotated[str, Text("the label of an output, like P4_1_1_x, l_t5_1_1 or T_t5_1_1")]
    size: Annotated[float, Number("in the output's unit", above=0)]
    times: Annotated[tuple[float, ...], Numbers("s")]
    change: Annotated[tuple[float, ...], Numbers("in the output's unit")]

    @model_validator(mode="after")
    def _a_course(self) -> Self:
        if len(self.change) != len(self.times):
            raise complaint(
                f"is {shown(self.change)}; expected one number for each of {len(self.times)} times", "change"
            )
        if any(later <= earlier for earlier, later in pairwise(self.times)):
            raise complaint(f"is {shown(self.times)}; expected times that ascend, each after the last", "times")
        return self


class MpcStage(CostStage):
    """`[mpc]`: predictive control with limits on tension, rest length, its change and its rate.

    With `feedback = "outputs"` it sees the sensors only, and estimates disturbances; `track` names the sensors whose
    values are to be reached, `force_noise` and `drift` are what its filter expects.
    """

    horizon: Annotated[int, Number("control periods", least=1, whole=True)] = 20
    dt: Annotated[float, Number("s", above=0)] = 0.02
    tension_min: Annotated[float, Number("N", least=0)] = 0.1
    rate_max: Annotated[float, Number("m/s", above=0)] = 0.5
    u_max: Annotated[Size | None, per_member(Number("m", above=0))] = None
    solver: Literal["auto", "dual", "primal", "daqp", "osqp", "piqp", "clarabel"] = "auto"
    delay: Annotated[float, Number("s", least=0)] = 0.0
    modes: Literal["refuse", "truncate"] = "refuse"
    feedback: Literal["states", "outputs"] = "states"
    track: Annotated[tuple[str, ...], Texts("labels of sensors", '["l_*", "P4_1_1_z"]')] = ()  # none: shape, or all
    force_noise: Annotated[float, Number("N s^1/2", above=0)] = 0.001
    drift: Annotated[float, Number("1/s^1/2", above=0)] = 1.0
    model: Literal["linear", "nonlinear"] = "linear"
    iterations: Annotated[int, Number("roll-outs a step", least=1, whole=True)] = 1
    preview: bool = Field(default=True, strict=True)
    follow: tuple[FollowRequest, ...] = ()

    @model_validator(mode="after")
    def _fits_its_model(self) -> Self:
        plain = (self.solver, self.feedback, self.follow) == ("auto", "states", ())
        if self.model == "nonlinear" and not plain:
            raise complaint('is "nonlinear"; solver, feedback and follow are for "linear", so leave them out', "model")
        if self.model == "linear" and self.iterations != 1:
            raise complaint(f'is {self.iterations}; only model = "nonlinear" repeats its steps', "iterations")
        return self


class PushRequest(Section):
    """`[[simulation.push]]`: a force on a node from one time to another."""

    node: Annotated[str, Text("a node label")]
    force: Annotated[tuple[float, float, float], Vector("N")]
    start: Annotated[float, Number("s", least=0)] = Field(alias="from")
    stop: Annotated[float, Number("s", least=0)] = Field(alias="to")

    @model_validator(mode="after")
    def _lasts(self) -> Self:
        if not self.start < self.stop:
            raise complaint(f"is {shown(self.stop)}; expected a time after from = {self.start} (s)", "to")
        return self


class WaveRequest(Section):
    """`[[simulation.wave]]`: a sinusoidal force on a node, from one time to another."""

    node: Annotated[str, Text("a node label")]
    force: Annotated[tuple[float, float, float], Vector("N")]
    frequency: Annotated[float, Number("Hz", above=0)]
    phase: Annotated[float, Number("rad")] = 0.0
    start: Annotated[float, Number("s", least=0)] = Field(default=0.0, alias="from")
    stop: Annotated[float | None, Number("s", above=0)] = Field(default=None, alias="to")


class HistoryRequest(Section):
    """`[[simulation.history]]`: a force on a node, its factor interpolated linearly between times."""

    node: Annotated[str, Text("a node label")]
    force: Annotated[tuple[float, float, float], Vector("N")]
    times: Annotated[tuple[float, ...], Numbers("s")]
    factors: Annotated[tuple[float, ...], Numbers()]


class ScheduleRequest(Section):
    """`[[simulation.schedule]]`: planned rest-length change of tendons, linear between times; > 0 shortens."""

    tendon: Annotated[str, Text("a tendon label")]
    times: Annotated[tuple[float, ...], Numbers("s")]
    change: Annotated[tuple[float, ...], Numbers("m")]


class SimulationStage(Section):
    """`[simulation]`: the run of the full nonlinear structure."""

    t_end: Annotated[float, Number("s", above=0)]
    controller: Literal["none", "lqr", "lqg", "mpc"] = "none"
    method: Literal["auto", Method] = "auto"
    tol: Tolerance = 1e-10
    start: Literal["auto", "nodes", "equilibrium"] = "auto"
    store: bool = Field(default=False, strict=True)
    chunk: Annotated[int, Number("records", least=1, whole=True)] = 100
    velocity: Annotated[tuple[float, float, float] | None, Vector("m/s")] = None
    spin: Annotated[tuple[float, float, float] | None, Vector("rad/s")] = None
    push: tuple[PushRequest, ...] = ()
    wave: tuple[WaveRequest, ...] = ()
    history: tuple[HistoryRequest, ...] = ()
    schedule: tuple[ScheduleRequest, ...] = ()


class AccuracyStage(Section):
    """`[accuracy]`: error against run time of the scene's own motion, by several integrators and tolerances."""

    methods: tuple[Method, ...] = ()  # none: all that apply
    tolerances: Annotated[tuple[float, ...], Numbers()] = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
    error: Annotated[float, Number("m", above=0)] = 1e-6
    t_end: Annotated[float, Number("s", above=0)] = 2.0
    budget: Annotated[float, Number("s", above=0)] = 30.0

    @model_validator(mode="after")
    def _each_once_and_small(self) -> Self:
        for name in ("methods", "tolerances"):
            given = getattr(self, name)
            if len(set(given)) < len(given):
                raise complaint(f"is {shown(given)}; expected each once", name)
        if not all(0 < tol < 1 for tol in self.tolerances):
            raise complaint(f"is {shown(self.tolerances)}; expected numbers > 0 and < 1", "tolerances")
        return self


class ReportStage(Section):
    """`[report]`: one HTML file with what was found."""
