"""Close to rest: modes and the exact linear model in energy coordinates."""

from tensctl.linear.discrete import Discrete, sample
from tensctl.linear.frame import Frame, best_fit
from tensctl.linear.harmonic import HarmonicModel, harmonics
from tensctl.linear.harmonic_block import Harmonic
from tensctl.linear.harmonic_outputs import HarmonicOutputs, harmonic_outputs
from tensctl.linear.linearize import linearize
from tensctl.linear.model import LinearModel
from tensctl.linear.modes import Mode
from tensctl.linear.outputs import Mix
from tensctl.linear.sampling import Sampled, sample_ramped
from tensctl.linear.second_order import SecondOrder

__all__ = [
    "Discrete",
    "Frame",
    "Harmonic",
    "HarmonicModel",
    "HarmonicOutputs",
    "LinearModel",
    "Mix",
    "Mode",
    "Sampled",
    "SecondOrder",
    "best_fit",
    "harmonic_outputs",
    "harmonics",
    "linearize",
    "sample",
    "sample_ramped",
]
