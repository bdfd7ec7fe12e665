"""Where [S] is wrong as printed: the printed form fails by the size of what it describes, the corrected one holds.

Others stand beside the matrices they concern: G and (E.5)'s f10 in the tests of coordinates and blocks, (2.3), (2.9)
and (2.1) with the rules of closure.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse
from shell_blocks_printed import PRINTED, read
from support import random_motion, shell_scene

import tensctl as tc
import tensctl.model.shell_equations as se

N, M = 4, 3


@pytest.fixture(scope="module")
def state():
    """A (4,3) shell in motion: equations, q, v, u, w, and all tendons taut."""
    scene = shell_scene(N, M)
    dynamics, e = tc.build_dynamics(scene), se.ShellEquations.of(scene)
    rng = np.random.default_rng(5)
    nodes, velocities = random_motion(dynamics.potential, rng, reach=0.1)
    u = e.inputs((0.8 + 0.1 * rng.random(len(dynamics.input_labels))) * dynamics.members.rest_lengths)
    q, v, w = se.q_of(nodes), se.q_of(velocities), rng.standard_normal(nodes.size)
    assert (e.y_f(q, u) > 0).all()
    return e, q, v, u, w


def largest(x):
    return np.abs(x).max()


def length_residual(e, q, v, acceleration, f):
    return largest(se.newton_euler_residual(q, v, acceleration, f, e.mass)["length"])


class TestRods:
    def test_theorem_3_1_without_dots(self, state):
        """K = L^-2 q2'q2 I is the unit matrix: a rod at rest without forces would accelerate by -q2."""
        e, q, v, *_ = state
        printed, still = se.K_r_matrix(q, q), np.zeros_like(q)
        assert largest(printed.diagonal().reshape(-1, 2, 3)[:, 1] - 1) < 1e-15
        assert length_residual(e, q, still, -(printed @ q), still) > 0.5
        assert length_residual(e, q, still, -(se.K_r_matrix(q, still) @ q), still) == 0
        assert length_residual(e, q, v, -(se.K_r_matrix(q, v) @ q), still) < 1e-14

    def test_element_equation_with_omega_q_dot(self, state):
        """Omega q' is no centripetal acceleration: it leaves |q2'|^2 as it is."""
        e, q, v, *_ = state
        omega, still = se.K_r_matrix(q, v), np.zeros_like(q)
        speed = largest((v.reshape(-1, 2, 3)[:, 1] ** 2).sum(axis=1))
        assert abs(length_residual(e, q, v, -(omega @ v), still) - speed) < 1e-12 * speed

    def test_skew_square(self, rng):
        """The printed square of r~ is that of the printed r~."""
        r = rng.standard_normal(3)
        assert largest(se.skew(r) @ se.skew(r) - se.skew_square(r[None])[0]) < 1e-15
        assert largest(se.skew(r) @ [1, 2, 3] - np.cross(r, [1, 2, 3])) < 1e-15

    def test_degrees_of_freedom(self):
        """2nm rods with five each, 10nm; not nm rods and 6nm."""
        assert tc.build_dynamics(shell_scene(N, M)).potential.manifold.size == 10 * N * M
        assert len(tc.shell(N, M).rods) == 2 * N * M


class TestVectors:
    def test_second_form_of_t8(self, state):
        _, q, *_ = state
        nodes = (se.P_matrix(N, M) @ q).reshape(-1, 3)
        _, r1, _, r2 = se.by_element(nodes, N, M)
        t = se.tendon_vectors(nodes, N, M)
        assert largest(-r1 - t[5] + r2 - t[8]) > 0.5
        assert largest(r2 - t[5] - t[8]) < 1e-14

    def test_q_beyond_n_is_q_1j(self, state):
        """(4.16) prints q_(n+1)j = q_ij."""
        _, q, *_ = state
        nodes = (se.P_matrix(N, M) @ q).reshape(-1, 3)
        blocks = q.reshape(M, N, 12)
        t = se.tendon_vectors(nodes, N, M)[:, 1, N - 1]
        wanted = np.concatenate([t[alpha] for alpha in (2, 3, 4, 6, 7, 8, 9, 10)])
        rest = se.E_block("E_1") @ blocks[0, -1] + se.E_block("E_2") @ blocks[1, -2] + se.E_block("E_3") @ blocks[1, -1]
        right = rest + se.E_block("E_4") @ blocks[1, 0] + se.E_block("E_5") @ blocks[2, 0]
        printed = rest + se.E_block("E_4") @ blocks[1, -1] + se.E_block("E_5") @ blocks[2, -1]
        assert largest(right - wanted) < 1e-14
        assert largest(printed - wanted) > 0.5


class TestNodalForces:
    def test_f10_at_the_first_element(self):
        """(E.5): without f10 of element (n, 1) the third law and the cyclic symmetry both fail."""
        printed = read(PRINTED["Bd_n1"])
        right = se.force_block("Bd_n1")
        assert (right == se.force_block("Bd_01")).all()
        missing = (right - printed).reshape(4, 3, 8, 3)[:, 0, :, 0]
        assert np.argwhere(missing).tolist() == [[2, 7], [3, 7]]
        B_3 = se.B_3(N).toarray()
        B_3[:12, -24:] += printed - right
        column = B_3[:, -3].reshape(-1, 2, 3)
        assert abs(column[:, 0].sum(axis=0)).max() == 1
        assert not se.B_3(N).toarray()[:, -3].reshape(-1, 2, 3)[:, 0].sum(axis=0).any()

    def test_b_1n1_of_appendix_c(self):
        """[I; 0; 0] has three rows of blocks for four and leaves the difference row without f_1n1."""
        assert se.force_block("B_1n1").shape == (12, 3)
        assert (se.force_block("B_1n1")[:6] == np.vstack([np.eye(3), np.eye(3)])).all()

    def test_sign_of_w2_in_the_difference_row(self):
        """(E.1), 1 < i < n, prints f1 - f2 + w1 + w2: a push on P2 alone would then push P1, and P2 not at all."""
        printed = se.force_block("W").copy()
        printed[3:6, 3:6] *= -1
        push = np.r_[np.zeros(3), 1.0, 0, 0, np.zeros(6)]
        for W, on_nodes in ((printed, [1, 0]), (se.force_block("W"), [0, 1])):
            total, difference = (W @ push)[[0, 3]]
            assert [(total + difference) / 2, (total - difference) / 2] == on_nodes

    def test_w_of_element_1_in_the_last_ring(self, state):
        """(E.4) prints w_1nm and w_2nm for i = 1: what pushes element n would push element 1."""
        *_, w = state
        right = (se.W_0(N, M) @ w).reshape(M, N, 12)
        moved = w.reshape(M, N, 12).copy()
        moved[-1, 0, :6] = moved[-1, -1, :6]
        printed = (se.W_0(N, M) @ moved.ravel()).reshape(M, N, 12)
        f = se.sums_and_differences(se.nodal_forces(np.zeros((11, M, N, 3)), w.reshape(M, N, 4, 3)))
        assert largest(right.ravel() - f) == 0
        assert largest(printed - right) > 0.5
        assert largest(right[..., [0, 6]].sum() - w.reshape(-1, 3)[:, 0].sum()) < 1e-13


class TestTendonForces:
    def test_last_row_of_K_tilde(self, state):
        """(5.15) prints B_6 K_m^d for B_8 K_m^d: the top ring would take f10 twice and not take f6, f7."""
        e, q, _, u, _ = state
        right = e.K_tilde(q, u)
        last = e.forces_d(q, u).K[-24 * N :]
        printed = right.toarray()
        printed[-12 * N :] += (se.B_6(N) - se.B_8(N)) @ last
        assert largest((printed - right) @ q) > 0.1 * largest(right @ q)
        assert largest(nodal_sum(right @ q)) < 1e-12 * largest(right @ q)
        assert largest(nodal_sum(printed @ q)) > 0.1 * largest(right @ q)

    def test_third_row_of_B0_P0(self, state):
        """(5.15) prints B_7 P_2^0 where B_7 P_3^0 stands."""
        e, q, _, u, _ = state
        P = e.forces_0(q, u).P
        right = (e.B0 @ P)[24 * N : 36 * N, 4 * N : 6 * N]
        rings = [P[6 * N * j : 6 * N * (j + 1), 2 * N * j : 2 * N * (j + 1)] for j in range(M)]
        assert largest(right - se.B_7(N) @ rings[2]) == 0
        assert largest(right - se.B_7(N) @ rings[1]) > 1

    def test_P_d_is_block_diagonal(self, state):
        """(5.11) stacks P_1^d to P_m^d in one column, which has 8n + 1 and 8n columns in turn and takes no u^d."""
        e, q, _, u, _ = state
        P = e.forces_d(q, u).P
        ends = np.cumsum([0, 8 * N + 1, *[8 * N] * (M - 1)])
        rings = [P[3 * a : 3 * b, a:b] for a, b in pairwise(ends)]
        assert (sparse.csr_array(sparse.block_diag(rings)) != P).nnz == 0
        assert len({ring.shape for ring in rings}) == 2


class TestInputs:
    def test_minus_signs_of_T_turn_a_pull_into_a_push_back(self, state):
        """(5.18): u9 = -u1 would let the copy of a tendon out while the tendon is wound in; no force reads it."""
        e, q, _, u, _ = state
        printed = sparse.lil_array(e.T)
        members = se.all_members(N, M)
        copies = [row for row, t in enumerate(members) if (t.alpha, t.j) in ((9, 1), (10, M))]
        printed[copies] *= -1
        printed = sparse.csr_array(printed)
        B = e.B_tilde(q, u)
        assert largest(B @ printed - B @ e.T) == 0
        assert not B[:, copies].nnz
        rest = e.rest_lengths - e.T @ u
        originals = [members.index(t._replace(alpha={9: 1, 10: 7}[t.alpha])) for t in (members[row] for row in copies)]
        assert largest(rest[copies] - rest[originals]) == 0
        wrong = e.rest_lengths - printed @ u
        assert largest(wrong[copies] - wrong[originals]) > 0.5

    def test_rows_of_T(self):
        """(5.17) prints 10m + 1 rows."""
        assert se.T_matrix(N, M).shape[0] == 10 * N * M + 1


def nodal_sum(f):
    """Sum of forces on all nodes from the vector f of (2.15)."""
    return f.reshape(-1, 2, 3)[:, 0].sum(axis=0)
