"""Close to rest: modes and the exact linear model in energy coordinates."""

from tensctl.linear.frame import Frame, best_fit
from tensctl.linear.harmonic import HarmonicModel, harmonics
from tensctl.linear.harmonic_block import Harmonic
from tensctl.linear.model import LinearModel, linearize
from tensctl.linear.modes import Mode
from tensctl.linear.sampling import Sampled, sample_ramped

__all__ = [
    "Frame",
    "Harmonic",
    "HarmonicModel",
    "LinearModel",
    "Mode",
    "Sampled",
    "best_fit",
    "harmonics",
    "linearize",
    "sample_ramped",
]
