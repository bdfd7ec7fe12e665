"""Ranks of the incidence matrices, exactly and without arithmetic ([W] Lemma 7).

    rank C = n_p - (connected pieces of the graph),   loops = members - rank C

Lemma 7 prints rank B <= n_b <= n_p - 1. The second half is false once bars close loops (Example 10b has n_b = n_p = 6,
10c has 7 and 6); what holds is rank B = n_p - pieces of the bar graph = n_b - independent loops of bars.
"""

from __future__ import annotations

from dataclasses import dataclass

from tensctl.statics.algebra.network import Network, component_labels


@dataclass(frozen=True)
class Ranks:
    """Everything about rank that the graph alone decides.

    Attributes
    ----------
    n_p, n_b, n_s : int
    pieces, bar_pieces, string_pieces : int
        Connected pieces formed by all members, by the bars, by the strings; a node without member is one.
    """

    n_p: int
    n_b: int
    n_s: int
    pieces: int
    bar_pieces: int
    string_pieces: int

    @property
    def rho_B(self) -> int:
        """Rank of C_b (Lemma 7)."""
        return self.n_p - self.bar_pieces

    @property
    def rho_S(self) -> int:
        """Rank of C_s."""
        return self.n_p - self.string_pieces

    @property
    def rho_A(self) -> int:
        """Rank of [C_s, C_b], the matrix of (22) without loads."""
        return self.n_p - self.pieces

    @property
    def rho_2(self) -> int:
        """Rank of S2 = P2 C_s (63).

        P [C_b, C_s] = [[V_B1', S1], [0, S2]] and V_B1' has full row rank, so rank S2 = rank [C_b, C_s] - rank C_b:
        the pieces that strings join. Holds for every transformation P of Theorem 11.
        """
        return self.bar_pieces - self.pieces

    @property
    def bar_loops(self) -> int:
        """Independent loops of only bars, r of Lemma 7."""
        return self.n_b - self.rho_B

    @property
    def loops(self) -> int:
        """Independent loops of any members: equations in (12)."""
        return self.n_b + self.n_s - self.rho_A

    @property
    def free_tensions(self) -> int:
        """Columns of V2: independent string forces that need no balance from outside the bars (Lemma 18)."""
        return self.n_s - self.rho_2

    @property
    def free_positions(self) -> int:
        """Columns of U2, rows of z_e: one translation for each piece (Lemma 17)."""
        return self.n_p - self.rho_B - self.rho_2


def ranks(network: Network) -> Ranks:
    """Ranks of a network, several pieces and loops of bars included."""
    return Ranks(
        n_p=network.n_p,
        n_b=network.n_b,
        n_s=network.n_s,
        pieces=component_labels(network.n_p, network.members)[0],
        bar_pieces=component_labels(network.n_p, network.bars)[0],
        string_pieces=component_labels(network.n_p, network.strings)[0],
    )
