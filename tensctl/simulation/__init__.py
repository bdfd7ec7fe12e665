"""What then happens: the nonlinear structure over time, alone or under a controller."""

from tensctl.simulation.energy import momenta, total_energy
from tensctl.simulation.run import Run
from tensctl.simulation.simulate import Measurement, Push, control_steps, simulate

__all__ = ["Measurement", "Push", "Run", "control_steps", "momenta", "simulate", "total_energy"]
