"""The Kalman filter of a cyclically symmetric structure, harmonic by harmonic: the dual of `harmonic_lqr`.

    continuous  A_k X_k + X_k A_k* - X_k C_k* V^-1 C_k X_k + W_k = 0,   gain_k = X_k C_k* V^-1

and the sampled one of `kalman` likewise. Sensors and noise come with all their images, so the transform of outputs and
states is unitary, V is the same in every harmonic, and this is the filter of the whole structure. Its gain, never
formed, is a Fourier transform of the readings and n/2 + 1 products of sector size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla
from jaxtyping import Complex, Float, Inexact

from tensctl.analysis import harmonic_observability
from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel, HarmonicOutputs, LinearModel
from tensctl.linear.harmonic_block import Harmonic, Shown
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Number
from tensctl.synthesis.harmonic_riccati import Equation, by_harmonic, doubt_of, name_lost, poles_of, residual_of, stable
from tensctl.synthesis.harmonic_weights import of_sector
from tensctl.synthesis.kalman import Kalman, force_roots, kalman
from tensctl.synthesis.lqr_sampled import continuous_poles
from tensctl.synthesis.over_period import integral
from tensctl.synthesis.sampling_limit import refuse_short
from tensctl.synthesis.sensors import Sensors
from tensctl.synthesis.unseen import NOISE, check_seen_by_harmonic
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class HarmonicKalman:
    """A filter about a symmetric equilibrium.

    Attributes
    ----------
    linear : HarmonicModel
    sensors : Sensors
    outputs : HarmonicOutputs
        What the sensors show, in their order.
    dt : float or None, s
        Period of the samples; None in continuous time.
    blocks : tuple of Kalman
        The filter of each harmonic.
    """

    linear: HarmonicModel
    sensors: Sensors
    outputs: HarmonicOutputs
    dt: float | None
    blocks: tuple[Kalman, ...]

    @cached_property
    def residual(self) -> float:
        """Riccati residual of the whole structure over the sum of its terms."""
        equations = map(self._equation, self.linear.blocks)
        return residual_of(self.linear, equations, sampled=self.dt is not None)

    @cached_property
    def poles(self) -> Complex[np.ndarray, " nx"]:
        """Poles of the estimate's error, 1/s; of a sampled filter log(z)/dt."""
        found = poles_of(self.linear, (loop for loop, _ in self._duals))
        return found if self.dt is None else continuous_poles(found, self.dt)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole, 1/s; negative when the filter is stable."""
        return float(np.real(self.poles).max(initial=-np.inf))

    @cached_property
    def gain_doubt(self) -> float:
        """Estimated relative change of the gain by the residual and by rounding of the data of each harmonic."""
        return doubt_of(self.linear, (block.doubt for block in self.blocks))

    def correction(self, surprise: Float[np.ndarray, "ny *columns"]) -> list[Inexact[np.ndarray, "nx *columns"]]:
        """Gain times what the readings differ from what was expected, by harmonic."""
        waves = self.outputs.waves(surprise)
        return [block.gain @ wave for block, wave in zip(self.blocks, waves, strict=True)]

    def dense(self, linear: LinearModel) -> tuple[Float[np.ndarray, "nx ny"], Float[np.ndarray, "nx nx"]]:
        """Gain and covariance X in the states of a dense model of the same equilibrium, for sizes that have one."""
        bases = self.linear.changed_basis(linear)
        shown = self.correction(np.eye(len(self.outputs.labels)))
        parts = list(zip(self.linear.blocks, bases, self.blocks, shown, strict=True))
        gain = sum((b.copies * np.real(T.conj().T @ own) for b, T, _, own in parts), np.zeros(()))
        X = sum((b.copies * np.real(T.conj().T @ one.X @ T) for b, T, one, _ in parts), np.zeros(()))
        return gain, X

    def verify(self, tol: float = 1e-9) -> None:
        """Check the Riccati residual and, by Lyapunov's inequality, that every pole of the error is stable.

        Raises
        ------
        SynthesisError
            With the number or the harmonic that fails.
        """
        if not self.residual <= tol:
            raise SynthesisError(
                f"the filter's Riccati residual is {self.residual:.1e}; at most {tol:.0e} is expected."
            )
        for block, (loop, X) in zip(self.linear.blocks, self._duals, strict=True):
            if not stable(loop, X, sampled=self.dt is not None):
                raise SynthesisError(f"a pole of the filter of harmonic {block.k} is not stable.")

    def _equation(self, block: Harmonic) -> Equation:
        """The Riccati equation that X of a harmonic solves."""
        own = self.blocks[block.k]
        A, C = _motion(block, self.dt), self.outputs.C(block)
        return A.conj().T, C.conj().T, Cost(own.W, own.V, np.zeros(C.T.shape)), own.X

    @property
    def _duals(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Adjoint of each error's loop, A - L C or F (I - M C), and the X that proves it stable."""
        found = []
        for block, own in zip(self.linear.blocks, self.blocks, strict=True):
            A, C = _motion(block, self.dt), self.outputs.C(block)
            loop = A - (own.gain if self.dt is None else A @ own.gain) @ C
            found.append((loop.conj().T, own.X))
        return found


@one_blas_thread()
def harmonic_kalman(
    linear: HarmonicModel,
    sensors: Sensors,
    *,
    force_noise: float | Mapping[str, float] = 0.1,
    dt: float | None = None,
) -> HarmonicKalman:
    """Design a filter harmonic by harmonic, that of `lqg` on the same sensors.

    Parameters
    ----------
    linear : HarmonicModel
    sensors : Sensors
        From `sensors(structure, lengths=..., ...)`, each with its images and the same noise; that of each sample, or
        without `dt` the root of its intensity (m s^1/2, N s^1/2).
    force_noise : N s^1/2
        Root of the intensity of white forces on the free nodes in each direction, the same for images.
    dt : float, s, optional
        Period of the samples; without it the filter in continuous time.

    Raises
    ------
    SynthesisError
        Noise that breaks the symmetry, sensors of another structure, or a mode that is neither damped nor seen.
    LinearizationError
        Sensors that leave out an image.
    """
    check_kind(HarmonicModel, linear=linear)
    check_kind(Sensors, sensors=sensors)
    outputs, V, forces = symmetric_noise(linear, sensors, force_noise)
    if dt is not None:
        period = dt = argument("dt", dt, Number("s", above=0))
        refuse_short(np.concatenate([block.scales for block in linear.blocks]), period)
    duals = zip(linear.blocks, forces, strict=True)
    parts = [(b.A.conj().T, Cost(W, V, np.zeros((b.nx, len(V)))), None) for b, W in duals]
    check_seen_by_harmonic(linear, parts, sentence=NOISE)
    try:
        blocks = by_harmonic(linear, lambda block: _filter(block, outputs.C(block), forces[block.k], V, dt))
    except SynthesisError:
        name_lost(linear, lambda: harmonic_observability(outputs), "seen", "sensors that see it")
        raise
    return HarmonicKalman(linear, sensors, outputs, dt, tuple(blocks))


def symmetric_noise(
    linear: HarmonicModel, sensors: Sensors, force_noise: float | Mapping[str, float]
) -> tuple[HarmonicOutputs, Float[np.ndarray, "y y"], tuple[np.ndarray, ...]]:
    """What the sensors show, their covariance in every harmonic, and the forces of `harmonic_white_forces`.

    Raises
    ------
    SynthesisError
        Noise that breaks the symmetry, sensors of another structure.
    LinearizationError
        Sensors that leave out an image.
    """
    structure = linear.dynamics.structure
    if sensors.structure is not structure:
        raise SynthesisError("the sensors belong to another structure; make them for dynamics.structure.")
    kinds: list[tuple[Shown, np.ndarray]] = [("lengths", sensors.lengths), ("tensions", sensors.tensions)]
    kinds.append(("nodes", sensors.positions))
    outputs = HarmonicOutputs.of(linear, [(kind, chosen) for kind, chosen in kinds if chosen.size])
    noise = [of_sector(sensors.noise[orbit.places], "noises of sensors", "tc.lqg") for orbit in outputs.orbits]
    return outputs, np.diag(np.concatenate(noise) ** 2), harmonic_white_forces(linear, force_noise)


def harmonic_white_forces(linear: HarmonicModel, forces: float | Mapping[str, float]) -> tuple[np.ndarray, ...]:
    """Intensity of white forces on the free nodes in the states of each harmonic, as `white_forces` has it.

    Raises
    ------
    SynthesisError
        A negative intensity, or images with different ones.
    """
    nodes = linear.map.point.sector.symmetry.nodes
    roots = of_sector(force_roots(linear.dynamics.structure, forces)[nodes], "noises of forces", "tc.lqg")
    drives = (block.E * np.repeat(roots, 3)[block.free] for block in linear.blocks)
    return tuple(drive @ drive.conj().T for drive in drives)


def _filter(block: Harmonic, C: np.ndarray, W: np.ndarray, V: np.ndarray, dt: float | None) -> Kalman:
    if dt is None:
        return kalman(block.A, C, W, V)
    return kalman(_motion(block, dt), C, integral(block.A.conj().T, W, dt)[1], V, sampled=True)


def _motion(block: Harmonic, dt: float | None) -> np.ndarray:
    """A, or F over a period."""
    return block.A if dt is None else sla.expm(dt * block.A)
