"""A linear model of fewer states, as a labelled system that says how far it is from the full one.

Undamped modes ring for ever: on an infinite horizon they have no Gramian. So a structure without damping is truncated
with a damping ratio that is stated, or for a finite horizon, over which the impulse response's error is then computed:

    e^2 = int_0^T |C exp(At) B - C_r exp(A_r t) B_r|_F^2 dt
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from tensctl.analysis.gramian import gramian, oscillators
from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Choice, Number
from tensctl.synthesis.truncation import Truncated, balance, balanced, modal
from tensctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """A model of fewer states.

    Attributes
    ----------
    linear : LinearModel
        The flexible model that was truncated.
    damped : (nx, nx)
        Its state matrix, with the damping that was stated.
    truncated : Truncated
    horizon : float or None, s
    """

    linear: LinearModel
    damped: np.ndarray
    truncated: Truncated
    horizon: float | None

    @property
    def bound(self) -> float | None:
        """No gain of the difference is larger at any frequency; None for a finite horizon."""
        return self.truncated.bound

    def error_at(self, omega: float) -> float:
        """Gain of the difference to the full model at an angular frequency."""
        return self.truncated.error_at(omega, self.damped, self.linear.B, self.linear.C)

    def impulse_error(self, T: float) -> float:
        """Root of the integral of the squared difference of the impulse responses up to T s."""
        return self.truncated.impulse_error(T, self.damped, self.linear.B, self.linear.C)

    def to_statespace(self) -> control.StateSpace:
        """The model as a `control.StateSpace` with the full model's inputs and outputs."""
        import control

        t, model = self.truncated, self.linear
        system = control.ss(t.A, t.B, t.C, model.D, inputs=list(model.inputs), outputs=list(model.outputs))
        assert isinstance(system, control.StateSpace)
        return system


@one_blas_thread()
def truncate(
    linear: LinearModel,
    order: int,
    *,
    method: Literal["balanced", "modal"] = "balanced",
    damping: float | None = None,
    horizon: float | None = None,
) -> ReducedModel:
    """Reduce the flexible part of a linear model.

    Parameters
    ----------
    linear : LinearModel
        Its outputs say what is to be kept.
    order : int
        States wanted.
    method : "balanced" or "modal"
    damping : float, optional
        Damping ratio added to every mode; stated, since the structure has no other.
    horizon : float, s, optional
        Balance what happens up to this time only; needs no damping, and gives no bound.

    Raises
    ------
    SynthesisError
        An undamped structure with neither of them, or an order that is not there.
    """
    check_kind(LinearModel, linear=linear)
    argument("method", method, Choice("balanced", "modal"))
    if horizon is not None:
        horizon = argument("horizon", horizon, Number("s", above=0))
    model = linear.flexible
    A = model.A if damping is None else model.A - _damper(model, damping)
    if not len(model.outputs):
        raise SynthesisError("the model has no outputs, so nothing says which states matter; linearize with outputs.")
    if method == "modal" and horizon is not None:
        raise SynthesisError("modal truncation has no horizon; give a damping, or method balanced.")
    if method == "modal":
        return ReducedModel(model, A, modal(A, model.B, model.C, order), None)
    if horizon is None:
        return ReducedModel(model, A, balanced(A, model.B, model.C, order), None)
    modes = oscillators(model) if damping is None else None
    reach, sight = gramian(A, model.B, horizon, modes), gramian(A.T, model.C.T, horizon, modes, transposed=True)
    cut = balance(A, model.B, model.C, reach.factor, sight.factor, order)
    without = Truncated(cut.A, cut.B, cut.C, cut.left, cut.right, cut.values, None)
    return ReducedModel(model, A, without, horizon)


def _damper(linear: LinearModel, ratio: float) -> np.ndarray:
    """2 ratio omega on the speeds of every mode."""
    ratio = argument("damping", ratio, Number("a damping ratio", above=0))
    half = len(linear.modes)
    both = np.concatenate([np.zeros(half), 2 * ratio * linear.scales])
    return np.diag(both[linear.order])
