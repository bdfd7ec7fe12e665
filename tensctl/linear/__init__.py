"""Close to rest: modes and the exact linear model in energy coordinates."""

from tensctl.linear.frame import Frame, best_fit
from tensctl.linear.model import LinearModel, linearize
from tensctl.linear.modes import Mode

__all__ = ["Frame", "LinearModel", "Mode", "best_fit", "linearize"]
