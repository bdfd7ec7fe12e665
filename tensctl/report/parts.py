"""What the report reads of structure, rest and linear model, by attribute: this room stands alone."""

from typing import Protocol

import numpy as np


class Structure(Protocol):
    """What is built: nodes, rods and tendons with their labels."""

    @property
    def nodes(self) -> np.ndarray:
        """Positions as built (nodes, 3), m."""
        ...

    @property
    def node_labels(self) -> tuple[str, ...]:
        """Names of the nodes, such as P1_2_1."""
        ...

    @property
    def rods(self) -> np.ndarray:
        """Tail and head node of each rod (rods, 2)."""
        ...

    @property
    def rod_labels(self) -> tuple[str, ...]:
        """Names of the rods."""
        ...

    @property
    def tendons(self) -> np.ndarray:
        """Tail and head node of each tendon (tendons, 2)."""
        ...

    @property
    def tendon_labels(self) -> tuple[str, ...]:
        """Names of the tendons, such as t5_2_1."""
        ...

    @property
    def pinned(self) -> np.ndarray:
        """True for a node held by the ground (nodes,)."""
        ...


class Equilibrium(Protocol):
    """Where the structure rests."""

    @property
    def nodes(self) -> np.ndarray:
        """Positions at rest (nodes, 3), m."""
        ...

    @property
    def tensions(self) -> np.ndarray:
        """Tendon forces at rest (tendons,), N."""
        ...

    @property
    def energy(self) -> float:
        """Elastic energy stored, J."""
        ...

    @property
    def residual(self) -> float:
        """Largest unbalanced force over the largest tension or load."""
        ...

    @property
    def iterations(self) -> int:
        """Steps that the solver took."""
        ...

    @property
    def stable(self) -> str:
        """One of "yes", "no", "undecided" and "no prestress"."""
        ...

    @property
    def smallest(self) -> float:
        """Smallest eigenvalue that is no rigid-body motion, rad^2/s^2."""
        ...

    @property
    def tolerance(self) -> float:
        """Below this an eigenvalue counts as zero, rad^2/s^2."""
        ...


class Mode(Protocol):
    """One natural motion about the rest."""

    @property
    def index(self) -> int:
        """Number of the mode, by which tables name it."""
        ...

    @property
    def omega2(self) -> float:
        """Squared natural frequency, rad^2/s^2."""
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
    def name(self) -> str:
        """Such as "translation x"; empty when it has none."""
        ...

    @property
    def cluster(self) -> int:
        """Modes with the same number repeat one eigenvalue."""
        ...

    @property
    def multiplicity(self) -> int:
        """How many modes share this eigenvalue."""
        ...

    @property
    def shape(self) -> np.ndarray:
        """Displacement of each node, in any scale (nodes, 3)."""
        ...


class FlexibleModel(Protocol):
    """The part of the linear model without rigid-body motion."""

    @property
    def A(self) -> np.ndarray:
        """State matrix (flexible states, flexible states), 1/s."""
        ...


class LinearModel(Protocol):
    """How the structure moves close to rest."""

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Every mode, the lowest first."""
        ...

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        ...

    @property
    def flexible(self) -> FlexibleModel:
        """The sub-model without rigid-body motion."""
        ...
