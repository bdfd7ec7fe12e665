"""Rest lengths for a new shape: least change of u along equilibria whose tensions stay above a floor.

    minimise |u|^2   subject to   h(p(u)) = wanted,   T(u) >= tension_min,   L0 - u >= floor

p(u) is the equilibrium itself, so every iterate balances. Sequential quadratic programming with the exact static
influence dp/du = J Phi diag(1/omega^2) Phi'G: constraints converge as Newton does, the minimum linearly. The curvature
of h is not in the quadratic model; where it makes the iterates swing from side to side, a proximal term
sigma |u - u_now|^2 is added, which moves neither the constraints nor the minimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.analysis import static_influence
from tensctl.errors import EquilibriumError, SynthesisError
from tensctl.statics import Equilibrium, settle, stretch_map
from tensctl.synthesis.qp import QP
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.target import Height
from tensctl.threads import one_blas_thread

_STEPS = 200
# The height is met to this part of itself; the least change of u to this part of its largest entry.
_HEIGHT = 1e-12
_CHANGE = 1e-6
# Misfits smaller than this part of the height may grow a little from step to step.
_NEAR = 1e-6


@dataclass(frozen=True, eq=False)
class ShapeProblem:
    """Shape planning from one equilibrium.

    Attributes
    ----------
    height : Height
    tension_min : float, N
    """

    height: Height
    tension_min: float

    @one_blas_thread()
    def solve(self, start: Equilibrium, wanted: float) -> Equilibrium:
        """The equilibrium of the wanted height with the least rest-length change.

        Raises
        ------
        SynthesisError
            When the rest lengths cannot make the shape with these floors.
        """
        if not start.inputs.size:
            raise SynthesisError("no tendon has an actuator that moves anything, so no other shape can be made.")
        now, limit, sigma, before = start, self._reach(start), 0.0, np.zeros_like(start.inputs)
        for _ in range(_STEPS):
            step = self._next_inputs(now, wanted, sigma) - now.inputs
            step *= min(1.0, limit / max(np.abs(step).max(initial=0.0), 1e-300))
            following = _settled(now, now.inputs + step)
            if following is None or self._misfit(following, wanted) > self._misfit(now, wanted) + _NEAR * abs(wanted):
                limit = 0.25 * np.abs(step).max()
                continue
            limit = min(2 * limit, self._reach(now))
            if step @ before < 0 and np.linalg.norm(step) > 0.3 * np.linalg.norm(before):
                sigma = 2 * sigma + 0.5
            now, before = following, step
            met = abs(self.height.of(now.nodes) - wanted) <= _HEIGHT * abs(wanted)
            if met and np.abs(step).max() <= _CHANGE * max(np.abs(now.inputs).max(), 1e-300):
                return now
        raise SynthesisError(
            f"no rest lengths were found for a height of {wanted:.4g} m with tensions above {self.tension_min:g} N; "
            f"the last try stood {self.height.of(now.nodes):.4g} m high; ask for less, or lower tension_min."
        )

    def _reach(self, start: Equilibrium) -> float:
        """Largest change of one rest length in one iteration, m: a tenth of the shortest."""
        return 0.1 * float(start.rest_lengths.min())

    def _misfit(self, now: Equilibrium, wanted: float) -> float:
        """Height error plus the worst missing tension over its tendon's stiffness, m: what a step may not raise."""
        missing = -self._margin(now)[~now.structure.grounded_tendons].min(initial=0.0)
        return abs(self.height.of(now.nodes) - wanted) + float(missing)

    def _margin(self, now: Equilibrium) -> np.ndarray:
        """Length beyond what the tension floor asks for, m: l - L - T/k, or l - L (1 + T/EA); also of slack tendons."""
        return now.lengths - self._share(now) * now.rest_lengths - self._extra(now)

    def _margin_slope(self, now: Equilibrium, reach: np.ndarray) -> np.ndarray:
        """Growth of the margin per unit of rest-length shortening, (nt, nu)."""
        slope, inputs, gearing = stretch_map(now) @ reach, now.potential.members.inputs, now.potential.members.gearing
        slope[inputs, gearing.motor] += gearing.ratio * self._share(now)[inputs]
        return slope

    def _share(self, now: Equilibrium) -> np.ndarray:
        members = now.potential.members
        return np.ones_like(now.lengths) if members.law == "k" else 1 + self.tension_min / members.stiffness

    def _extra(self, now: Equilibrium) -> np.ndarray:
        members = now.potential.members
        return self.tension_min / members.stiffness if members.law == "k" else np.zeros_like(now.lengths)

    def _next_inputs(self, now: Equilibrium, wanted: float, sigma: float) -> np.ndarray:
        members, reach = now.potential.members, static_influence(now)
        rise = (now.point.tangent @ reach).T @ self.height.gradient.ravel()
        kept = ~now.structure.grounded_tendons
        slope = self._margin_slope(now, reach)[kept]
        rows = np.vstack([rise, slope])
        u = now.inputs
        low_tension = slope @ u - self._margin(now)[kept]
        target = wanted - self.height.of(now.nodes) + rise @ u
        lower, upper = members.input_bounds
        qp = QP(
            H=(1 + sigma) * np.eye(u.size), f=-sigma * u, A=rows,
            lower=np.concatenate([lower, [target], low_tension]),
            upper=np.concatenate([upper, [target], np.full(kept.sum(), np.inf)]),
        )  # fmt: skip
        solution = DaqpSolver(qp).solve(qp)
        if solution.z is None:
            raise SynthesisError(
                f"no small rest-length change brings the height from {self.height.of(now.nodes):.4g} m towards "
                f"{wanted:.4g} m with tensions above {self.tension_min:g} N; ask for less, or lower tension_min."
            )
        return solution.z


def _settled(now: Equilibrium, inputs: np.ndarray) -> Equilibrium | None:
    """The stable equilibrium that follows from a change of inputs, or None when there is none nearby."""
    guess = static_influence(now) @ (inputs - now.inputs)
    try:
        found = settle(now.potential, start=now.potential.manifold.retract(now.nodes, guess), inputs=inputs)
    except EquilibriumError:
        return None
    return found if found.stable else None
