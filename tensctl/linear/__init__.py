"""Close to rest: modes and the exact linear model in energy coordinates."""

from tensctl.linear.frame import Frame, best_fit
from tensctl.linear.model import LinearModel, linearize
from tensctl.linear.modes import Mode
from tensctl.linear.sampling import Sampled, sample_ramped

__all__ = ["Frame", "LinearModel", "Mode", "Sampled", "best_fit", "linearize", "sample_ramped"]
