"""What the report reads of analysis, design and simulation, by attribute: this room stands alone."""

from typing import Protocol

import numpy as np


class ModeVerdict(Protocol):
    """Whether the tendons drive one mode, and why not if they do not."""

    @property
    def index(self) -> int:
        """Number of the mode, by which tables name it."""
        ...

    @property
    def frequency(self) -> float:
        """Natural frequency, Hz."""
        ...

    @property
    def kind(self) -> str:
        """One of "rigid-body", "flexible", "mechanism" and "unstable"."""
        ...

    @property
    def multiplicity(self) -> int:
        """How many modes share this eigenvalue."""
        ...

    @property
    def gain(self) -> float:
        """Strength with which the inputs drive the mode."""
        ...

    @property
    def distance(self) -> float:
        """Relative distance to a model in which the mode is not driven."""
        ...

    @property
    def tendons(self) -> tuple[str, ...]:
        """Labels of the driving tendons, strongest first."""
        ...

    @property
    def verdict(self) -> str:
        """One of "yes", "no" and "undecided"."""
        ...

    @property
    def reason(self) -> str:
        """Why not, when the verdict is not "yes"."""
        ...


class Controllability(Protocol):
    """What the tendons can move, mode by mode."""

    @property
    def modes(self) -> tuple[ModeVerdict, ...]:
        """A verdict on every mode."""
        ...

    @property
    def controllable_modes(self) -> tuple[int, ...]:
        """Numbers of the modes that are driven."""
        ...

    @property
    def uncontrollable_modes(self) -> tuple[int, ...]:
        """Numbers of the modes that are not driven."""
        ...

    @property
    def note(self) -> str:
        """What else there is to say; may be empty."""
        ...


class Lqr(Protocol):
    """A linear-quadratic regulator and its certificate."""

    @property
    def poles(self) -> np.ndarray:
        """Closed-loop poles (states,), 1/s, complex."""
        ...

    @property
    def residual(self) -> float:
        """Residual of the Riccati equation, relative."""
        ...


class ShapePath(Protocol):
    """Equilibria on the way to the wanted shape."""

    @property
    def time(self) -> np.ndarray:
        """Moments of the path (points,), s."""
        ...

    @property
    def nodes(self) -> np.ndarray:
        """Positions (points, nodes, 3), m."""
        ...

    @property
    def tensions(self) -> np.ndarray:
        """Tendon forces (points, tendons), N."""
        ...

    @property
    def target_nodes(self) -> np.ndarray:
        """Positions in the wanted shape (nodes, 3), m."""
        ...

    @property
    def description(self) -> str:
        """What is wanted and how it is reached, in words."""
        ...


class Run(Protocol):
    """A recorded motion of the structure, with a controller or without."""

    @property
    def time(self) -> np.ndarray:
        """Recorded moments (times,), s."""
        ...

    @property
    def nodes(self) -> np.ndarray:
        """Positions (times, nodes, 3), m."""
        ...

    @property
    def tensions(self) -> np.ndarray:
        """Tendon forces (times, tendons), N."""
        ...

    @property
    def rest_lengths(self) -> np.ndarray:
        """Rest lengths (times, tendons), m."""
        ...

    @property
    def inputs(self) -> np.ndarray:
        """Change of rest length, > 0 shortens (times, inputs), m."""
        ...

    @property
    def input_labels(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def status(self) -> np.ndarray:
        """The controller's word at each recorded time (times,); "" without a controller."""
        ...

    @property
    def sample_time(self) -> np.ndarray:
        """Moments at which the controller solved (steps,), s; empty without MPC, as the next three."""
        ...

    @property
    def solve_time(self) -> np.ndarray:
        """What each solve took (steps,), s."""
        ...

    @property
    def kkt(self) -> np.ndarray:
        """Optimality residual recomputed after each solve (steps,)."""
        ...

    @property
    def relaxed(self) -> np.ndarray:
        """By how much the tension floor had to give way at each solve (steps,), N."""
        ...


class Term(Protocol):
    """One term of the model, in or left out."""

    @property
    def name(self) -> str:
        """What the term is called."""
        ...

    @property
    def included(self) -> bool:
        """True when the term is in the model."""
        ...

    @property
    def why(self) -> str:
        """Why it is in, or why it could be left out."""
        ...

    @property
    def operations(self) -> int | None:
        """Floating-point operations of one evaluation; those saved when the term is left out."""
        ...
