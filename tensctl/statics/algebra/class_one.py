"""Class 1: bars that touch no other bar, and two transformations in closed form ([W] Lemma 12, Corollaries 13, 14).

    C_b = I_e - I_o (39),   J = I_e + I_o (44)
    centres:  P' = [C_b, J] / 2,   P^-1 = [C_b, J],     q_d = b, q_e = 2 p_c      (42), (43), (45), (46)
    ends:     P' = [-I_o, J],      P^-1 = [C_b, I_e],   q_d = b, q_e = heads      (47)-(50)

[W] numbers the nodes of bar m 2m-1 (tail) and 2m (head), whence "odd" and "even"; here I_o selects tails and I_e heads
under any numbering. Both are n_p x n_b (the print has 3n_p x 3n_p, and n_b x n_p for J), rank C_b = n_b ((41) prints
n_p), and q_e of Corollary 13 is twice the centres of (46): P' of (42) allows nothing else.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int

from tensctl.errors import StructureError
from tensctl.statics.algebra.network import Network
from tensctl.statics.algebra.transformation import Transformation


def end_selectors(network: Network) -> tuple[Int[np.ndarray, "nodes bars"], Int[np.ndarray, "nodes bars"]]:
    """I_o and I_e of (40): which node is the tail, which the head of each bar, so that C_b = I_e - I_o (39).

    Raises
    ------
    StructureError
        When the network is not class 1 with every node at a bar's end.
    """
    ends = network.bars_at_node
    if (ends != 1).any():
        node = int((ends != 1).argmax())
        raise StructureError(
            f"node {node} ends {ends[node]} bars; Lemma 12 and Corollaries 13 and 14 are for class 1, where every node "
            "ends exactly one, so use theorem11 or forest_transformation."
        )
    I_o, I_e = np.zeros((2, network.n_p, network.n_b), int)
    I_o[network.bars[:, 0], np.arange(network.n_b)] = 1
    I_e[network.bars[:, 1], np.arange(network.n_b)] = 1
    return I_o, I_e


def corollary13(network: Network) -> Transformation:
    """Bar vectors and (twice) bar centres: P = [C_b, J]' / 2, V_B1 = I.

    Raises
    ------
    StructureError
        When the network is not class 1.
    """
    I_o, I_e = end_selectors(network)
    return Transformation(0.5 * np.hstack([I_e - I_o, I_e + I_o]).T, np.eye(network.n_b), "centres")


def corollary14(network: Network) -> Transformation:
    """Bar vectors and bar heads: P = [-I_o, J]', V_B1 = I; all integer.

    Raises
    ------
    StructureError
        When the network is not class 1.
    """
    I_o, I_e = end_selectors(network)
    return Transformation(np.hstack([-I_o, I_e + I_o]).T.astype(float), np.eye(network.n_b), "ends")
