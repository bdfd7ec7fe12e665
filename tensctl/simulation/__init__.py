"""What then happens: the nonlinear structure over time, alone or under a controller."""

from tensctl.simulation.controller import Controller, Measurement
from tensctl.simulation.disturbance import Push
from tensctl.simulation.energy import momenta, total_energy
from tensctl.simulation.run import Run
from tensctl.simulation.sanity import Sanity, inspect_run
from tensctl.simulation.simulate import control_steps, simulate

__all__ = [
    "Controller",
    "Measurement",
    "Push",
    "Run",
    "Sanity",
    "control_steps",
    "inspect_run",
    "momenta",
    "simulate",
    "total_energy",
]
