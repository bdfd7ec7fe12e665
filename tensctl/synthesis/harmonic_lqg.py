"""LQG of a cyclically symmetric structure, harmonic by harmonic: `harmonic_kalman` and `harmonic_lqr` in one loop.

    xi_k <- Phi_k xi_k + G_y,k (y_k - D_k u_k) + ...,   u_k = -C_k xi_k

with the estimator of `estimator` in each harmonic. Readings and rest lengths go through one Fourier transform each, the
command through one back; nothing of full size is formed, and the loop is that of `lqg` on the whole structure.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from jaxtyping import Complex, Float

from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel, harmonic_outputs
from tensctl.synthesis.estimating import Estimating
from tensctl.synthesis.estimator import Estimator, Plant, kalman_estimator
from tensctl.synthesis.feedback import command
from tensctl.synthesis.harmonic_kalman import HarmonicKalman, harmonic_kalman
from tensctl.synthesis.harmonic_lqr import HarmonicLQR, harmonic_lqr
from tensctl.synthesis.harmonic_lqr_sampled import HarmonicSampledLQR
from tensctl.synthesis.harmonic_margins import HarmonicSensitivity
from tensctl.synthesis.harmonic_weights import Blocks, Costs
from tensctl.synthesis.lagging import commands_now
from tensctl.synthesis.loop import Loop, close, separation
from tensctl.synthesis.lqr_sampled import continuous_poles
from tensctl.synthesis.lyapunov import Lyapunov
from tensctl.synthesis.sensors import Reading, Sensors
from tensctl.synthesis.stabilisable import LeftOut
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class HarmonicLQG(Estimating):
    """Output feedback about a symmetric equilibrium; a controller when it was designed with a period.

    Attributes
    ----------
    regulator : HarmonicLQR or HarmonicSampledLQR
    filter : HarmonicKalman
    plants : tuple of Plant
    estimators : tuple of Estimator
        As they run, one a harmonic.
    """

    regulator: HarmonicLQR | HarmonicSampledLQR
    filter: HarmonicKalman
    plants: tuple[Plant, ...]
    estimators: tuple[Estimator, ...]

    design: ClassVar[str] = "harmonic_lqg"

    @property
    def linear(self) -> HarmonicModel:
        """The model that was controlled."""
        return self.filter.linear

    @property
    def sensors(self) -> Sensors:
        """What it is shown."""
        return self.filter.sensors

    @property
    def dt(self) -> float | None:
        """Control period, s; None in continuous time."""
        return self.filter.dt

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        """The closed loop of each harmonic and its estimator."""
        return tuple(close(plant, e) for plant, e in zip(self.plants, self.estimators, strict=True))

    @cached_property
    def poles(self) -> Complex[np.ndarray, " n"]:
        """Poles of the whole closed loop, 1/s; of a sampled one log(z)/dt."""
        copies = [block.copies for block in self.linear.blocks]
        spectra = [loop.spectrum for loop in self.loops]
        both = [[own, own.conj()][:count] for own, count in zip(spectra, copies, strict=True)]
        found = np.concatenate([part for pair in both for part in pair])
        return found if self.dt is None else continuous_poles(found, self.dt)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole, 1/s; negative when the loop is stable."""
        return float(np.real(self.poles).max())

    @property
    def gain_doubt(self) -> float:
        """The larger of those of regulator and filter: how far the data leave the controller open."""
        return max(self.regulator.gain_doubt, self.filter.gain_doubt)

    @property
    def regulator_doubt(self) -> float:
        """Estimated relative change of the regulator's gain, as `LQG.regulator_doubt`."""
        return self.regulator.gain_doubt

    @property
    def order(self) -> int:
        """Real states of the controller."""
        return sum(block.copies * e.order for block, e in zip(self.linear.blocks, self.estimators, strict=True))

    @property
    def left(self) -> tuple[LeftOut, ...]:
        """No mode is left out: one that is not damped, and not driven or not seen, is refused."""
        return ()

    @property
    def reduction(self) -> None:
        """It keeps all states."""

    @property
    def small_gain(self) -> None:
        """Nothing was left away that would have to be proven harmless."""

    @cached_property
    def covariances(self) -> tuple[Lyapunov, ...]:
        """Covariance of each harmonic of the loop's state under the noise that it was designed for."""
        return tuple(loop.noise(one.W, one.V) for loop, one in zip(self.loops, self.filter.blocks, strict=True))

    @property
    def covariance_residual(self) -> float:
        """What the covariance of the whole leaves of its equation, over the sum of the terms."""
        copies = np.array([block.copies for block in self.linear.blocks])
        left, terms = ([getattr(one, name) for one in self.covariances] for name in ("left", "terms"))
        return float(np.sqrt(copies @ np.square(left)) / np.sqrt(copies @ np.square(terms)).sum())

    @cached_property
    def expected_cost(self) -> float:
        """Cost rate (cost of a period when sampled) that noise keeps up: the square of the loop's H2 norm."""
        parts = zip(self.linear.blocks, self.loops, self.covariances, self._costs, strict=True)
        return sum(block.copies * loop.cost(own.X, cost) for block, loop, own, cost in parts)

    @cached_property
    def shake(self) -> float:
        """Largest standard deviation of a node's coordinate that the sensors' noise alone keeps up, m."""
        nodes, factors = harmonic_outputs(self.linear, ["nodes"]), []
        for block, loop, one in zip(self.linear.blocks, self.loops, self.filter.blocks, strict=True):
            X = loop.noise(np.zeros_like(one.W), one.V).X[: block.nx, : block.nx]
            sizes, axes = np.linalg.eigh(X)
            factors.append(nodes.C(block) @ (axes * np.sqrt(np.maximum(sizes, 0.0))))
        return float(np.sqrt(nodes.squares(factors).max(initial=0.0)))

    @cached_property
    def separation(self) -> float:
        """Distance of the loop's poles to those of regulator and filter, harmonic by harmonic, over the largest."""
        parts = zip(self.plants, self.estimators, self.loops, self.regulator.K, strict=True)
        gaps, sizes = zip(*(separation(*part) for part in parts), strict=True)
        return max(gaps) / max(sizes)

    def enclosure(self) -> tuple[float, float]:
        """Least and largest value of the disk margin at the plant's inputs, of all at once."""
        return self.sensitivity.enclosure()

    @cached_property
    def sensitivity(self) -> HarmonicSensitivity:
        """From what disturbs the plant's inputs to these."""
        return HarmonicSensitivity(self.linear, tuple(loop.sensitivity for loop in self.loops))

    @property
    def _costs(self) -> tuple[Cost, ...]:
        own = self.regulator
        return own.period_costs if isinstance(own, HarmonicSampledLQR) else own.costs

    @one_blas_thread()
    def _answer(
        self, reading: Reading, last: dict[str, np.ndarray]
    ) -> tuple[Float[np.ndarray, " nu"], dict[str, np.ndarray]]:
        rest, waves = self.linear.equilibrium, self.linear.map.waves
        change = commands_now(self.linear, reading) - rest.inputs
        u, y = waves(change), self.filter.outputs.waves(reading.values - self.sensors.of(rest))
        estimate = [
            e.seen @ (yk - p.D @ uk) for e, p, yk, uk in zip(self.estimators, self.plants, y, u, strict=True)
        ]  # fmt: skip
        if "estimate" in last:
            before = zip(self.estimators, self._unpacked(last["estimate"]), waves(last["inputs"]), u, strict=True)
            gone_on = [e.Phi @ xi + e.before @ earlier + e.now @ now for e, xi, earlier, now in before]
            estimate = [seen + own for seen, own in zip(estimate, gone_on, strict=True)]
        asked = [-(e.C @ xi + e.direct @ uk) for e, xi, uk in zip(self.estimators, estimate, u, strict=True)]
        memory = {"estimate": _packed(estimate), "inputs": change}
        return command(self.linear, self.linear.map.shortening(asked)), memory

    def _unpacked(self, packed: np.ndarray) -> list[np.ndarray]:
        """Estimates by harmonic."""
        ends = np.cumsum([e.order for e in self.estimators])[:-1]
        parts = zip(self.linear.blocks, np.split(packed[0] + 1j * packed[1], ends), strict=True)
        return [np.real(part) if block.copies == 1 else part for block, part in parts]

    def verify(self, tol: float = 1e-9) -> None:
        """Check both Riccati residuals, the stability of regulator and filter, and that of the loop which they close.

        Raises
        ------
        SynthesisError
            With the number or the harmonic that fails.
        """
        self.regulator.verify(tol)
        self.filter.verify(tol)
        for block, loop in zip(self.linear.blocks, self.loops, strict=True):
            if not loop.stability < 0:
                raise SynthesisError(
                    f"the closed loop of harmonic {block.k} is not stable: it misses by {loop.stability:.1e}."
                )


@one_blas_thread()
def harmonic_lqg(
    linear: HarmonicModel,
    sensors: Sensors,
    *,
    Q: Blocks | None = None,
    R: np.ndarray | Blocks | None = None,
    cost: Costs | None = None,
    force_noise: float | Mapping[str, float] = 0.1,
    dt: float | None = None,
) -> HarmonicLQG:
    """Design output feedback harmonic by harmonic, that of `lqg` with the same weights, noise and period.

    Parameters
    ----------
    linear : HarmonicModel
    sensors, force_noise
        As `harmonic_kalman` takes them.
    Q, R, cost
        Weights as `harmonic_lqr` takes them; energies by default.
    dt : float, s, optional
        Control period; without it the continuous problem, which can be judged but not run.

    Raises
    ------
    SynthesisError
        What `harmonic_lqr` and `harmonic_kalman` refuse.
    """
    regulator = harmonic_lqr(linear, Q, R, cost=cost, dt=dt)
    found = harmonic_kalman(linear.actuated, sensors, force_noise=force_noise, dt=dt)
    sampled = regulator.sampled if isinstance(regulator, HarmonicSampledLQR) else [None] * len(linear.blocks)
    plants = tuple(
        Plant(block.A, block.B, found.outputs.C(block), found.outputs.D(block), own)
        for block, own in zip(found.linear.blocks, sampled, strict=True)
    )
    gains = zip(plants, found.blocks, regulator.K, strict=True)
    estimators = tuple(kalman_estimator(plant, one.gain, K) for plant, one, K in gains)
    return HarmonicLQG(regulator, found, plants, estimators)


def _packed(blocks: list[np.ndarray]) -> Float[np.ndarray, "2 n"]:
    """Real and imaginary parts, for memories that hold real arrays."""
    joined = np.concatenate(blocks)
    return np.stack([np.real(joined), np.imag(joined)])
