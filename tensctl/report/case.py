"""One case as the report shows it, from the scene to the run; a part that is None is not shown."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tensctl.accuracy import SolverPrecision, WorkPrecision
    from tensctl.analysis import ModalReport, Study
    from tensctl.linear import LinearModel
    from tensctl.model import Term
    from tensctl.simulation import ActuatorDemand, Run, Sanity
    from tensctl.statics import Equilibrium
    from tensctl.structure import Structure
    from tensctl.synthesis import (
        LQG,
        LQR,
        HarmonicLQG,
        HarmonicLQR,
        HarmonicSampledLQR,
        PathSurvey,
        SampledLQR,
        ShapePath,
    )


RELAXED_MORE_THAN = 1e-9  # N; below it a relaxation of the tension floor is the solver's rounding, not a decision


@dataclass(frozen=True)
class Check:
    """A number that says how far a result can be trusted, and the bound it has to keep."""

    name: str
    value: float
    bound: float
    ok: bool
    note: str = ""


@dataclass(frozen=True)
class Limits:
    """What the controller had to respect; None where there was no such limit.

    Attributes
    ----------
    tension_min : float, optional
        Least tension of every tendon, N; a floor that may be relaxed.
    rest_length_floor : (tendons,) array, optional
        Least rest length, m; never violated.
    rate_max : float, optional
        Largest rate of change of a rest length, m/s; never violated.
    floored : (k,) array, optional
        Indices of the tendons that have the tension floor, all by default: one that is slack in the wanted shape, or
        between two pinned nodes, has none.
    """

    tension_min: float | None = None
    rest_length_floor: np.ndarray | None = None
    rate_max: float | None = None
    floored: np.ndarray | None = None


@dataclass(frozen=True)
class Height:
    """Axial height of the structure (m), at the start and at the end of the run."""

    before: float
    after: float


@dataclass(frozen=True)
class Wanted:
    """A number that was wanted of the shape, such as its twist: at the start, in the end, and as wanted."""

    name: str
    unit: str
    before: float
    after: float
    target: float


@dataclass(frozen=True)
class MpcCheck:
    """What the model-predictive controller solved and how it was checked.

    Attributes
    ----------
    solver : str
        Name of the solver.
    horizon : int
        Number of control periods looked ahead.
    dt : float
        Control period, s.
    variables, constraints : int
        Size of the quadratic programme.
    cvxpy_difference : float, optional
        Relative difference of the optimum to that of the same programme stated in cvxpy.
    violations : int
        Recorded times at which a hard limit (rest length, its change, its rate) was violated.
    weighed : str
        What the cost counts.
    travel : float, optional
        Largest change of a rest length over the change that it is allowed.
    feedback : str
        What the controller sees.
    followed : tuple of (label, reach, worst, rms)
        Outputs with a course, the largest change asked of each and its distance from it, in its own unit.
    parted : str, optional
        Where predicted tensions and those of the structure part company; None where they never do.
    """

    solver: str
    horizon: int
    dt: float
    variables: int
    constraints: int
    cvxpy_difference: float | None
    violations: int
    weighed: str = ""
    travel: float | None = None
    feedback: str = ""
    followed: tuple[tuple[str, float, float, float], ...] = ()
    parted: str | None = None


@dataclass(frozen=True)
class Push:
    """A disturbance: ``force`` (3,) N on node number ``node`` from ``begin`` to ``end`` (s)."""

    node: int
    force: tuple[float, float, float]
    begin: float
    end: float


@dataclass(frozen=True)
class Case:
    """Everything that the report shows.

    Attributes
    ----------
    title, version : str
        Title of the scene; version of the package that made the results.
    structure : Structure
        What is built.
    scene_toml : str, optional
        The scene with every default visible.
    equilibrium, linear, controllability, lqr, lqg, path, survey, run, sanity, demand, accuracy, solvers
        Results of the other rooms, read by attribute only: nothing of those rooms is loaded.
    lqr_way, lqg_way : str
        How each was designed, and why so.
    limits : Limits, optional
        Drawn into the plots of the run.
    shape_error : (times,) array, optional
        Largest distance of a node from where it is wanted, at each recorded time of the run, m.
    path_error : (times,) array, optional
        Largest distance of a node from where the planned path has it at that time, m.
    clearance : float, optional
        Distance that rods are asked to keep, m.
    wanted : tuple of Wanted
    overpowered : str, optional
        Which actuators pass their limit of power.
    carried : (float, float), optional
        How far a free controlled structure has moved, m, and turned, rad, as a whole by the end of the run.
    height : Height, optional
    mpc_check : MpcCheck, optional
    study : Study, optional
        What is shown beside the verdicts.
    pushes : tuple of Push
        Disturbances during the run.
    explain : tuple of Term, optional
        The model's terms, in or left out.
    checks : tuple of Check
    seconds : dict
        Name of each stage and the wall time it took, s.
    """

    title: str
    version: str
    structure: Structure
    scene_toml: str | None = None
    equilibrium: Equilibrium | None = None
    linear: LinearModel | None = None
    controllability: ModalReport | None = None
    lqr: LQR | SampledLQR | HarmonicLQR | HarmonicSampledLQR | None = None
    lqr_way: str = ""
    lqg: LQG | HarmonicLQG | None = None
    lqg_way: str = ""
    path: ShapePath | None = None
    survey: PathSurvey | None = None
    run: Run | None = None
    sanity: Sanity | None = None
    demand: ActuatorDemand | None = None
    accuracy: WorkPrecision | None = None
    solvers: SolverPrecision | None = None
    limits: Limits | None = None
    shape_error: np.ndarray | None = None
    path_error: np.ndarray | None = None
    clearance: float | None = None
    wanted: tuple[Wanted, ...] = ()
    overpowered: str | None = None
    carried: tuple[float, float] | None = None
    height: Height | None = None
    mpc_check: MpcCheck | None = None
    study: Study | None = None
    pushes: tuple[Push, ...] = ()
    explain: tuple[Term, ...] | None = None
    checks: tuple[Check, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)
