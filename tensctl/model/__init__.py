"""How a structure moves: dynamics assembled from the elements, and their compiled kernel."""

from tensctl.model.damping import damping_matrix
from tensctl.model.dynamics import Dynamics, Explanation, build_dynamics
from tensctl.model.explain import Term
from tensctl.model.symbolic import SymbolicModel

__all__ = ["Dynamics", "Explanation", "SymbolicModel", "Term", "build_dynamics", "damping_matrix"]
