"""Quadratic cost in physical terms: every part counts 1 at its allowed size (Bryson's rule).

    cost rate  E/E_max + sum |dp/p_max|^2 + sum (dT/T_max)^2 + sum (u/u_max)^2  =  x'Q x + 2 x'N u + u'R u

Tensions answer to rest lengths at once, dT = C x + D u, so a tension weight W = 1/T_max^2 adds C'WC to Q, C'WD to N and
D'WD to R: the cross term N is part of the cost, not an approximation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Inexact

from tensctl.analysis.scaling import input_stiffness
from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.scene.given import argument, check_kind
from tensctl.scene.tables import per_member
from tensctl.scene.values import Number
from tensctl.structure.labels import by_label
from tensctl.synthesis.shown import shown

Size = float | Mapping[str, float]
_UNITS = {"nodes": "m", "tensions": "N", "rest_lengths": "m"}


@dataclass(frozen=True, eq=False)
class Cost:
    """Weights of x'Q x + 2 x'N u + u'R u on the flexible states x and the rest-length changes u.

    Attributes
    ----------
    Q : (nx, nx)
    R : (nu, nu)
    N : (nx, nu)
    """

    Q: Inexact[np.ndarray, "nx nx"]
    R: Inexact[np.ndarray, "nu nu"]
    N: Inexact[np.ndarray, "nx nu"]

    @property
    def matrix(self) -> Inexact[np.ndarray, "n n"]:
        """[Q N; N' R]."""
        return np.block([[self.Q, self.N], [self.N.conj().T, self.R]])


def weights(
    linear: LinearModel,
    *,
    energy: float | None = None,
    nodes: Size | None = None,
    tensions: Size | None = None,
    rest_lengths: Size | None = None,
) -> Cost:
    """Weights from allowed sizes; what is not given is left out of the cost.

    Parameters
    ----------
    linear : LinearModel
        Weights are for `linear.flexible`.
    energy : float, J
        Energy of vibration that counts 1.
    nodes : m
        Displacement of a node, seen in the co-moving frame, that counts 1; a number, or a table by label pattern that
        weighs the nodes it names.
    tensions : N
        Change of a tension that counts 1.
    rest_lengths : m
        Change of a rest length that counts 1. Without it a rest length counts by the energy k u^2/2 that it would
        store, where `energy` is given.

    Raises
    ------
    SynthesisError
        A size that is no positive number, or an input that costs nothing.
    """
    check_kind(LinearModel, linear=linear)
    flexible = linear.flexible
    structure, nx, nu = flexible.dynamics.structure, *flexible.B.shape
    total = np.zeros((nx + nu, nx + nu))
    if energy is not None:
        total[:nx, :nx] += 0.5 * np.eye(nx) / argument("energy", energy, Number("J", above=0))
    if nodes is not None:
        sizes = allowed_sizes("nodes", structure.node_labels, nodes)
        total += _squares(shown(flexible, "nodes"), sizes[np.flatnonzero(structure.free) // 3])
    if tensions is not None:
        sizes = allowed_sizes("tensions", structure.tendon_labels, tensions)
        total += _squares(shown(flexible, "tensions"), sizes)
    total[nx:, nx:] += np.diag(_of_inputs(flexible, energy, rest_lengths))
    if nu and rest_lengths is None and np.linalg.eigvalsh(total[nx:, nx:]).min() <= 0:
        raise SynthesisError("some rest length costs nothing; give rest_lengths, the change that is allowed, in m.")
    return Cost(total[:nx, :nx], total[nx:, nx:], total[:nx, nx:])


def _of_inputs(linear: LinearModel, energy: float | None, sizes: Size | None) -> np.ndarray:
    if sizes is not None:
        return 1 / allowed_sizes("rest_lengths", linear.dynamics.input_labels, sizes) ** 2
    return np.zeros(linear.B.shape[1]) if energy is None else 0.5 * input_stiffness(linear) / energy


def _squares(linear: LinearModel, sizes: np.ndarray) -> np.ndarray:
    scaled = np.hstack([linear.C, linear.D]) / sizes[:, None]
    return scaled.T @ scaled


def allowed_sizes(name: str, labels: Sequence[str], given: Size) -> np.ndarray:
    """Allowed sizes by label, infinite where none is named or said; refused where one is no positive number."""
    if not (isinstance(given, float) and given == np.inf):
        given = argument(name, given, per_member(Number(_UNITS[name], above=0)))
    return by_label(labels, given, name, np.inf)
