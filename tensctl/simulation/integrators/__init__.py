"""Ways to move a structure through time, one a file."""

from tensctl.simulation.integrators.base import Integrator, carried_by
from tensctl.simulation.integrators.choose import Choice, Method, choose_integrator

__all__ = ["Choice", "Integrator", "Method", "carried_by", "choose_integrator"]
