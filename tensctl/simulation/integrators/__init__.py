"""Ways to move a structure through time, one a file."""

from tensctl.simulation.integrators.base import Integrator, Stepwise
from tensctl.simulation.integrators.choose import Choice, Method, choose_integrator
from tensctl.simulation.integrators.rate import fastest_rate

__all__ = ["Choice", "Integrator", "Method", "Stepwise", "choose_integrator", "fastest_rate"]
