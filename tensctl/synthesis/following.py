"""Outputs that follow a signal: what is wanted of them at every stage pulls on the plan.

    cost   sum |M z_k - r_k|^2 + |e_k - e_s|^2 energy + (v_k - v_s)'R (v_k - v_s),   z = (e, v),   (e_s, v_s) = Z r_k

M are the weighted outputs over their sizes, r what is wanted of them, both deviations from the reference. (e_s, v_s) is
the rest at which M z is nearest to r, of all these the one with the least v'R v: what can be reached is reached without
offset. Multiplied out, stage k adds (q r_k)'z + (s r_k)'v with

    q = -(M' + energy Z_e),   s = -R Z_v

and the last stage, after which r is held for ever, (p r_N)'z + (s r_N)'v with the p of the infinite horizon,

    p = q - K's + (A - B K)'p
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.synthesis.mpc_weights import Weighed

# Singular values of the gain from inputs at rest to weighted outputs that are below this part of the largest are
# directions that rest lengths do not move: for all nodes of the (3,1) mast the least that they do is 0.17, the next
# 1e-16. A larger cut asks less of weak directions and leaves an offset there.
_MOVED = 1e-6


@dataclass(frozen=True, eq=False)
class Following:
    """How wanted outputs enter the condensed problem.

    Attributes
    ----------
    weighed : Weighed
    rest : (n, ny)
        Z: where to rest for what is wanted.
    stage, last : (n, ny)
        q and p.
    inputs : (nu, ny)
        s.
    plan : (N nu, N ny)
        f of the condensed problem from what is wanted at all stages.
    start : (n, N ny)
        The part of the cost that the start has from it.
    """

    weighed: Weighed
    rest: Float[np.ndarray, "n ny"]
    stage: Float[np.ndarray, "n ny"]
    last: Float[np.ndarray, "n ny"]
    inputs: Float[np.ndarray, "nu ny"]
    plan: np.ndarray
    start: np.ndarray

    def pulls(self, stages: int) -> list[np.ndarray]:
        """Q of every stage but the last, p of the last."""
        return [self.stage] * (stages - 1) + [self.last]


def rest_for(weighed: Weighed, R: Float[np.ndarray, "nu nu"]) -> Float[np.ndarray, "n ny"]:
    """Z: states and inputs at rest at which weighted outputs are nearest to what is wanted of them.

    Raises
    ------
    SynthesisError
        Where an input at rest has no state at rest: a mode without stiffness.
    """
    linear = weighed.linear
    flat = [mode.index for mode in linear.modes if not mode.omega2 > 0]
    if flat or linear.drifting:
        raise SynthesisError(
            "a signal to follow needs a structure that comes to rest for every input; "
            + (f"mode {flat[0]} has no stiffness." if flat else "drag couples the drift of a free one to its shape.")
        )
    states = np.vstack([-np.linalg.solve(linear.A, linear.B), np.eye(linear.B.shape[1])])
    cheap = 1 / np.sqrt(np.diag(R))
    return states @ (cheap[:, None] * np.linalg.pinv(weighed.rows @ states * cheap, rcond=_MOVED))


def following(
    weighed: Weighed, energy: float, R: np.ndarray, dt: float, loop: np.ndarray, K: np.ndarray,
    predicted: tuple[np.ndarray, np.ndarray],
) -> Following:  # fmt: skip
    """Set up what wanted outputs do to a condensed problem.

    Parameters
    ----------
    weighed : Weighed
    energy : float
        Weight of twice the energy of vibration.
    R : (nu, nu)
        Weight of the inputs over a period.
    dt : float, s
    loop : (n, n)
        A - B K.
    K : (nu, n)
    predicted : (N, n, n), (N, n, N nu)
        States of stages 1 to N from the start and from the stacked inputs.
    """
    free, forced = predicted
    stages, nu, ny = len(free), len(R), len(weighed.rows)
    rest = rest_for(weighed, R)
    q, s = -dt * weighed.rows.T, -R @ rest[-nu:]
    q[:-nu] -= energy * dt * rest[:-nu]
    p = np.linalg.solve(np.eye(len(loop)) - loop.T, q - K.T @ s)
    plan, start = np.kron(np.eye(stages), s), np.zeros((len(loop), stages * ny))
    for k in range(stages):
        columns, pull = slice(k * ny, (k + 1) * ny), p if k == stages - 1 else q
        plan[:, columns] += forced[k].T @ pull
        start[:, columns] = free[k].T @ pull
    return Following(weighed, rest, q, p, s, plan, start)
