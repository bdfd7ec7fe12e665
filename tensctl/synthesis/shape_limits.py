"""What a planned shape has to keep, member by member: what was asked, or more where the way beside it lacks some.

tension_min <= T <= tension_max,   lower <= u <= upper,   d >= clearance
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.statics import Equilibrium
from tensctl.synthesis.input_limits import input_range
from tensctl.synthesis.rod_room import gaps_of
from tensctl.synthesis.tension_room import limited
from tensctl.synthesis.weights import Size


@dataclass(frozen=True, eq=False)
class ShapeLimits:
    """Limits of one planned shape; as differences, what is missing of them.

    Attributes
    ----------
    tension_min, tension_max : (nt,) N
        Infinite where a tendon has no stall limit.
    lower, upper : (nu,) m
        Of the inputs.
    clearance : (pairs,) m
        Between pairs of rods, in the order of `rod_gaps`; none without one asked.
    """

    tension_min: Float[np.ndarray, " tendons"]
    tension_max: Float[np.ndarray, " tendons"]
    lower: Float[np.ndarray, " nu"]
    upper: Float[np.ndarray, " nu"]
    clearance: Float[np.ndarray, " pairs"]

    @property
    def parts(self) -> tuple[np.ndarray, ...]:
        """All of them, in this order."""
        return self.tension_min, self.tension_max, self.lower, self.upper, self.clearance

    def tightened(self, lack: ShapeLimits) -> ShapeLimits:
        """Narrower by what is lacking, all of it >= 0."""
        return ShapeLimits(
            self.tension_min + lack.tension_min,
            self.tension_max - lack.tension_max,
            self.lower + lack.lower,
            self.upper - lack.upper,
            self.clearance + lack.clearance,
        )


@dataclass(frozen=True, eq=False)
class Asked:
    """Limits of every shape on a path, as a scene or a call gives them.

    Attributes
    ----------
    tension_min : float, N
    clearance : float, m, optional
        Least distance of two rods' surfaces.
    u_max : number or table by tendon label, m, optional
        Largest change of a rest length from L0, either way.
    """

    tension_min: float
    clearance: float | None = None
    u_max: Size | None = None

    def limits(self, start: Equilibrium) -> ShapeLimits:
        """The same by tendon, input and pair of rods, with stall limits and floors of rest lengths."""
        members = start.potential.members
        floors = np.where(start.structure.grounded_tendons, -np.inf, self.tension_min)
        pairs = np.zeros(0) if self.clearance is None else np.full(len(gaps_of(start).pairs), self.clearance)
        return ShapeLimits(floors, members.force_max, *input_range(start.structure, members, self.u_max), pairs)

    def said(self, now: Equilibrium) -> str:
        """The limits in words: "tensions above 0.1 N and up to force_max"."""
        stalls = " and up to force_max" * bool(limited(now).any())
        apart = "" if self.clearance is None else f" and rods {self.clearance:g} m apart"
        changed = "" if self.u_max is None else " and rest lengths changed by at most u_max"
        return f"tensions above {self.tension_min:g} N{stalls}{apart}{changed}"

    def remedy(self, now: Equilibrium) -> str:
        """What would leave more room, in words."""
        ways = ["ask for less", "lower tension_min"]
        ways += ["raise actuators.force_max"] * bool(limited(now).any())
        ways += ["lower target.clearance"] * (self.clearance is not None)
        ways += ["raise mpc.u_max"] * (self.u_max is not None)
        return f"{', '.join(ways[:-1])}, or {ways[-1]}"
