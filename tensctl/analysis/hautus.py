"""The distance over A and B together at an eigenvalue: the smallest singular value of the Hautus matrix.

    sigma_min([A - lambda I, B]) = min |[dA, dB]|_2 such that lambda is an eigenvalue of A + dA that B + dB never moves

It is at most the distance over B alone, |v* B|, which the left eigenvector v attains with dA = 0, and moves no faster
than A, B and lambda do. Accurate to rounding of |[A, B]|: below about 1e-15 of that it says nothing.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Complex, Float

from tensctl.analysis.damped import DampedModes
from tensctl.analysis.scaling import energy_inputs
from tensctl.analysis.verdict import ModalReport
from tensctl.errors import LinearizationError
from tensctl.linear import LinearModel
from tensctl.threads import one_blas_thread


@one_blas_thread()
def hautus_distances(linear: LinearModel, question: str) -> Float[np.ndarray, " modes"]:
    """The distance of each mode; both eigenvalues of a damped one are asked, and the worse counts."""
    A, B = _pair(linear, question)
    found: dict[complex, float] = {}
    for pole in _poles(linear, A).ravel():
        upper = complex(pole.real, abs(pole.imag))  # a real pair (A, B) has the same distance at the conjugate
        if upper not in found:
            found[upper] = float(np.linalg.svd(np.hstack([A - upper * np.eye(len(A)), B]), compute_uv=False)[-1])
    each = [min(found[complex(p.real, abs(p.imag))] for p in both) for both in _poles(linear, A)]
    return np.array(each).reshape(-1)


def check_distances(linear: LinearModel, report: ModalReport, tol: float) -> None:
    """`ModalReport.verify`: a group with a "no" has no distance, one without has some."""
    A, B = _pair(linear, report.question)
    refused = {mode.cluster for mode in report.modes if mode.verdict != "yes"}
    size = float(np.linalg.norm(np.hstack([A, B]), 2))
    for mode, distance in zip(report.modes, report.hautus, strict=True):
        lost = mode.verdict == "no" and distance > tol * size
        false = mode.cluster not in refused and distance <= np.finfo(float).eps * size
        if lost or false:
            raise LinearizationError(
                f"mode {mode.index} is said to be {report.question}: {mode.verdict}, but the Hautus matrix at its "
                f"eigenvalue has the smallest singular value {distance:.1e} of {size:.1e}."
            )


def _pair(linear: LinearModel, question: str) -> tuple[np.ndarray, np.ndarray]:
    return (linear.A, energy_inputs(linear)) if question == "controllable" else (linear.A.T, linear.C.T)


def _poles(linear: LinearModel, A: np.ndarray) -> Complex[np.ndarray, "modes 2"]:
    """Both eigenvalues of each mode, 1/s; frequencies that are equal to rounding share one."""
    if linear.dynamics.damped:
        return DampedModes.of(A, linear.order, len(linear.modes)).eigenvalues
    rounding, omega2 = linear.equilibrium.spectrum.tolerance, []
    for mode in linear.modes:
        own = 0.0 if mode.kind == "rigid-body" else mode.omega2
        omega2.append(omega2[-1] if omega2 and abs(own - omega2[-1]) <= rounding else own)
    root = np.sqrt(-np.array(omega2) + 0j)
    return np.stack([root, -root], axis=1)
