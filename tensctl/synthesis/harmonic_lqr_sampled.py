"""LQR of the sampled loop of a cyclically symmetric structure, harmonic by harmonic: `lqr_sampled` in blocks.

    z_k = (x_k, u_k),   z_k <- A_k z_k + B_k u_k+,   u_k+ = -K_k z_k

Rest lengths ramp to each command within a period, and the cost is the integral over ramped periods, in every harmonic.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from jaxtyping import Complex, Float, Inexact

from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel, LinearModel, Sampled, sample_ramped
from tensctl.linear.harmonic_block import Harmonic
from tensctl.synthesis.crossed import Optimum, optimal
from tensctl.synthesis.feedback import Measured, command
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.harmonic_kalman import harmonic_white_forces
from tensctl.synthesis.harmonic_margins import HarmonicSensitivity
from tensctl.synthesis.harmonic_riccati import by_harmonic, doubt_of, poles_of, residual_of, stable
from tensctl.synthesis.harmonic_weights import Blocks
from tensctl.synthesis.holding import Holding
from tensctl.synthesis.lagging import commands_now
from tensctl.synthesis.lqr_sampled import continuous_poles
from tensctl.synthesis.margins import Sensitivity
from tensctl.synthesis.over_period import integral, ramped_cost
from tensctl.synthesis.sampling_limit import refuse_short
from tensctl.synthesis.stabilisable import LeftOut
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class HarmonicSampledLQR(Holding):
    """Sampled state feedback about a symmetric equilibrium; a controller with `step` and `reset`.

    Attributes
    ----------
    linear : HarmonicModel
    costs, period_costs : tuple of Cost
        Continuous weights of each harmonic, and their integral over a period as weights on (x_k, u_k) and u_k+.
    sampled : tuple of Sampled
    blocks : tuple of Optimum
        Gain (p, nx + p) and cost to go of each harmonic.
    """

    sees_inputs: ClassVar[bool] = True

    linear: HarmonicModel
    costs: tuple[Cost, ...]
    period_costs: tuple[Cost, ...]
    sampled: tuple[Sampled, ...]
    blocks: tuple[Optimum, ...]

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self.sampled[0].dt

    @property
    def K(self) -> tuple[Inexact[np.ndarray, "p n"], ...]:
        """Gains by harmonic, u_k+ = -K_k (x_k, u_k), deviations from the equilibrium."""
        return tuple(block.K for block in self.blocks)

    @property
    def P(self) -> tuple[Inexact[np.ndarray, "n n"], ...]:
        """Cost to go by harmonic."""
        return tuple(block.P for block in self.blocks)

    @cached_property
    def residual(self) -> float:
        """Riccati residual of the whole structure over the sum of its terms."""
        parts = zip(self.sampled, self.period_costs, self.P, strict=True)
        equations = ((*own.with_input_state(), cost, P) for own, cost, P in parts)
        return residual_of(self.linear, equations, sampled=True)

    @cached_property
    def poles(self) -> Complex[np.ndarray, " n"]:
        """Continuous poles log(z)/dt of the whole sampled loop, 1/s; minus infinity for what is gone in a period."""
        return continuous_poles(poles_of(self.linear, self._loops), self.dt)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole, 1/s; negative when the loop is stable."""
        return float(np.real(self.poles).max(initial=-np.inf))

    @property
    def left(self) -> tuple[LeftOut, ...]:
        """No mode is left out: one that is neither damped nor driven is refused."""
        return ()

    @cached_property
    def gain_doubt(self) -> float:
        """Estimated relative change of (R + B*PB)^1/2 K by the residual and by rounding of each harmonic's data."""
        parts = zip(self.sampled, self.period_costs, self.blocks, strict=True)
        return doubt_of(
            self.linear,
            (gain_doubt(*s.with_input_state(), cost, b.P, b.K, sampled=True) for s, cost, b in parts),
        )

    @cached_property
    def sensitivity(self) -> HarmonicSensitivity:
        """From what disturbs the commands to these, once a period: its margins are those of the commands."""
        parts = zip(self.sampled, self._loops, self.K, strict=True)
        return HarmonicSensitivity(
            self.linear, tuple(Sensitivity(loop, own.with_input_state()[1], -K, own.dt) for own, loop, K in parts)
        )

    def expected_cost(self, force_noise: float | Mapping[str, float] = 0.1) -> float:
        """Cost of a period that white forces keep up, tr(P W_dt): the square of the sampled loop's H2 norm.

        Parameters
        ----------
        force_noise : N s^1/2
            Root of the intensity of white forces on the free nodes in each direction, as `harmonic_lqg` takes it.

        Raises
        ------
        SynthesisError
            A negative intensity, or images with different ones.
        """
        total, forces = 0.0, harmonic_white_forces(self.linear, force_noise)
        for block, P, W in zip(self.linear.blocks, self.P, forces, strict=True):
            left = integral(block.A.conj().T, W, self.dt)[1]
            total += block.copies * float(np.real(np.trace(P[: block.nx, : block.nx] @ left)))
        return total

    @one_blas_thread()
    def _answer(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        states = self.linear.seen(measurement.nodes, measurement.velocities, measurement.inputs)
        inputs = self.linear.map.waves(commands_now(self.linear, measurement) - self.linear.equilibrium.inputs)
        return command(self.linear, self.answer(states, inputs))

    def answer(self, states: Blocks, inputs: Blocks) -> Float[np.ndarray, "nu *columns"]:
        """-K (x, u) of the whole structure, m, from the harmonics of its state and of its inputs."""
        parts = zip(self.K, states, inputs, strict=True)
        return self.linear.map.shortening([-K @ np.concatenate([x, u]) for K, x, u in parts])

    def dense(self, linear: LinearModel) -> tuple[Float[np.ndarray, "nu n"], Float[np.ndarray, "n n"]]:
        """K and P on (x, u) in the states of a dense model of the same equilibrium, for sizes that have one."""
        bases, inputs = self.linear.changed_basis(linear), self.linear.map.waves(np.eye(self.linear.nu))
        states = [np.hstack([T, np.zeros((len(T), U.shape[1]))]) for T, U in zip(bases, inputs, strict=True)]
        shifted = [np.hstack([np.zeros((len(U), T.shape[1])), U]) for T, U in zip(bases, inputs, strict=True)]
        whole = [np.vstack(pair) for pair in zip(states, shifted, strict=True)]
        terms = zip(self.linear.blocks, self.P, whole, strict=True)
        P = sum((block.copies * np.real(Z.conj().T @ P @ Z) for block, P, Z in terms), np.zeros(()))
        return -self.answer(states, shifted), P

    def verify(self, tol: float = 1e-9) -> None:
        """Check the Riccati residual and, by Lyapunov's inequality, that every pole is stable.

        Raises
        ------
        SynthesisError
            With the number or the harmonic that fails.
        """
        if not self.residual <= tol:
            raise SynthesisError(f"the Riccati residual is {self.residual:.1e}; at most {tol:.0e} is expected.")
        for block, loop, P in zip(self.linear.blocks, self._loops, self.P, strict=True):
            if not stable(loop, P, sampled=True):
                raise SynthesisError(f"a pole of the sampled loop of harmonic {block.k} is not stable.")

    @property
    def _loops(self) -> Iterator[np.ndarray]:
        for own, K in zip(self.sampled, self.K, strict=True):
            A, B = own.with_input_state()
            yield A - B @ K


def sampled_design(linear: HarmonicModel, costs: tuple[Cost, ...], dt: float) -> HarmonicSampledLQR:
    """Design with checked weights and period.

    Raises
    ------
    SynthesisError
        A period too short for double precision, or when a harmonic has no stabilising solution.
    """
    refuse_short(np.concatenate([block.scales for block in linear.blocks]), dt)

    def solve(block: Harmonic) -> tuple[Cost, Sampled, Optimum]:
        period, own = ramped_cost(block.A, block.B, costs[block.k], dt), sample_ramped(block.A, block.B, dt)
        return period, own, optimal(*own.with_input_state(), period, sampled=True)

    periods, sampled, found = zip(*by_harmonic(linear, solve), strict=True)
    return HarmonicSampledLQR(linear, costs, periods, sampled, found)
