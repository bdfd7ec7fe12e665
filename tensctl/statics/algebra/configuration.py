"""A structure in equilibrium, judged by nothing but its own data ([W] Definition 16, Lemma 6).

    t = Gamma s, f = Lambda b (13);   C_s t = C_b f + C_w w (23);   s = C_s' p, b = C_b' p (19)

with gamma > 0, lambda > 0. Equivalently Omega p = C_w w with Omega = C_s Gamma C_s' - C_b Lambda C_b'.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from tensctl.errors import EquilibriumError, StructureError
from tensctl.statics.algebra.incidence_matrices import load_incidence
from tensctl.statics.algebra.loops import loop_gaps
from tensctl.statics.algebra.network import Network

# A bar shorter than this part of the structure has no direction that could be trusted.
_ZERO_LENGTH = 1e-12


@dataclass(frozen=True, eq=False)
class Configuration:
    """Nodes, members and forces together; `verify` holds them against Definition 16.

    Attributes
    ----------
    network : Network
    gamma, lam : (n_s,), (n_b,) N/m
    p, s, b : (n_p, d), (n_s, d), (n_b, d) m
    t, f : (n_s, d), (n_b, d) N
        String forces, along the string from tail to head; bar forces, > 0 coefficient in compression.
    w, load_nodes : (n_w, d) N, (n_w,) int
        Forces applied to nodes.
    """

    network: Network
    gamma: Float[np.ndarray, " strings"]
    lam: Float[np.ndarray, " bars"]
    p: Float[np.ndarray, "nodes d"]
    s: Float[np.ndarray, "strings d"]
    b: Float[np.ndarray, "bars d"]
    t: Float[np.ndarray, "strings d"]
    f: Float[np.ndarray, "bars d"]
    w: Float[np.ndarray, "loads d"]
    load_nodes: Int[np.ndarray, " loads"]

    @classmethod
    def at(
        cls,
        network: Network,
        p: Float[np.ndarray, "nodes d"],
        gamma: Float[np.ndarray, " strings"],
        lam: Float[np.ndarray, " bars"],
        w: Float[np.ndarray, "loads d"] | None = None,
        load_nodes: Int[np.ndarray, " loads"] | None = None,
    ) -> Configuration:
        """Members and forces that follow from nodes and coefficients; whether they balance is for `verify` to say."""
        p = np.asarray(p, float)
        w = np.zeros((0, p.shape[1])) if w is None else np.asarray(w, float)
        nodes = np.arange(len(w)) if load_nodes is None else np.asarray(load_nodes, int)
        s, b = network.C_s.T @ p, network.C_b.T @ p
        gamma, lam = np.asarray(gamma, float), np.asarray(lam, float)
        return cls(network, gamma, lam, p, s, b, gamma[:, None] * s, lam[:, None] * b, w, nodes)

    @property
    def node_forces(self) -> Float[np.ndarray, "nodes d"]:
        """Sum of all forces on each node, N: C_b f + C_w w - C_s t, zero in equilibrium (Lemma 6)."""
        C_w = load_incidence(self.network.n_p, self.load_nodes)
        return self.network.C_b @ self.f + C_w @ self.w - self.network.C_s @ self.t

    @property
    def element_residual(self) -> float:
        """Misfit of (13) over the largest force."""
        off = np.vstack([self.t - self.gamma[:, None] * self.s, self.f - self.lam[:, None] * self.b])
        return _relative(off, self._largest_force)

    @property
    def force_residual(self) -> float:
        """Misfit of (23) over the largest force."""
        return _relative(self.node_forces, self._largest_force)

    @property
    def geometry_residual(self) -> float:
        """Misfit of (19) over the largest member."""
        off = np.vstack([self.s - self.network.C_s.T @ self.p, self.b - self.network.C_b.T @ self.p])
        return _relative(off, self._largest_member)

    @property
    def loop_residual(self) -> float:
        """Misfit of (12), what the members leave open around a loop, over the largest member."""
        return _relative(loop_gaps(self.network, self.s, self.b), self._largest_member)

    @property
    def residual(self) -> float:
        """Largest of the residuals of Definition 16."""
        return max(self.element_residual, self.force_residual, self.geometry_residual)

    def verify(self, tol: float = 1e-9, *, bars_may_pull: bool = False) -> None:
        """Check Definition 16.

        Parameters
        ----------
        tol : float
            Largest residual accepted.
        bars_may_pull : bool
            Accept lambda <= 0: a real bar carries tension too, and under load some may have to.

        Raises
        ------
        EquilibriumError
            Coefficients of the wrong sign, or the first law that does not hold, with its residual.
        StructureError
            A bar of zero length.
        """
        check_bar_lengths(self.network, self.p)
        for name, values, members in (("gamma", self.gamma, "string"), ("lambda", self.lam, "bar")):
            if (name == "gamma" or not bars_may_pull) and not (values > 0).all():
                k = int((~(values > 0)).argmax())
                raise EquilibriumError(
                    f"{name} of {members} {k} is {values[k]:g} N/m; Definition 16 wants every {name} > 0, so choose "
                    "other coefficients or leave that member out."
                )
        laws = (
            ("elements obey t = gamma s, f = lambda b (13)", self.element_residual),
            ("members join the nodes (19)", self.geometry_residual),
            ("forces balance at every node (23)", self.force_residual),
        )
        for law, residual in laws:
            if not residual <= tol:
                raise EquilibriumError(f"{law}: false by {residual:.1e} of the largest, at most {tol:.0e} is expected.")

    @property
    def _largest_force(self) -> float:
        return max(np.abs(x).max(initial=0.0) for x in (self.t, self.f, self.w))

    @property
    def _largest_member(self) -> float:
        return max(np.abs(x).max(initial=0.0) for x in (self.s, self.b))


def force_density_matrix(network: Network, gamma: np.ndarray, lam: np.ndarray) -> sparse.csr_array:
    """Omega = C_s Gamma C_s' - C_b Lambda C_b' (n_p, n_p), N/m: (13), (19) and (23) in one, Omega p = C_w w."""
    strings = network.C_s @ sparse.diags_array(gamma) @ network.C_s.T
    return sparse.csr_array(strings - network.C_b @ sparse.diags_array(lam) @ network.C_b.T)


def check_bar_lengths(network: Network, p: Float[np.ndarray, "nodes d"]) -> None:
    """Check that every bar joins two different places.

    Raises
    ------
    StructureError
        With the first bar that does not, and its length.
    """
    length = np.linalg.norm(p[network.bars[:, 1]] - p[network.bars[:, 0]], axis=1)
    short = ~(length > _ZERO_LENGTH * np.ptp(p, axis=0).max(initial=0.0))
    if short.any():
        m = int(short.argmax())
        tail, head = network.bars[m]
        raise StructureError(
            f"bar {m} from node {tail} to node {head} has length {length[m]:g} m; a bar needs two different places, so "
            "choose other nodes, or other free vectors z_d."
        )


def _relative(off: np.ndarray, size: float) -> float:
    return float(np.abs(off).max(initial=0.0) / size) if size > 0 else float(np.abs(off).max(initial=0.0))
