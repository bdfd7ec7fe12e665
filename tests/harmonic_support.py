"""One case twice, dense and by harmonics, and how far two answers are apart."""

import numpy as np
from support import shell_scene, solved

import tensctl as tc

DAMPED = {"tendons": {"EA": 120.0, "rest_ratio": 0.8, "damping": 0.7}, "drag": {"coefficient": 0.2}}


def relative(found, wanted):
    return np.abs(found - wanted).max() / np.abs(wanted).max()


def dense_and_harmonic(size, given, noise):
    """Dense model, harmonics and sensors of one case."""
    dynamics, rest, linear = solved(shell_scene(*size, **given))
    return linear, tc.harmonics(dynamics, rest), tc.sensors(dynamics.structure, **noise)
