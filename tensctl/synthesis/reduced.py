"""A controller of fewer states, by balancing what matters to the closed loop (Liu, Anderson and Ly, 1990).

    (y - D u, u) -> K z,   z' = (A - L C) z + L (y - D u) + B u,   u = -K z

The estimator is stable even where the plant rings for ever. Its error matters as the closed loop excites it: in the
loop without noise z follows the regulated plant, so the Gramian that weighs its states is that of (A - B K, B R^-1/2),
and the one that weighs what they do is that of (A - L C, R^1/2 K). No gain bound comes with weighted truncation: the
loop of the reduced controller is computed, and `synthesis.small_gain` tells what its difference proves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tensctl.errors import SynthesisError
from tensctl.synthesis.estimator import Estimator, Plant
from tensctl.synthesis.loop import close
from tensctl.synthesis.truncation import Truncated, balance, check_order, gramian_factor


def reduced(
    plant: Plant, full: Estimator, K: np.ndarray, R: np.ndarray, order: int
) -> tuple[Estimator, Truncated]:  # fmt: skip
    """The estimator with `order` states, its loop verified.

    Parameters
    ----------
    K : (nu, n) or (nu, n + nu)
        Gain of the regulator.
    R : (nu, nu)
        Weight of the inputs.

    Raises
    ------
    SynthesisError
        When the loop is not stable; the sentence names the smallest larger order whose loop is.
    """
    check_order(order, full.order)
    sampled, root = plant.sampled is not None, np.linalg.cholesky(R).T
    A, B = (plant.A, plant.B) if plant.sampled is None else plant.sampled.with_input_state()
    reach = gramian_factor(A - B @ K, np.linalg.solve(root.T, B.T).T, sampled=sampled)[: full.order]
    sight = gramian_factor(full.Phi.T, (root @ full.C).T, sampled=sampled)

    def of_order(r: int) -> tuple[Estimator, Truncated]:
        cut = replace(balance(full.Phi, full.drive, full.C, reach, sight, r), bound=None)
        seen, before, now = np.split(cut.B, np.cumsum([full.seen.shape[1], full.before.shape[1]]), axis=1)
        return Estimator(cut.A, seen, now, before, cut.C, full.direct), cut

    estimator, cut = of_order(order)
    if close(plant, estimator).stability < 0:
        return estimator, cut
    larger = range(order + 1, full.order)
    enough = next((r for r in larger if close(plant, of_order(r)[0]).stability < 0), full.order)
    raise SynthesisError(
        f"with {order} states the closed loop is not stable; with {enough} it is. Less force noise or dearer "
        "inputs ask less of the controller."
    )
