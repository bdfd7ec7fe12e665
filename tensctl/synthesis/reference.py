"""What a predictive controller follows: a planned path, or one equilibrium held for ever."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.model import Dynamics
from tensctl.statics import Equilibrium

# A reference may be beyond the range of inputs by this, m: rounding of the planned equilibria.
_BEYOND = 1e-9


class Reference(Protocol):
    """Nodes, velocities, rest-length changes and tensions over time.

    One that comes to rest for good may say when, as `ends`, s: what a controller needs of it is then computed once.
    """

    @property
    def equilibria(self) -> tuple[Equilibrium, ...]:
        """Equilibria on the way, first to last."""
        ...

    def inputs_at(self, t: float | np.ndarray) -> np.ndarray:
        """Rest-length changes, (..., nu) m."""
        ...

    def tensions_at(self, t: float | np.ndarray) -> np.ndarray:
        """Tensions, (..., nt) N."""
        ...

    def nodes_at(self, t: float) -> np.ndarray:
        """Nodes, (N, 3) m."""
        ...

    def velocities_at(self, t: float) -> np.ndarray:
        """Node velocities, (N, 3) m/s."""
        ...

    def knot_at(self, t: float) -> int:
        """Index of the nearest equilibrium."""
        ...


@dataclass(frozen=True, eq=False)
class Hold:
    """One equilibrium for ever; a subclass that asks for anything else at some time says so by its `ends`."""

    equilibrium: Equilibrium
    ends: ClassVar[float] = -np.inf

    @property
    def equilibria(self) -> tuple[Equilibrium, ...]:
        """The one equilibrium."""
        return (self.equilibrium,)

    def inputs_at(self, t: float | np.ndarray) -> np.ndarray:
        """The same inputs at every time, m."""
        return np.broadcast_to(self.equilibrium.inputs, (*np.shape(t), self.equilibrium.inputs.size))

    def tensions_at(self, t: float | np.ndarray) -> np.ndarray:
        """The same tensions at every time, N."""
        return np.broadcast_to(self.equilibrium.tensions, (*np.shape(t), self.equilibrium.tensions.size))

    def nodes_at(self, t: float) -> Float[np.ndarray, "nodes 3"]:
        """The same nodes at every time, m."""
        return self.equilibrium.nodes

    def velocities_at(self, t: float) -> Float[np.ndarray, "nodes 3"]:
        """At rest."""
        return np.zeros_like(self.equilibrium.nodes)

    def knot_at(self, t: float) -> int:
        """The only one."""
        return 0


def check_reference(reference: Any, dynamics: Dynamics) -> None:
    """Refuse what is no reference, or one of another structure.

    Raises
    ------
    SynthesisError
        With what was given.
    """
    if not hasattr(reference, "equilibria"):
        raise SynthesisError(f"path is of type {type(reference).__name__}; the ShapePath of tc.plan_shape is expected.")
    theirs, ours = reference.equilibria[0].structure, dynamics.structure
    if theirs.node_labels != ours.node_labels or theirs.tendon_labels != ours.tendon_labels:
        raise SynthesisError(
            f"path is of another structure, with {len(theirs.nodes)} nodes and {len(theirs.tendons)} tendons where the "
            f"model has {len(ours.nodes)} and {len(ours.tendons)}; plan it for the model's scene."
        )


def rests(reference: Reference, t: float) -> bool:
    """Whether a reference says that it is at rest from time t on."""
    return t >= getattr(reference, "ends", np.inf)


def outputs_along(reference: Reference, linear: LinearModel, times: Float[np.ndarray, " k"]) -> np.ndarray:
    """What the outputs of a linear model are on a reference, in total, (k, ny)."""
    held = isinstance(reference, Hold)
    rows = []
    for t in times[:1] if held else times:
        nodes = reference.nodes_at(t)
        lengths = linear.dynamics.structure.lengths_at(nodes)
        raw = [nodes.ravel(), reference.velocities_at(t).ravel(), lengths, reference.tensions_at(t)]
        rows.append(linear.outputs_map.weights @ np.concatenate(raw))
    return np.tile(rows[0], (len(times), 1)) if held else np.stack(rows)


def refuse_beyond(reference: Reference, labels: tuple[str, ...], allowed: tuple[np.ndarray, np.ndarray]) -> None:
    """Refuse a reference that rests where no input may go.

    Raises
    ------
    SynthesisError
        With the first planned shape and the input that is farthest out of its range.
    """
    for k, equilibrium in enumerate(reference.equilibria):
        beyond = np.maximum(allowed[0] - equilibrium.inputs, equilibrium.inputs - allowed[1])
        worst = int(beyond.argmax())
        if beyond[worst] > _BEYOND:
            raise SynthesisError(
                f"planned shape {k} needs {labels[worst]} = {equilibrium.inputs[worst]:.4g} m, and it may only be "
                f"{allowed[0][worst]:.4g} to {allowed[1][worst]:.4g} m; raise u_max or choose a nearer target."
            )
