"""What it costs to get somewhere in a given time: each output by one unit, each mode to one joule.

    output c:  min int u'Ru dt  with  c'x(T) = 1                    = 1/|L'c|^2
    mode k:    min int u'Ru dt  with  |x_k(T)|^2/2 = 1 J            = 2/sigma_max(L_k)^2,  L_k the two rows of the mode

Everything that is not asked for may end anywhere. R = diag(dT/du), so the cost is twice the elastic energy of the
shortenings, summed over time: J s. Tensions answer to their own rest length at once and are left out, as is what no
flexible mode moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.analysis.gramian import Gramian, controllability_gramian
from tensctl.analysis.measures import moved_outputs
from tensctl.linear import LinearModel


@dataclass(frozen=True, eq=False)
class ReachEnergies:
    """Least energies over a horizon.

    Attributes
    ----------
    gramian : Gramian
    labels : tuple of str
        Outputs that move and have no feedthrough.
    outputs : (k,) J s per squared unit of the output
    modes : tuple of int
        Indices of the flexible modes.
    joules : (modes,) J s
        For one joule in each mode.
    """

    gramian: Gramian
    labels: tuple[str, ...]
    outputs: Float[np.ndarray, " k"]
    modes: tuple[int, ...]
    joules: Float[np.ndarray, " modes"]

    @classmethod
    def of(cls, linear: LinearModel, horizon: float) -> ReachEnergies:
        """Energies of all outputs and flexible modes.

        Parameters
        ----------
        horizon : float, s
            Infinite for a damped model.
        """
        flexible, gramian = linear.flexible, controllability_gramian(linear, horizon)
        shown = moved_outputs(linear)
        unsorted = np.empty_like(gramian.factor)
        unsorted[flexible.order] = gramian.factor
        half = len(flexible.modes)
        pairs = np.stack([unsorted[:half], unsorted[half : 2 * half]], axis=1)
        largest = np.linalg.norm(pairs, 2, axis=(1, 2)) if half else np.zeros(0)
        with np.errstate(divide="ignore"):
            joules = 2.0 / largest**2
        return cls(
            gramian=gramian,
            labels=tuple(flexible.outputs[k] for k in shown),
            outputs=gramian.energies(flexible.C[shown]),
            modes=tuple(mode.index for mode in flexible.modes),
            joules=joules,
        )

    def verify(self, tol: float = 1e-9) -> None:
        """Check the Gramian."""
        self.gramian.verify(tol)

    def __str__(self) -> str:
        """The cheapest and the dearest of both, in sentences."""
        lines = [f"least int sum(dT/du u^2) dt within {self.gramian.horizon:g} s, all else free to end anywhere:"]
        names = [f"mode {index}" for index in self.modes]
        for what, unit, labels, values in (
            ("one unit of an output", "J s/unit^2", self.labels, self.outputs),
            ("one joule in a mode", "J s", names, self.joules),
        ):
            if len(values):
                order = np.argsort(values, kind="stable")
                ends = [f"{labels[k]} {values[k]:.3g}" for k in (order[0], order[-1])]
                lines.append(f"  {what}, {unit}: from {ends[0]} to {ends[1]}")
        lines.append(f"  states: the dearest direction costs {self.gramian.spread:.3g} times the cheapest")
        return "\n".join(lines)
