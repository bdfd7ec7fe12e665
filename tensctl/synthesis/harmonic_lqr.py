"""LQR of a cyclically symmetric structure, harmonic by harmonic.

    minimise  sum_k int x_k* Q_k x_k + u_k* R_k u_k dt,   u_k = -R_k^-1 B_k* P_k x_k

with P_k from the Riccati equation of block k. The transform is unitary, so this is the LQR of the whole structure: its
gain, never formed, is a fast Fourier transform, n/2 + 1 products of sector size, and the transform back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import overload

import numpy as np
from jaxtyping import Complex, Float, Inexact

from tensctl.analysis import harmonic_controllability
from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel, LinearModel, sample_ramped
from tensctl.linear.harmonic_block import Harmonic
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Number
from tensctl.synthesis.crossed import optimal
from tensctl.synthesis.feedback import Measured, command
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.harmonic_kalman import harmonic_white_forces
from tensctl.synthesis.harmonic_lqr_sampled import HarmonicSampledLQR, sampled_design
from tensctl.synthesis.harmonic_margins import HarmonicSensitivity
from tensctl.synthesis.harmonic_riccati import by_harmonic, doubt_of, name_lost, poles_of, residual_of, stable
from tensctl.synthesis.harmonic_weights import Blocks, Costs, checked_costs
from tensctl.synthesis.holding import Holding
from tensctl.synthesis.lagging import lagging_costs
from tensctl.synthesis.margins import Sensitivity
from tensctl.synthesis.stabilisable import LeftOut
from tensctl.synthesis.unseen import check_seen_by_harmonic
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread

# First sample time tried: this part of a radian of the fastest mode (as in `lqr`).
_SAMPLES = 0.2
_HALVINGS = 12
# A stable sampled loop of a time constant of up to 2^40 periods is seen as stable.
_SQUARINGS = 40


@dataclass(frozen=True, eq=False)
class HarmonicLQR(Holding):
    """State feedback about a symmetric equilibrium; a controller with `step` and `reset`.

    Attributes
    ----------
    linear : HarmonicModel
    costs : tuple of Cost
        Weights of each harmonic on x_k and u_k.
    K, P : gains and Riccati solutions by harmonic
    """

    linear: HarmonicModel
    costs: tuple[Cost, ...]
    K: tuple[Inexact[np.ndarray, "p nx"], ...]
    P: tuple[Inexact[np.ndarray, "nx nx"], ...]

    @cached_property
    def residual(self) -> float:
        """Riccati residual of the whole structure over the sum of its terms, each a root of squares over harmonics."""
        parts = zip(self.linear.blocks, self.costs, self.P, strict=True)
        return residual_of(self.linear, ((b.A, b.B, cost, P) for b, cost, P in parts), sampled=False)

    @cached_property
    def poles(self) -> Complex[np.ndarray, " nx"]:
        """Closed-loop poles of the whole structure, 1/s."""
        parts = zip(self.linear.blocks, self.K, strict=True)
        return poles_of(self.linear, (block.A - block.B @ K for block, K in parts))

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
        """Estimated relative change of R^1/2 K by the residual and by rounding of the data of each harmonic."""
        parts = zip(self.linear.blocks, self.costs, self.P, self.K, strict=True)
        return doubt_of(self.linear, (gain_doubt(b.A, b.B, cost, P, K) for b, cost, P, K in parts))

    @cached_property
    def dt(self) -> float:
        """Longest tried sample time at which the sampled, ramped loop is stable, s."""
        dt = _SAMPLES / float(np.sqrt(self.linear.omega2.max()))
        for _ in range(_HALVINGS):
            if all(_stable_sampled(block, K, dt) for block, K in zip(self.linear.blocks, self.K, strict=True)):
                return dt
            dt /= 2
        raise SynthesisError(f"the sampled loop is unstable even at a sample time of {dt:.1e} s; raise R.")

    def enclosure(self) -> tuple[float, float]:
        """Least and largest value of the disk margin at the plant's inputs, of all at once, in continuous time."""
        return self.sensitivity.enclosure()

    @cached_property
    def sensitivity(self) -> HarmonicSensitivity:
        """From what disturbs the plant's inputs to these, in continuous time."""
        parts = zip(self.linear.blocks, self.K, strict=True)
        return HarmonicSensitivity(self.linear, tuple(Sensitivity(b.A - b.B @ K, b.B, -K, None) for b, K in parts))

    def expected_cost(self, force_noise: float | Mapping[str, float] = 0.1) -> float:
        """Cost rate that white forces keep up, tr(P W): the square of the loop's H2 norm.

        Parameters
        ----------
        force_noise : N s^1/2
            Root of the intensity of white forces on the free nodes in each direction, as `harmonic_lqg` takes it.

        Raises
        ------
        SynthesisError
            A negative intensity, or images with different ones.
        """
        parts = zip(self.linear.blocks, self.P, harmonic_white_forces(self.linear, force_noise), strict=True)
        return float(sum(block.copies * np.real(np.trace(P @ W)) for block, P, W in parts))

    @one_blas_thread()
    def _answer(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        states = self.linear.seen(measurement.nodes, measurement.velocities, measurement.inputs)
        return command(self.linear, self.answer(states))

    def answer(self, states: Blocks) -> Float[np.ndarray, "nu *columns"]:
        """-K x of the whole structure, m, from the harmonics of its state."""
        return self.linear.map.shortening([-K @ x for K, x in zip(self.K, states, strict=True)])

    def cost(self, states: Blocks) -> float:
        """Cost to go x'Px of the whole structure, J."""
        terms = zip(self.linear.blocks, self.P, states, strict=True)
        return float(sum(block.copies * np.real(x.conj() @ P @ x) for block, P, x in terms))

    def dense(self, linear: LinearModel) -> tuple[Float[np.ndarray, "nu nx"], Float[np.ndarray, "nx nx"]]:
        """K and P in the states of a dense model of the same equilibrium, for sizes that have one."""
        bases = self.linear.changed_basis(linear)
        terms = zip(self.linear.blocks, self.P, bases, strict=True)
        P = sum((block.copies * np.real(T.conj().T @ P @ T) for block, P, T in terms), np.zeros(()))
        return -self.answer(bases), P

    def verify(self, tol: float = 1e-9) -> None:
        """Check the Riccati residual and, by Lyapunov's inequality, that every pole is stable.

        Raises
        ------
        SynthesisError
            With the number or the harmonic that fails.
        """
        if not self.residual <= tol:
            raise SynthesisError(f"the Riccati residual is {self.residual:.1e}; at most {tol:.0e} is expected.")
        for block, K, P in zip(self.linear.blocks, self.K, self.P, strict=True):
            if not stable(block.A - block.B @ K, P):
                raise SynthesisError(f"a closed-loop pole of harmonic {block.k} is not stable.")


@overload
def harmonic_lqr(
    linear: HarmonicModel, Q: Blocks | None = None, R: np.ndarray | Blocks | None = None, *,
    cost: Costs | None = None, dt: None = None,
) -> HarmonicLQR: ...  # fmt: skip
@overload
def harmonic_lqr(
    linear: HarmonicModel, Q: Blocks | None = None, R: np.ndarray | Blocks | None = None, *,
    cost: Costs | None = None, dt: float | None,
) -> HarmonicLQR | HarmonicSampledLQR: ...  # fmt: skip
@one_blas_thread()
def harmonic_lqr(
    linear: HarmonicModel,
    Q: Blocks | None = None,
    R: np.ndarray | Blocks | None = None,
    *,
    cost: Costs | None = None,
    dt: float | None = None,
) -> HarmonicLQR | HarmonicSampledLQR:
    """Design state feedback harmonic by harmonic.

    Parameters
    ----------
    linear : HarmonicModel
    Q : one (nx_k, nx_k) array a harmonic, optional
        State weights, as `linear.weight_of` gives them; identity (twice the energy) by default.
    R : (p, p) array, or one a harmonic, optional
        Input weight of each sector, or blocks as `linear.circulant` gives them; diag(stiffness) by default.
    cost : one Cost a harmonic, optional
        Both of them, and cross weights, in physical terms, from `harmonic_weights`.
    dt : float, s, optional
        Control period. With it the sampled loop is designed, whose rest lengths ramp within each period and reach the
        command one period later; without it the continuous one.

    Raises
    ------
    SynthesisError
        Weights that do not fit, no input, or a mode that is not damped and not driven, or not seen by the weights.
    """
    check_kind(HarmonicModel, linear=linear)
    if linear.nx == 0 or linear.nu == 0:
        raise SynthesisError(
            f"the model has {linear.nx} flexible states and {linear.nu} inputs; at least one of each is needed."
        )
    costs = checked_costs(linear, Q, R, cost)
    if dt is not None:
        dt = argument("dt", dt, Number("s", above=0))
    cross = [None if dt is not None else block.B for block in linear.blocks]
    check_seen_by_harmonic(linear, [(b.A, own, B) for b, own, B in zip(linear.blocks, costs, cross, strict=True)])
    plant, costs = linear.actuated, lagging_costs(linear, costs)
    try:
        if dt is not None:
            return sampled_design(plant, costs, dt)
        solved = by_harmonic(plant, lambda block: optimal(block.A, block.B, costs[block.k]))
    except SynthesisError:
        name_lost(linear, lambda: harmonic_controllability(linear), "driven", "tendons that reach it")
        raise
    return HarmonicLQR(plant, costs, tuple(one.K for one in solved), tuple(one.P for one in solved))


def _stable_sampled(block: Harmonic, K: np.ndarray, dt: float) -> bool:
    """Whether powers of the sampled loop vanish: commands arrive one period late."""
    A, B = sample_ramped(block.A, block.B, dt).with_input_state()
    power = A - B @ np.hstack([K, np.zeros((len(K), len(K)))])
    for _ in range(_SQUARINGS):
        size = np.linalg.norm(power)
        if size < 1 or not size < 1e100:
            return bool(size < 1)
        power = power @ power
    return False
