"""The full nonlinear model as a `control.NonlinearIOSystem`, with exact Jacobians.

    dx/dt = f(x, u),   y = h(x, u)

x are the coordinates of the linear model about the equilibrium, so the linearisation there is
`linearize(...).to_statespace()`; u is the total rest-length change from L0, and y are total values, not deviations.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np
from jaxtyping import Float

from tensctl.linear import LinearModel, linearize
from tensctl.linear.chart import charted
from tensctl.linear.outputs import Output
from tensctl.model import Dynamics
from tensctl.statics import Equilibrium


class TensegritySystem(control.NonlinearIOSystem):
    """A structure for python-control: simulate, interconnect, linearise.

    Attributes
    ----------
    linear : LinearModel
        The linear model at the equilibrium, with all modes.
    x_eq, u_eq : (nx,), (nu,)
        The equilibrium: zero, and the rest-length change that holds it.
    """

    def __init__(self, linear: LinearModel) -> None:
        self.linear, self._model = linear, charted(linear)
        self.x_eq, self.u_eq = np.zeros(len(linear.states)), np.asarray(linear.equilibrium.inputs, float)
        super().__init__(
            lambda t, x, u, params: np.asarray(self._model.rate(x, u)).ravel(),
            lambda t, x, u, params: np.asarray(self._model.outputs(x, u)).ravel(),
            inputs=list(linear.inputs), outputs=list(linear.outputs), states=list(linear.states), name="tensctl",
        )  # fmt: skip

    def linearize(
        self, x0: Any, u0: Any = None, t: float = 0, params: Any = None, eps: float = 0, copy_names: bool = True,
        **names: Any,
    ) -> control.StateSpace:  # fmt: skip
        """Exact Jacobians at any state and input, with labels; what `control.linearize` calls.

        Parameters
        ----------
        x0 : (nx,) or `control.OperatingPoint`
        u0 : (nu,), optional
            The operating point's, or the equilibrium's.
        t, params, eps, copy_names
            As python-control passes them; the model depends on none of them and labels are always kept.
        **names
            Other labels, as `control.ss` takes them.
        """
        point = isinstance(x0, control.OperatingPoint)
        x = np.asarray(x0.states if point else x0, float) * np.ones(len(self.x_eq))
        given = (x0.inputs if point else self.u_eq) if u0 is None else u0
        parts = self._model.jacobians(x, np.asarray(given, float) * np.ones(len(self.u_eq)))
        labels = {"inputs": list(self.linear.inputs), "outputs": list(self.linear.outputs)}
        labels |= {"states": list(self.linear.states), "name": "tensctl_linear"}
        system = control.ss(*(np.asarray(part) for part in parts), **(labels | names))
        assert isinstance(system, control.StateSpace)
        return system

    def state_of(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " nx"]:
        """State x of nodes and node velocities."""
        return self.linear.state_of(nodes, velocities)


def iosystem(
    dynamics: Dynamics, equilibrium: Equilibrium, *, outputs: Output | Sequence[Output] = ("nodes", "tensions")
) -> TensegritySystem:
    """The full nonlinear model about an equilibrium as a `control.NonlinearIOSystem`.

    For structures of control size: the expression grows with the number of tendons. The chart holds while no rod has
    turned by half a turn from the equilibrium.

    Parameters
    ----------
    outputs : as `linearize` has them

    Raises
    ------
    LinearizationError
        Where `linearize` does.
    """
    return TensegritySystem(linearize(dynamics, equilibrium, outputs=outputs))
