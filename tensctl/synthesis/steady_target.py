"""Where to rest under the disturbances that are estimated: the target of offset-free control.

    minimise    |N_z^-1 (G u + G_d d - r)|^2 + rho v'R v + sigma (v - v_last)'R(v - v_last),   v = u - u_r
    subject to  rest lengths within their bounds,   tensions at rest >= tension_min

G and G_d are the static gains to what is tracked, r is what is wanted. What cannot be reached is approached in least
squares of the tracked sensors' noise; rho decides only among inputs that do the same, as change of prestress does.
Tension floors that cannot be kept give way by the least, as in a control step.

Estimated disturbances are never exact, and a direction that inputs hardly move would have u follow their errors by
metres, far beyond what rates allow: the loop then chases its own target. sigma holds on to the last target: of what
is missing, a direction of gain g, relative to the best one, takes g^2 / (g^2 + sigma) a step. A target that stays is
where it would be without sigma, so nothing is left over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from tensctl.analysis.scaling import input_stiffness
from tensctl.synthesis.disturbance import Disturbed
from tensctl.synthesis.qp import QP, Solver
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.relaxed import relax

# Weight of the inputs over the steepest tracked direction: an offset of 1e-8 over the square of a direction's gain
# relative to the best one, 1e-6 at a tenth; the conditioning of H is its inverse.
_RHO = 1e-8
# Weight of a change of the target, likewise. The pinned class 2 (4,1) shell, two of whose directions have gains of
# 1e-3, swings for good after a push with 1e-5 and calms down from 1e-4 on; 0.1 mm of offset take it 25 s with 3e-4,
# and over 40 s with 1e-3.
_SIGMA = 3e-4
# Part of the last target's v that the sum of both squares is about.
KEPT = _SIGMA / (_RHO + _SIGMA)


@dataclass(frozen=True, eq=False)
class Target:
    """A state at rest.

    Attributes
    ----------
    state : (nx,)
    inputs : (nu,) m
        Deviations from the equilibrium's inputs.
    missed : float
        What stays between it and the wish, root mean square in units of the tracked sensors' noise.
    relaxed : float, m
        Elongation by which the worst tension floor gives way.
    beside : (nu,) m
        Inputs less those of the reference, v.
    """

    state: Float[np.ndarray, " nx"]
    inputs: Float[np.ndarray, " nu"]
    missed: float
    relaxed: float
    beside: Float[np.ndarray, " nu"]


class SteadyTarget:
    """The programme of one model; only vectors change from step to step.

    Parameters
    ----------
    model : Disturbed
    tracked : (nz,) int
        Sensors whose values are to be reached.
    tension : (nT, nx + nu), tension_disturbed : (nT, nd)
        Scaled tension maps, m.

    Attributes
    ----------
    H : (nu, nu)
    rows : (nT + nu, nu)
        Scaled tensions at rest, then the inputs themselves.
    floor_from : (nT, nd)
        Scaled tensions at rest from d, m.
    """

    def __init__(
        self, model: Disturbed, tracked: np.ndarray, tension: np.ndarray, tension_disturbed: np.ndarray
    ) -> None:
        by_input, by_disturbance = model.rest
        nx = len(by_input)
        noise = model.sensors.noise[tracked, None]
        self.model, self.tracked = model, tracked
        self.gain = (model.C @ by_input + model.D)[tracked] / noise
        self.disturbed = (model.C @ by_disturbance + model.shown)[tracked] / noise
        self.floor_from = tension[:, :nx] @ by_disturbance + tension_disturbed
        rows = tension[:, :nx] @ by_input + tension[:, nx:]
        weight = input_stiffness(model.linear)
        self._rho = (_RHO + _SIGMA) * np.linalg.norm(self.gain, 2) ** 2 * np.diag(weight / weight.max())
        # A metre of rest length counts the steepest gain: H is of size one.
        self._scale = 1.0 / np.linalg.norm(self.gain, 2) ** 2
        H = self._scale * (self.gain.T @ self.gain + self._rho)
        self.H, self.rows = 0.5 * (H + H.T), np.vstack([rows, np.eye(len(weight))])
        self._solvers: dict[bool, Solver] = {}

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_solvers": {}}  # a copy sets up its own

    @property
    def from_given(self) -> Float[np.ndarray, "nu m"]:
        """The programme's f, row by row from d, r and u_r + KEPT v_last side by side."""
        noise = self.model.sensors.noise[self.tracked]
        return self._scale * np.hstack([self.gain.T @ self.disturbed, -self.gain.T / noise, -self._rho])

    def at(
        self, d: np.ndarray, wanted: np.ndarray, near: np.ndarray, bounds: tuple[np.ndarray, np.ndarray],
        margin: np.ndarray, last: Target | None,
    ) -> Target | None:  # fmt: skip
        """The target under d, or None when no solver's answer is acceptable.

        Parameters
        ----------
        wanted : (nz,)
            Deviation of what is tracked from the equilibrium's.
        near : (nu,) m
            Inputs u_r of the reference.
        bounds : two of (nu,) m
        margin : (nT,) m
            Tensions of the equilibrium above the floor, scaled.
        last : Target or None
            Of the step before.
        """
        about = near if last is None else near + KEPT * last.beside
        gap = self.disturbed @ d - wanted / self.model.sensors.noise[self.tracked]
        f = self._scale * (self.gain.T @ gap - self._rho @ about)
        floor = -margin - self.floor_from @ d
        qp = QP(
            self.H, f, self.rows, np.concatenate([bounds[0], floor, bounds[0]]),
            np.concatenate([bounds[1], np.full(floor.size, np.inf), bounds[1]]),
        )  # fmt: skip
        for gives_way in (False, True):
            asked = relax(qp, 1) if gives_way else qp
            if gives_way not in self._solvers:
                self._solvers[gives_way] = DaqpSolver(asked)
            found = self._solvers[gives_way].solve(asked)
            if (z := found.accepted) is not None:
                u = np.clip(z[: near.size], *bounds)
                missed = self.gain @ u + gap
                by_input, by_disturbance = self.model.rest
                return Target(
                    by_input @ u + by_disturbance @ d, u, float(np.sqrt(np.mean(missed**2))),
                    float((floor - self.rows[: floor.size] @ u).max(initial=0.0)) if gives_way else 0.0, u - near,
                )  # fmt: skip
        return None
