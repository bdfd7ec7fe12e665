"""The nonlinear plant: rods' state, rest lengths that ramp, forces that switch on and off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import scipy.sparse.linalg as spl
from jaxtyping import Float

from tensctl.elements import scatter_blocks
from tensctl.errors import SimulationError
from tensctl.model import Dynamics

Method = Literal["auto", "splitting4", "dopri5"]

# Step of the splitting integrator over tol^(1/4) / omega_max; measured on the free (3,1) and (4,2) shells.
_STEP = 8.0
_LONGEST = 0.5
# A step with a switch is halved at most this often.
_DEPTH = 14
# Error allowed in one adaptive step over tol: slack-taut switches let errors add up a hundredfold in a second.
_STRICT = 0.01


class Integrator(Protocol):
    """Moves the rods' state from one time to another."""

    name: str
    evaluations: int
    switches: int

    def advance(
        self, q: np.ndarray, v: np.ndarray, t0: float, t1: float, rest: np.ndarray, rate: np.ndarray, force: np.ndarray
    ) -> None:
        """Change q and v in place."""
        ...


@dataclass(eq=False)
class Splitting4:
    """Order 4 splitting with a step fitted to the stiffest mode."""

    dynamics: Dynamics
    step: float
    name: str = "splitting4"
    evaluations: int = 0
    switches: int = 0

    def advance(self, q, v, t0, t1, rest, rate, force) -> None:
        """Change q and v in place."""
        from tensctl.simulation import splitting

        steps = max(1, int(np.ceil((t1 - t0) / self.step)))
        evaluations, switches = splitting.advance(
            self.dynamics.kernel, q, v, t0, t1, steps, rest, rate, force, splitting.KICKS, splitting.DRIFTS, _DEPTH
        )
        self.evaluations += evaluations
        self.switches += switches


@dataclass(eq=False)
class Dopri5:
    """Adaptive Dormand-Prince 5(4) with projection."""

    dynamics: Dynamics
    tol: float
    rate: float
    name: str = "dopri5"
    evaluations: int = 0
    switches: int = 0
    step: float = 0.0

    def advance(self, q, v, t0, t1, rest, rate, force) -> None:
        """Change q and v in place."""
        from tensctl.simulation import dormand_prince as dp

        size = float(self.dynamics.potential.manifold.lengths.max())
        first = self.step if self.step > 0 else 0.01 / self.rate
        self.step, sides, _ = dp.advance(
            self.dynamics.kernel, q, v, t0, t1, first, rest, rate, force,
            dp.A, dp.ERROR, dp.NODES, _STRICT * self.tol * size, _STRICT * self.tol * size * self.rate,
        )  # fmt: skip
        self.evaluations += sides
        if self.step < 0:
            raise SimulationError(
                f"the step size fell to nothing between {t0:g} and {t1:g} s; loosen tol, or lower the damping."
            )


def choose_integrator(dynamics: Dynamics, method: Method, tol: float) -> Integrator:
    """Splitting for undamped scenes, adaptive explicit steps for damped ones.

    Splitting tables lose their order, and their negative sub-steps anti-damp, when kicks depend on velocity.

    Raises
    ------
    SimulationError
        Splitting asked for a damped scene.
    """
    rate = fastest_rate(dynamics)
    if method == "auto":
        method = "dopri5" if dynamics.damped else "splitting4"
    if method == "splitting4":
        if dynamics.damped:
            raise SimulationError(
                "splitting4 moves undamped scenes only, and this one has dampers or drag; use dopri5."
            )
        return Splitting4(dynamics, min(_STEP * tol**0.25, _LONGEST) / rate)
    return Dopri5(dynamics, tol, rate)


def fastest_rate(dynamics: Dynamics) -> float:
    """A bound on every frequency that the structure can have at rest, rad/s.

    Every tendon counts as taut and as stiff across as along: T/l across is less than k while rest lengths are positive.
    Loads swing a rod with at most omega^2 = 3 f / (m rho).
    """
    squared = _stiffest(dynamics) + _heaviest(dynamics)
    return float(np.sqrt(squared)) if squared > 0 else 1.0


def _stiffest(dynamics: Dynamics) -> float:
    """Largest eigenvalue of the tendons' bound, rad^2/s^2, by Lanczos iteration."""
    structure, members, manifold = dynamics.structure, dynamics.members, dynamics.potential.manifold
    if manifold.size == 0 or not len(structure.tendons):
        return 0.0
    stiffness = members.stiffness if members.law == "k" else members.stiffness / members.rest_lengths
    blocks = stiffness[:, None, None] * np.eye(3)
    tangent = manifold.tangent(structure.nodes)
    root = 1 / np.sqrt(manifold.mass(members.mass))
    matrix = tangent.T @ scatter_blocks(structure.tendons, blocks, len(structure.nodes)) @ tangent
    scaled = matrix.multiply(root).multiply(root[:, None]).tocsr()
    if manifold.size < 4:
        return float(np.abs(np.linalg.eigvalsh(scaled.toarray())).max())
    start = np.ones(manifold.size)
    return float(spl.eigsh(scaled, k=1, v0=start, tol=1e-2, return_eigenvectors=False)[0])


def _heaviest(dynamics: Dynamics) -> float:
    """Largest of 3 f / (m rho) over moving rods, rad^2/s^2."""
    members, manifold = dynamics.members, dynamics.potential.manifold
    loads = np.linalg.norm(members.forces, axis=1)[manifold.rods].sum(axis=1)
    moving = manifold.moving
    lever = 0.5 * manifold.lengths[moving]
    return float((3 * loads[moving] / (members.mass[moving] * lever)).max(initial=0.0))


def state_at(
    dynamics: Dynamics, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
) -> tuple[np.ndarray, np.ndarray]:
    """Rod coordinates and rates, (nr, 6) each.

    Raises
    ------
    SimulationError
        Nodes that do not fit the structure: wrong shape, a rod of another length, a pinned node moved, or
        velocities that stretch a rod.
    """
    structure = dynamics.structure
    for name, array in (("nodes", nodes), ("velocities", velocities)):
        if array.shape != structure.nodes.shape or not np.isfinite(array).all():
            raise SimulationError(f"start {name} have shape {array.shape}; finite {structure.nodes.shape} is expected.")
    q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
    stretch = np.abs(np.linalg.norm(q[:, 3:], axis=1) / structure.rod_lengths - 1)
    if stretch.max(initial=0.0) > 1e-9:
        worst = int(stretch.argmax())
        raise SimulationError(
            f"rod {structure.rod_labels[worst]} starts {stretch[worst]:.1e} of its length too long or short; "
            "rods are rigid, so start from nodes with the structure's rod lengths."
        )
    moved = np.abs(nodes - structure.nodes)[structure.pinned].max(initial=0.0)
    moved = max(moved, np.abs(velocities)[structure.pinned].max(initial=0.0))
    if moved > 1e-9 * np.ptp(structure.nodes, axis=0).max():
        raise SimulationError("a pinned node is moved at the start; pinned nodes stay where the structure has them.")
    along = np.abs(np.einsum("ri,ri->r", q[:, 3:], v[:, 3:])) / structure.rod_lengths
    speed = np.linalg.norm(v[:, 3:], axis=1).max(initial=0.0)
    if along.max(initial=0.0) > 1e-9 * max(speed, 1e-300) and speed > 0:
        raise SimulationError("the start velocities stretch a rod; give velocities of rigid rods.")
    return q, v
