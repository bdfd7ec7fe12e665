"""The Kalman filter: the dual of LQR, A' for A and C' for B, noise for weights.

    continuous  AX + XA' - XC' V^-1 CX + W = 0,               gain XC' V^-1
    sampled     X = F X F' - F X C'(C X C' + V)^-1 C X F' + W,   gain XC'(C X C' + V)^-1

W holds white forces on the nodes: their intensity in the continuous equation, what they leave behind in a period in the
sampled one, whose X is the covariance just before a sample is seen.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Inexact

from tensctl.linear import LinearModel
from tensctl.scene.given import argument
from tensctl.scene.tables import per_member
from tensctl.scene.values import Number
from tensctl.structure import Structure
from tensctl.structure.labels import by_label
from tensctl.synthesis.crossed import optimal
from tensctl.synthesis.gain_doubt import Doubt, gain_doubt
from tensctl.synthesis.shown import shown
from tensctl.synthesis.weights import Cost

ADVICE = "raise the noise of the sensors, or that of the forces"


@dataclass(frozen=True, eq=False)
class Kalman:
    """A filter for x' = A x + w, y = C x + v, or the sampled one.

    Attributes
    ----------
    A : (n, n)
        F of the sampled one.
    C : (ny, n)
    W, V : covariances or intensities of process and sensor noise
    X : (n, n)
        Covariance of the error; before a sample is seen, in the sampled filter.
    gain : (n, ny)
    residual : float
        What is left of the Riccati equation, over the sum of its terms.
    sampled : bool
    """

    A: Inexact[np.ndarray, "n n"]
    C: Inexact[np.ndarray, "ny n"]
    W: Inexact[np.ndarray, "n n"]
    V: Inexact[np.ndarray, "ny ny"]
    X: Inexact[np.ndarray, "n n"]
    gain: Inexact[np.ndarray, "n ny"]
    residual: float
    sampled: bool

    @cached_property
    def doubt(self) -> Doubt:
        """How far its residual and rounding of its data leave the gain open, |dL V^1/2| beside |L V^1/2|.

        In a sampled filter the covariance of what surprises it, C X C' + V, takes the place of V.
        """
        predictor = (self.A @ self.gain if self.sampled else self.gain).conj().T
        dual = Cost(self.W, self.V, np.zeros(self.C.T.shape))
        A, C = self.A.conj().T, self.C.conj().T
        return gain_doubt(A, C, dual, self.X, predictor, sampled=self.sampled, current=self.sampled)

    @property
    def gain_doubt(self) -> float:
        """Estimated relative change of the gain by the residual and by rounding of the data."""
        return self.doubt.relative


def kalman(A: np.ndarray, C: np.ndarray, W: np.ndarray, V: np.ndarray, *, sampled: bool = False) -> Kalman:
    """The filter with the least covariance of its error.

    Raises
    ------
    SynthesisError
        When no stabilising solution is found.
    """
    dual = Cost(W, V, np.zeros(C.T.shape))
    found = optimal(A.conj().T, C.conj().T, dual, sampled=sampled, advice=ADVICE)
    gain = (np.linalg.solve(V + C @ found.P @ C.conj().T, C @ found.P) if sampled else found.K).conj().T
    return Kalman(A, C, W, V, found.P, gain, found.residual, sampled)


def white_forces(linear: LinearModel, forces: float | Mapping[str, float]) -> Float[np.ndarray, "nx nx"]:
    """Intensity of independent white forces on the free nodes in the states of a model, E E' with E = C' of velocities.

    Parameters
    ----------
    forces : N s^1/2
        Root of the intensity in each direction: after t seconds the momentum that it left has the standard deviation
        forces t^1/2. A number, or a table by node label pattern.

    Raises
    ------
    SynthesisError
        A negative intensity.
    """
    structure = linear.dynamics.structure
    root = force_roots(structure, forces)[np.flatnonzero(structure.free) // 3]
    moved = root[:, None] * shown(linear, "velocities").C
    return moved.T @ moved


def force_roots(structure: Structure, forces: float | Mapping[str, float]) -> Float[np.ndarray, " nodes"]:
    """Root of the intensity of white forces on each node, N s^1/2; refused as by `white_forces`."""
    forces = argument("force_noise", forces, per_member(Number("N s^1/2", least=0)))
    return by_label(structure.node_labels, forces, "force_noise", 0.0)
