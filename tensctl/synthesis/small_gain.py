"""How far a reduced controller is from the full one, as the loop sees it, and what that proves.

    full      u = -K z + e,   z the state of the plant: the full estimate follows it, since e is known to both
    reduced   u = -C_r xi_r,  the full one with e = E e,   E: e -> (regulated plant) -> K z - C_r xi_r

E is stable where the reduced estimator is by itself. With g = |R^1/2 E R^-1/2|_inf < 1 no frequency lets the difference
reproduce itself: the loop of the reduced controller is stable (small gain), and every gain from a disturbance of the
commands differs from the full loop's, T (I - E)^-1 - T, by at most g / (1 - g) of it. For g >= 1 nothing is proven.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.estimator import Estimator, Plant
from tensctl.synthesis.hinf import Peak, System, hinf

# A change of a thousandth is none that matters, and gains near rounding have no enclosure.
_LEAST = 1e-3


@dataclass(frozen=True)
class SmallGain:
    """What the difference of a reduced controller to the full one proves.

    Attributes
    ----------
    peak : Peak
        Enclosure of g, with inputs in the square root of their weight.
    """

    peak: Peak

    @property
    def proven(self) -> bool:
        """Whether it proves the loop stable; if not, it cannot tell."""
        return self.peak.high < 1

    @property
    def change(self) -> float:
        """Relative bound on the change of the loop's answers to disturbed commands; infinite if nothing is proven."""
        return self.peak.high / (1 - self.peak.high) if self.proven else np.inf

    def __str__(self) -> str:
        """One sentence."""
        if self.proven:
            return (
                f"small gain {self.peak.high:.3g} < 1 proves the loop stable; its answers to disturbed commands change "
                f"by at most {100 * self.change:.3g} %"
            )
        return f"small gain {self.peak.low:.3g} proves nothing: only below 1 it would"


def difference(plant: Plant, K: Float[np.ndarray, "nu n"], R: Float[np.ndarray, "nu nu"], reduced: Estimator) -> System:
    """E with inputs and outputs in the square root of R: states (z, xi_r), or (z, u, xi_r) when sampled.

    Parameters
    ----------
    K : (nu, n) or (nu, n + nu)
        Gain of the regulator.
    """
    root = np.linalg.cholesky(R).T
    r, seen = reduced.order, reduced.seen @ plant.C
    if plant.sampled is None:
        A = np.block([[plant.A - plant.B @ K, np.zeros((len(K.T), r))], [seen - reduced.now @ K, reduced.Phi]])
        B, dt = np.vstack([plant.B, reduced.now]), None
        C = np.hstack([K, -reduced.C])
    else:
        F, G = plant.sampled.with_input_state()
        regulated, n = F - G @ K, len(plant.A)
        known = seen @ regulated[:n] + reduced.now @ regulated[n:]
        known[:, n:] += reduced.before
        A = np.block([[regulated, np.zeros((len(F), r))], [known, reduced.Phi]])
        B, dt = np.vstack([G, seen @ G[:n] + reduced.now @ G[n:]]), plant.sampled.dt
        C = np.hstack([K - np.pad(reduced.direct, ((0, 0), (n, 0))), -reduced.C])
    return System(A, np.linalg.solve(root.T, B.T).T, root @ C, np.zeros((len(K), len(K))), dt)


def small_gain(
    plant: Plant, K: Float[np.ndarray, "nu n"], R: Float[np.ndarray, "nu nu"], reduced: Estimator
) -> SmallGain:
    """Enclose g; infinite where the reduced estimator is not stable by itself."""
    sizes = np.linalg.eigvals(reduced.Phi)
    edge = np.real(sizes).max() if plant.sampled is None else np.abs(sizes).max() - 1
    if not edge < 0:
        return SmallGain(Peak(np.inf, np.inf, np.nan))
    return SmallGain(hinf(difference(plant, K, R, reduced), least=_LEAST))
