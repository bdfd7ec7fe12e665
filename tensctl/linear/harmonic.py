"""The linear model of a cyclically symmetric structure as n independent blocks of sector size.

    dx_k/dt = A_k x_k + B_k u_k,   k = 0 ... n/2,   x_{n-k} = conj x_k

in the unitary transform of `harmonic_map`: a change of basis and nothing else, so poles, gains, norms and costs are
those of the whole `LinearModel.flexible`, whose matrices are never formed. Exact for a symmetric scene; of one that is
so to a mismatch only, the blocks are those of its first sector repeated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast, get_args

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float, Inexact

from tensctl.errors import LinearizationError
from tensctl.linear.frame import best_fit
from tensctl.linear.harmonic_actuated import ActuatedHarmonic
from tensctl.linear.harmonic_block import Harmonic, Shown
from tensctl.linear.harmonic_find import linear_symmetry
from tensctl.linear.harmonic_inputs import harmonic_gears, input_orbits
from tensctl.linear.harmonic_map import HarmonicMap
from tensctl.linear.lag import lag_felt, recast
from tensctl.linear.linearize import checked_point
from tensctl.linear.model import LinearModel
from tensctl.model import Dynamics
from tensctl.statics import Equilibrium
from tensctl.statics.sector import Sector
from tensctl.threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class HarmonicModel:
    """A linear model in harmonics, rigid-body motions left out, as in `LinearModel.flexible`.

    Attributes
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
        The point of linearisation; states, inputs and outputs are deviations from it.
    map : HarmonicMap
        Between arrays of the whole structure and their harmonics.
    blocks : tuple of Harmonic
        k = 0 ... n/2.
    mismatch : float
        Largest relative difference between a member and its image in the next sector.
    """

    dynamics: Dynamics
    equilibrium: Equilibrium
    map: HarmonicMap
    blocks: tuple[Harmonic, ...]
    mismatch: float

    @property
    def order(self) -> int:
        """The number n of sectors."""
        return self.map.order

    @property
    def nx(self) -> int:
        """Number of real states of the whole structure."""
        return sum(block.copies * block.nx for block in self.blocks)

    @property
    def nu(self) -> int:
        """Number of inputs of the whole structure."""
        return self.map.nu

    @cached_property
    def omega2(self) -> Float[np.ndarray, " modes"]:
        """Squared natural frequencies of the whole structure, rad^2/s^2, ascending, without rigid-body zeros."""
        return np.sort(np.concatenate([np.tile(block.omega2, block.copies) for block in self.blocks]))

    def state_of(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
    ) -> list[Inexact[np.ndarray, " _"]]:
        """States x_k of the nonlinear structure, of a free one in its co-moving frame (see `LinearModel.state_of`)."""
        rest, potential = self.equilibrium.nodes, self.equilibrium.potential
        seen, rates, drift = nodes, velocities, velocities
        if not potential.structure.held.any():
            frame = best_fit(potential, rest, nodes, velocities)
            seen, rates, drift = frame.nodes(nodes), frame.velocities(nodes, velocities), velocities @ frame.rotation
        moved = [*self._chart.at(seen, rates)]
        if any(block.drift.size for block in self.blocks):
            moved.append(self._chart.at(seen, drift)[1])
        result = []
        for block, z in zip(self.blocks, self._weighed(np.column_stack(moved)), strict=True):
            eta = block.shapes.conj().T @ z[:, :2]
            result.append(np.concatenate([block.scales * eta[:, 0], eta[:, 1], block.drift.conj().T @ z[:, -1]]))
        return result

    def seen(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"],
        inputs: Float[np.ndarray, " nu"],
    ) -> list[Inexact[np.ndarray, " _"]]:  # fmt: skip
        """States x_k of the nonlinear structure with its rest-length changes, which are states where actuators lag."""
        states = self.state_of(nodes, velocities)
        if not self.lag:
            return states
        changes = self.map.waves(np.asarray(inputs) - self.equilibrium.inputs)
        return [np.concatenate(pair) for pair in zip(states, changes, strict=True)]

    @property
    def lag(self) -> float:
        """Lag of the actuators that the states carry, s; see `actuated`."""
        return self.blocks[0].lag

    @property
    def actuated(self) -> HarmonicModel:
        """The model whose inputs are commands, as `LinearModel.actuated`."""
        if self.lag or not lag_felt(self.dynamics, float(max(block.scales.max(initial=0.0) for block in self.blocks))):
            return self
        return replace(self, blocks=tuple(recast(block, ActuatedHarmonic) for block in self.blocks))

    @cached_property
    def _chart(self):
        return self.equilibrium.potential.manifold.chart(self.equilibrium.nodes)

    def modal(self, xi: Float[np.ndarray, "size columns"]) -> list[Inexact[np.ndarray, "_ columns"]]:
        """Modal coordinates eta by harmonic, from tangent coordinates of the whole structure."""
        return [block.shapes.conj().T @ z for block, z in zip(self.blocks, self._weighed(xi), strict=True)]

    def _weighed(self, xi: np.ndarray) -> list[np.ndarray]:
        """Harmonics of momenta, from tangent coordinates of the whole structure."""
        rods = self.map.point.sector.symmetry.rods[0]
        mass = self.map.point.sector.manifold.mass(self.dynamics.members.mass[rods])[:, None]
        return [mass * z for z in self.map.motion(xi)]

    def changed_basis(self, linear: LinearModel) -> list[Inexact[np.ndarray, "_ nx"]]:
        """T_k of x_k = T_k x, with x the state of the dense `linear.flexible`; together unitary.

        With the lag of actuators x is the state of `linear.flexible.actuated`.

        Raises
        ------
        LinearizationError
            For a model of another equilibrium.
        """
        flexible = linear.flexible
        if not np.array_equal(linear.equilibrium.nodes, self.equilibrium.nodes):
            raise LinearizationError("the linear model is one of another equilibrium; linearise both at the same.")
        drifting = flexible.equilibrium.spectrum.shapes[:, np.array([mode.index for mode in flexible.drifting], int)]
        count, result = len(flexible.modes), []
        for block, z in zip(self.blocks, self._weighed(np.hstack([flexible.shapes, drifting])), strict=True):
            mixed, own = block.shapes.conj().T @ z[:, :count], block.omega2.size
            T = np.zeros((block.motion, len(flexible.order)), mixed.dtype)
            T[:own, :count] = block.scales[:, None] * mixed / flexible.scales
            T[own : 2 * own, count : 2 * count] = mixed
            T[2 * own :, 2 * count :] = block.drift.conj().T @ z[:, count:]
            result.append(T[:, flexible.order])
        if not self.lag:
            return result
        inputs = zip(result, self.map.waves(np.eye(self.nu)), strict=True)
        return [sla.block_diag(T, U) for T, U in inputs]

    def circulant(self, row: Float[np.ndarray, "n p q"]) -> list[Inexact[np.ndarray, "p q"]]:
        """Blocks of a block-circulant matrix, M[s, t] = row[(t - s) mod n] between sectors s and t."""
        return [np.sqrt(self.order) * np.conj(wave) for wave in self.map.forward(row)]

    def weight_of(self, weights: Mapping[str, float | np.ndarray]) -> list[Inexact[np.ndarray, "_ _"]]:
        """State weights Q_k of sum w y^2 over the outputs, at inputs held still.

        Parameters
        ----------
        weights : {"nodes", "lengths" or "tensions": number, or one number for each output of a sector}
        """
        unknown = [kind for kind in weights if kind not in get_args(Shown)]
        if unknown:
            raise LinearizationError(f'output "{unknown[0]}" is unknown; choose from {", ".join(get_args(Shown))}.')
        result = []
        for block in self.blocks:
            Q = np.zeros((block.nx, block.nx), block.shapes.dtype)
            for kind, weight in weights.items():
                C = block.C(cast(Shown, kind))
                Q = Q + C.conj().T @ (np.broadcast_to(weight, len(C))[:, None] * C)
            result.append(0.5 * (Q + Q.conj().T))
        return result

    def verify(self, tol: float = 1e-9) -> None:
        """Check each block's modes against the Hessian and mass matrix that they came from.

        Raises
        ------
        LinearizationError
            With the misfit found and its harmonic.
        """
        worst = max(self.blocks, key=Harmonic.misfit)
        if worst.misfit() > tol:
            raise LinearizationError(
                f"the modes of harmonic {worst.k} miss the Hessian by {worst.misfit():.1e} of its size; "
                f"{tol:.0e} is expected."
            )


@one_blas_thread()
def harmonics(dynamics: Dynamics, equilibrium: Equilibrium, *, tol: float = 1e-9) -> HarmonicModel:
    """Linearise a cyclically symmetric model harmonic by harmonic, at any size.

    Parameters
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
        Of the same structure.
    tol : float
        Largest relative mismatch between the sectors that is let pass.

    Raises
    ------
    LinearizationError
        When the sectors differ, and where `linearize` would refuse.
    """
    checked_point(dynamics, equilibrium)
    symmetry = linear_symmetry(dynamics, equilibrium, tol)
    sector = Sector.of(equilibrium.potential, symmetry, equilibrium.rest_lengths)
    point = sector.at(sector.restrict(equilibrium.nodes))
    orbits = input_orbits(dynamics, symmetry) or ()
    gears = harmonic_gears(dynamics, symmetry, orbits)
    blocks = [Harmonic.of(dynamics, point, k, equilibrium.tolerance, gear) for k, gear in enumerate(gears)]
    own = next((group for group in orbits if len(group) == symmetry.order), np.zeros((symmetry.order, 0), int))
    shared = tuple(group for group in orbits if len(group) < symmetry.order)
    mapped = HarmonicMap(equilibrium, point, own, shared)
    return HarmonicModel(dynamics, equilibrium, mapped, _scaled(blocks), symmetry.mismatch)


def _scaled(blocks: Sequence[Harmonic]) -> tuple[Harmonic, ...]:
    """Blocks whose modes without stiffness have the scale of the slowest flexible one of all."""
    slowest = min((float(np.sqrt(b.omega2[b.flexible].min())) for b in blocks if b.flexible.any()), default=1.0)
    return tuple(replace(block, unscaled=slowest) for block in blocks)
