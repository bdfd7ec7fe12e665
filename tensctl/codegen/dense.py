"""Designs made harmonic by harmonic as the C source holds them: one gain, one estimator.

    K = sum over harmonics of K_k T_k,   x_k = T_k x,   and the estimator of this K and the filter's gain

Their sizes are those of dense designs, which C computes as fast as any below a hundred inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.errors import OutputError
from tensctl.linear import HarmonicModel, LinearModel, linearize, sample_ramped
from tensctl.synthesis import LQG, HarmonicLQG, HarmonicLQR, HarmonicSampledLQR, Sensors
from tensctl.synthesis.estimator import Estimator, Plant, kalman_estimator

# Most numbers of a gain; each takes twenty characters of source, and a compiler half a gigabyte for so many.
_LARGEST = 4_000_000


@dataclass(frozen=True, eq=False)
class Gain:
    """State feedback u = -K x, or of (x, u) where it sees inputs."""

    linear: LinearModel
    K: np.ndarray
    dt: float
    sees_inputs: bool


@dataclass(frozen=True, eq=False)
class Estimated:
    """Output feedback by an estimator; D is what the sensors show of the inputs."""

    linear: LinearModel
    sensors: Sensors
    estimator: Estimator
    D: np.ndarray
    dt: float


def dense_gain(design: HarmonicLQR | HarmonicSampledLQR) -> Gain:
    """The gain of a harmonic LQR.

    Raises
    ------
    OutputError
        One of too many numbers.
    """
    linear = _dense(design.linear)
    return Gain(linear, design.dense(linear)[0], design.dt, design.sees_inputs)


def dense_estimator(design: LQG | HarmonicLQG) -> Estimated:
    """The estimator of an LQG in discrete time.

    Raises
    ------
    OutputError
        A design in continuous time, or a harmonic one with a gain of too many numbers.
    """
    dt, sensors = design.dt, design.sensors
    if dt is None:
        raise OutputError(
            f"this LQG was designed in continuous time; give {design.design} a control period dt to export it."
        )
    if isinstance(design, LQG):
        return Estimated(design.linear, sensors, design.estimator, design.plant.D, dt)
    linear = _dense(design.linear)
    C, D = sensors.rows(linear)
    plant = Plant(linear.A, linear.B, C, D, sample_ramped(linear.A, linear.B, dt))
    found = kalman_estimator(plant, design.filter.dense(linear)[0], design.regulator.dense(linear)[0])
    return Estimated(linear, sensors, found, D, dt)


def _dense(model: HarmonicModel) -> LinearModel:
    if model.nu * (model.nx + model.nu) > _LARGEST:
        raise OutputError(
            f"this design has {model.nx} states and {model.nu} inputs, and the C source would hold a gain of "
            f"{model.nu * (model.nx + model.nu):.1e} numbers; at most {_LARGEST:.0e} are written, so choose fewer "
            "actuators.tendons."
        )
    return linearize(model.dynamics, model.equilibrium, outputs=()).flexible.actuated
