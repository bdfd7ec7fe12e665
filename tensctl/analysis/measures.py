"""How good a set of actuators is: concave functions of z, where z_t = 1 takes tendon t and 0 leaves it out.

    log det         log det(I + sum_t z_t W_t/eps)                  W_t: Gramian of tendon t over the horizon
    inverse         -tr (I + sum_t z_t W_t/eps)^-1                  mean energy over directions, cut off at eps
    least gain      min over frequencies lambda_min(sum_t z_t b_t b_t')     b_t: its drive on the modes of one frequency
    static reach    log det(I + sum_t z_t y_t y_t'/eps)             y_t: outputs at rest per input

All inputs are in the square root of their energy, sqrt(dT/du) u. eps is a millionth of the mean over directions when
all tendons act: what costs a million times the mean counts as not reached. Both log det are monotone, submodular and
zero for no tendon at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.analysis.gramian import single_gramians
from tensctl.analysis.modal import near_modes
from tensctl.analysis.reach import Reach
from tensctl.analysis.scaling import tension_slopes
from tensctl.errors import LinearizationError
from tensctl.linear import LinearModel

MeasureName = Literal["log det", "inverse", "least gain", "static reach"]
MEASURES: tuple[MeasureName, ...] = ("log det", "inverse", "least gain", "static reach")
_CUT = 1e-6


@dataclass(frozen=True, eq=False)
class Measure:
    """One measure of one model.

    Attributes
    ----------
    name : str
    blocks : one (nu, k, k) array, or one for each frequency
        What each tendon adds.
    """

    name: MeasureName
    blocks: tuple[Float[np.ndarray, "nu _ _"], ...]

    @property
    def count(self) -> int:
        """Tendons to choose from."""
        return len(self.blocks[0])

    @property
    def submodular(self) -> bool:
        """Whether a tendon adds less the more there are."""
        return self.name in ("log det", "static reach")

    def __call__(self, z: Float[np.ndarray, " nu"]) -> float:
        """The measure of a choice, or of parts of tendons."""
        if self.name == "least gain":
            return min(float(np.linalg.eigvalsh(_sum(block, z))[0]) for block in self.blocks)
        X = np.eye(self.blocks[0].shape[1]) + _sum(self.blocks[0], z)
        if self.name == "inverse":
            return -float(np.trace(np.linalg.inv(X)))
        return float(2 * np.log(np.diag(np.linalg.cholesky(X))).sum())

    def slope(self, z: Float[np.ndarray, " nu"]) -> Float[np.ndarray, " nu"]:
        """A supergradient: f(y) <= f(z) + slope(z)'(y - z) for all y."""
        if self.name == "least gain":
            pairs = [np.linalg.eigh(_sum(block, z)) for block in self.blocks]
            worst = min(range(len(pairs)), key=lambda k: pairs[k][0][0])
            v = pairs[worst][1][:, 0]
            return np.einsum("i,tij,j->t", v, self.blocks[worst], v)
        inverse = np.linalg.inv(np.eye(self.blocks[0].shape[1]) + _sum(self.blocks[0], z))
        weight = inverse @ inverse if self.name == "inverse" else inverse
        return np.einsum("ij,tij->t", weight, self.blocks[0])


def _sum(blocks: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.tensordot(z, blocks, axes=1)


def measure_of(linear: LinearModel, name: MeasureName, horizon: float) -> Measure:
    """Build a measure.

    Parameters
    ----------
    horizon : float, s
        Of the Gramians; the other two need none.

    Raises
    ------
    LinearizationError
        For an unknown name, or static reach without outputs of position or length.
    """
    if name not in MEASURES:
        raise LinearizationError(f'measure is "{name}"; expected one of {", ".join(MEASURES)}.')
    flexible = linear.flexible
    if name == "least gain":
        drive = Reach(flexible).drive / np.sqrt(tension_slopes(flexible))
        groups = [group for group, _ in near_modes(flexible)]
        return Measure(name, tuple(np.einsum("it,jt->tij", drive[g], drive[g]) for g in groups))
    if name == "static reach":
        reach = static_outputs(linear)
        return Measure(name, (_cut(np.einsum("it,jt->tij", reach, reach)),))
    return Measure(name, (_cut(single_gramians(linear, horizon)),))


def moved_outputs(linear: LinearModel) -> list[int]:
    """Outputs that flexible modes move and that have no feedthrough: positions and lengths."""
    flexible = linear.flexible
    return [k for k in range(len(flexible.outputs)) if flexible.C[k].any() and not flexible.D[k].any()]


def static_outputs(linear: LinearModel) -> Float[np.ndarray, "ny nu"]:
    """Outputs without feedthrough at rest, per input in the square root of its energy."""
    flexible = linear.flexible
    shown = moved_outputs(linear)
    if not shown:
        raise LinearizationError("static reach needs outputs of nodes or lengths; add them to linearize.outputs.")
    drive = Reach(flexible).drive / np.sqrt(tension_slopes(flexible))
    omega2, half = np.array([mode.omega2 for mode in flexible.modes]), len(flexible.modes)
    unsorted = np.zeros((len(flexible.A), drive.shape[1]))
    unsorted[:half] = (flexible.scales / omega2)[:, None] * drive
    return flexible.C[shown] @ unsorted[flexible.order]


def _cut(blocks: np.ndarray) -> np.ndarray:
    """Blocks over eps."""
    mean = float(np.trace(blocks.sum(axis=0))) / max(blocks.shape[1], 1)
    return blocks / (_CUT * mean) if mean > 0 else blocks
