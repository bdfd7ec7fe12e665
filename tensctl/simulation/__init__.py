"""What then happens: the nonlinear structure over time, alone or under a controller."""

from tensctl.simulation.batch import Batch, Variations, simulate_many
from tensctl.simulation.controller import Controller, Measurement
from tensctl.simulation.course import control_steps
from tensctl.simulation.demand import ActuatorDemand
from tensctl.simulation.demand_of_motion import actuator_demand
from tensctl.simulation.disturb import Kick
from tensctl.simulation.energy import momenta, total_energy
from tensctl.simulation.loads import History, Load, Push, Wave
from tensctl.simulation.propagate import Propagator, propagator
from tensctl.simulation.recover import recovery
from tensctl.simulation.recovered import Recovery
from tensctl.simulation.resume import resume
from tensctl.simulation.run import Run
from tensctl.simulation.sanity import Sanity, inspect_run
from tensctl.simulation.schedule import Schedule
from tensctl.simulation.simulate import simulate

__all__ = [
    "ActuatorDemand",
    "Batch",
    "Controller",
    "History",
    "Kick",
    "Load",
    "Measurement",
    "Propagator",
    "Push",
    "Recovery",
    "Run",
    "Sanity",
    "Schedule",
    "Variations",
    "Wave",
    "actuator_demand",
    "control_steps",
    "inspect_run",
    "momenta",
    "propagator",
    "recovery",
    "resume",
    "simulate",
    "simulate_many",
    "total_energy",
]
