"""The model behind offset-free control: constant disturbances, one for each measured direction.

    x' = A x + B u + B_d d,   y = C x + D u + C_d d,   d' = 0

Wrong stiffness, unknown loads and curvature look like constant forces and constant errors of what sensors show. With
S = N^-1 C K, K the compliance to a generalised force and N the sensors' noise, S = U diag(s) V':

    B_d  forces V_i / s_i, as far as S has rank:   they move what is measured by one deviation along U_i
    C_d  N times the rest of the orthonormal basis U: what no force explains

That is as many disturbances as sensors. The rank condition

    [A B_d; C C_d] regular (continuous),   [F - 1, B_d; C, C_d] regular (sampled)

makes all of them seen; a stable filter then shows, at rest, exactly what is measured, and what is tracked has no offset
where the inputs can reach it (G. Pannocchia and J. B. Rawlings, AIChE J. 49 (2003) 426-437, Theorem 1, for as
many disturbances as measurements).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, Sampled, sample_ramped
from tensctl.scene.given import check_kind
from tensctl.synthesis.sensors import Sensors

# A direction that a force of unit energy scale moves by less than this part of the easiest one belongs to the sensors:
# on the (3,1) mast the least is 0.16 of the largest, and the mechanism, which no length shows, 1e-16.
_MOVED = 1e-6


@dataclass(frozen=True, eq=False)
class Disturbed:
    """A flexible model with its constant disturbances, sampled.

    Attributes
    ----------
    linear : LinearModel
    sensors : Sensors
    sampled : Sampled
        Of the states alone, for inputs that ramp.
    C, D : (ny, nx), (ny, nu)
        Of what is measured.
    force : (nx, nd)
        How disturbances drive the states in continuous time; zero columns for those of the sensors.
    after : (nx, nd)
        What a constant disturbance does in a period.
    shown : (ny, nd)
        How disturbances show at once, C_d.
    """

    linear: LinearModel
    sensors: Sensors
    sampled: Sampled
    C: Float[np.ndarray, "ny nx"]
    D: Float[np.ndarray, "ny nu"]
    force: Float[np.ndarray, "nx nd"]
    after: Float[np.ndarray, "nx nd"]
    shown: Float[np.ndarray, "ny nd"]

    @property
    def forces(self) -> int:
        """How many of the disturbances are forces."""
        return int(self.force.any(axis=0).sum())

    @cached_property
    def F(self) -> Float[np.ndarray, "n n"]:
        """Transition of (x, d) in a period."""
        nx, nd = self.after.shape
        return np.block([[self.sampled.F, self.after], [np.zeros((nd, nx)), np.eye(nd)]])

    @cached_property
    def H(self) -> Float[np.ndarray, "ny n"]:
        """What (x, d) shows."""
        return np.hstack([self.C, self.shown])

    @cached_property
    def rank_margin(self) -> float:
        """Least over largest singular value of [F - 1, B_d; C, C_d], sensors and states in units of the sensors' noise.

        A state counts as many deviations as it shows at most, so that the margin is the same in all units.
        """
        nx = len(self.sampled.F)
        C, C_d = self.C / self.sensors.noise[:, None], self.shown / self.sensors.noise[:, None]
        size = np.linalg.norm(C, 2) or 1.0  # sensors that no state moves say nothing of states' units
        top = np.hstack([self.sampled.F - np.eye(nx), size * self.after])
        values = np.linalg.svd(np.vstack([top, np.hstack([C / size, C_d])]), compute_uv=False)
        return float(values[-1] / values[0])

    @cached_property
    def rest(self) -> tuple[Float[np.ndarray, "nx nu"], Float[np.ndarray, "nx nd"]]:
        """States at rest per unit of each input and of each disturbance."""
        both = -np.linalg.solve(self.linear.A, np.hstack([self.linear.B, self.force]))
        return both[:, : self.linear.B.shape[1]], both[:, self.linear.B.shape[1] :]

    def verify(self, tol: float = 1e-12) -> None:
        """Check the rank condition, and that a state at rest stays there.

        Raises
        ------
        SynthesisError
            With the number that fails.
        """
        if not self.rank_margin > tol:
            raise SynthesisError(
                f"the rank condition of offset-free control fails: least singular value {self.rank_margin:.1e} of the "
                f"largest, more than {tol:.0e} is expected; measure other tendons."
            )
        s, (by_input, by_force) = self.sampled, self.rest
        moved = s.F @ by_input + s.G0 + s.G1 - by_input, s.F @ by_force + self.after - by_force
        left = max(np.abs(move).max() / np.abs(at).max() for move, at in zip(moved, self.rest, strict=True) if at.any())
        if not left <= 1e-9:
            raise SynthesisError(f"states at rest move by {left:.1e} of themselves in a period; 1e-9 is expected.")


def disturbed(linear: LinearModel, sensors: Sensors, dt: float) -> Disturbed:
    """Give a flexible model as many constant disturbances as it has sensors.

    Raises
    ------
    SynthesisError
        Sensors of another structure, or a mode without stiffness.
    """
    check_kind(Sensors, sensors=sensors)
    if sensors.structure is not linear.dynamics.structure:
        raise SynthesisError("the sensors belong to another structure; make them for linear.dynamics.structure.")
    flat = [mode.index for mode in linear.modes if not mode.omega2 > 0]
    if flat or linear.drifting:
        raise SynthesisError(
            "offset-free control needs a structure that a constant force leaves at rest; "
            + (f"mode {flat[0]} has no stiffness." if flat else "drag couples the drift of a free one to its shape.")
        )
    C, D = sensors.rows(linear)
    rates = np.zeros((len(linear.A), len(linear.modes)))
    rates[np.argsort(linear.order)[len(linear.modes) :], np.arange(len(linear.modes))] = 1.0
    moves = -C @ np.linalg.solve(linear.A, rates) / sensors.noise[:, None]
    U, s, Vt = np.linalg.svd(moves)
    seen = int((s > _MOVED * s.max(initial=0.0)).sum())
    force = np.zeros((len(linear.A), len(U)))
    force[:, :seen] = rates @ (Vt[:seen].T / s[:seen])
    shown = np.zeros((len(U), len(U)))
    shown[:, seen:] = sensors.noise[:, None] * U[:, seen:]
    held = sample_ramped(linear.A, force, dt)
    sampled = sample_ramped(linear.A, linear.B, dt)
    return Disturbed(linear, sensors, sampled, C, D, force, held.G0 + held.G1, shown)
