"""Blocks of [S] Appendices C and E as they are printed, one row of signs a row of I_3 blocks.

Columns f2 f3 f4 f6 f7 f8 f9 f10 (d), f5 f1 (0), f_1n1, or w1 w2 w3 w4.
"""

import numpy as np

PRINTED = {
    # (E.5), (E.10)
    "Bd_n1": "+....... / +....... / ........ / ........",
    "Bd_11": "-+-..-.. / -++..+.. / ...+-+.+ / ...--+.+",
    "Bd_12": "........ / ........ / +....... / -.......",
    "Bd_21": "........ / ........ / .-+..... / .-+.....",
    "B0_11": "+- / -+ / -. / +.",
    "B0_12": ".. / .. / .+ / .-",
    "B_1n1": "+ / + / . / .",
    "W": "++.. / +-.. / ..++ / ..+-",
    "Bd_n1_bar": "...-+... / ...-+... / ........ / ........",
    "Bd_n2": "......-. / ......-. / .......- / .......+",
    "Bd_12_bar": "-+-..-+. / -++..+-. / ...+-+.+ / ...--+.+",
    # (C.2)-(C.4)
    "Bd_n1_hat": "+....... / +....... / ...-+... / ...+-...",
    "Bd_01_hat": "+....... / +....... / ...-+... / ...+-...",
    "Bd_11_hat": "-+-..-.. / -++..+.. / ...+-+.. / ...--+..",
    "B0_01": ".+ / .+ / .. / ..",
    "B0_n1": "+. / -. / -. / +.",
    "B_1n1_bar": "- / + / . / .",
    # (E.1) for i > 1, as forces: the block itself is on a lost page
    "Bd_01": "+....... / +....... / .......- / .......+",
}
CORRECTED = {"Bd_n1": PRINTED["Bd_01"]}
"""(E.5) leaves f10 of element (n, 1) out of node 4 of element (1, 1)."""


def read(table):
    """The 12-row matrix of a table of signs."""
    signs = [["-.+".index(mark) - 1 for mark in row.strip()] for row in table.split("/")]
    return np.kron(signs, np.eye(3))
