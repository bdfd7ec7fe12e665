"""Coordinates of [S]: q, l, l^d and the matrices between them, and inputs without copies."""

import numpy as np
import pytest
from scipy import sparse

import tensctl as tc
import tensctl.model.shell_equations as se
from tensctl.errors import StructureError

SIZES = [(3, 1), (5, 1), (3, 2), (4, 3), (6, 4)]


@pytest.fixture(params=SIZES, ids=str)
def size(request):
    return request.param


@pytest.fixture
def nodes(size, rng):
    n, m = size
    return rng.standard_normal((4 * n * m, 3))


class TestIndependentVectors:
    def test_p_is_P_q(self, size, nodes):
        q = se.q_of(nodes)
        assert np.abs(se.P_matrix(*size) @ q - nodes.ravel()).max() < 1e-15

    def test_q_of_rods(self, size, nodes):
        """(4.4): q1 = 2 rho + r1, q2 = r1, q3 = 2 rhohat + r2, q4 = r2."""
        rho, r1, rhohat, r2 = se.by_element(nodes, *size)
        wanted = np.stack([2 * rho + r1, r1, 2 * rhohat + r2, r2], axis=2).ravel()
        assert np.abs(se.q_of(nodes) - wanted).max() < 1e-14

    def test_points_from_q(self, nodes):
        """(4.13)."""
        from tensctl.model.shell_equations.coordinates import POINTS_FROM_Q

        q = se.q_of(nodes).reshape(-1, 4, 3)
        wanted = np.stack([nodes[::4], nodes[1::4] - nodes[::4], nodes[2::4], nodes[3::4] - nodes[2::4]], axis=1)
        assert np.abs(np.einsum("ab,ebx->eax", POINTS_FROM_Q, q) - wanted).max() < 1e-14

    def test_points_by_sums_of_vectors(self, size, nodes):
        """(4.1), (4.2)."""
        rho, r1, rhohat, r2 = se.by_element(nodes, *size)
        t = se.tendon_vectors(nodes, *size)
        sums = se.base_points(rho[0, 0], r1, t[1], t[5])
        assert np.abs(sums - rho).max() < 1e-13
        assert np.abs(sums + r1 + t[5] - r2 - rhohat).max() < 1e-13

    def test_q_is_Q_l(self, size, nodes):
        assert np.abs(se.Q_matrix(*size) @ se.independent_vectors(nodes, *size) - se.q_of(nodes)).max() < 1e-13

    def test_printed_G_fails_by_the_size_of_a_tendon(self, nodes, size, rng):
        """G's third row [2 2 0 2] in place of [-2 2 0 2] puts 4 t1_(i-1)1 into q3 of every higher ring."""
        n, m = size
        Q, vectors = se.Q_matrix(n, m), se.independent_vectors(nodes, n, m)
        error = np.kron(np.array([[0, 0, 0, 0], [0, 0, 0, 0], [4, 0, 0, 0], [0, 0, 0, 0]]), np.eye(3))
        places = np.diag(np.r_[0, np.ones(n - 1)])
        wrong = sparse.lil_array(Q)
        for j in range(1, m):
            wrong[12 * n * j : 12 * n * (j + 1), : 12 * n] += sparse.csr_array(np.kron(places, error))
        misfit = np.abs(wrong @ vectors - se.q_of(nodes)).max()
        assert misfit > 1 if m > 1 else misfit < 1e-14


class TestInverse:
    def test_exact(self, size):
        Q, inverse = se.Q_matrix(*size), se.Q_inverse(*size)
        unit = sparse.eye_array(Q.shape[0])
        assert np.abs(Q @ inverse - unit).max() == 0
        assert np.abs(inverse @ Q - unit).max() == 0

    @pytest.mark.parametrize(("n", "m"), [*SIZES, (20, 10), (50, 40)])
    def test_nonzeros_grow_with_the_number_of_elements(self, n, m):
        assert se.Q_inverse(n, m).nnz == 30 * n * m - 6

    def test_large_shell(self, rng):
        """The inverse at 24 000 coordinates, with an 18th of Q's own nonzeros."""
        n, m = 50, 40
        nodes = rng.standard_normal((4 * n * m, 3))
        vectors = se.Q_inverse(n, m) @ se.q_of(nodes)
        assert 18 * se.Q_inverse(n, m).nnz < se.Q_matrix(n, m).nnz
        assert np.abs(vectors - se.independent_vectors(nodes, n, m)).max() < 1e-14

    def test_blocks_by_elimination(self):
        """(B.6), (B.7): the closed forms against the recursion that [S] eliminates, five rings."""
        n, m = 3, 5
        Q11, Q21, Q22, Q32 = (block(n).toarray() for block in (se.Q_11, se.Q_21, se.Q_22, se.Q_32))
        up = np.linalg.inv(Q22)
        rows = [[np.linalg.inv(Q11)]]
        for j in range(1, m):
            below = [Q21 @ rows[0][0] if k == 0 else np.zeros_like(Q11) for k in range(j)]
            for earlier in range(1, j):
                for k in range(earlier + 1):
                    below[k] = below[k] + Q32 @ rows[earlier][k]
            rows.append([*(-up @ block for block in below), up])
        for j in range(m):
            for k in range(j + 1):
                assert np.abs(rows[j][k] - se.Lambda(j + 1, k + 1, n)).max() < 1e-13


class TestDependentVectors:
    def test_l_d_is_R_q(self, size, nodes):
        n, m = size
        t = se.tendon_vectors(nodes, n, m)
        wanted = np.concatenate([t[s.alpha, s.j - 1, s.i - 1] for s in se.dependent_members(n, m)])
        assert np.abs(se.R_matrix(n, m) @ se.q_of(nodes) - wanted).max() < 1e-14

    def test_l_d_is_R_Q_l(self, size, nodes):
        """(4.18)."""
        vectors = se.independent_vectors(nodes, *size)
        wanted = se.R_matrix(*size) @ se.q_of(nodes)
        assert np.abs(se.R_matrix(*size) @ (se.Q_matrix(*size) @ vectors) - wanted).max() < 1e-13

    def test_rows_of_t5_and_t1(self, size, nodes):
        n, m = size
        t = se.tendon_vectors(nodes, n, m)
        wanted = np.concatenate([t[s.alpha, s.j - 1, s.i - 1] for s in se.independent_members(n, m)])
        assert np.abs(se.independent_rows(n, m) @ se.q_of(nodes) - wanted).max() < 1e-14

    @pytest.mark.parametrize(
        ("name", "printed"),
        {
            "E_1": "..-- / .... / .... / .... / .... / .... / .... / ....",
            "E_2": ".... / ..+- / ..-+ / .... / .... / .... / .... / ....",
            "E_3": "+-.. / -+.. / ++.. / ..-- / ..+- / ++-+ / --.. / ..-+",
            "E_4": ".... / .... / .... / .... / .... / .... / +-.. / ..++",
            "E_5": ".... / .... / .... / +-.. / -+.. / .... / .... / ....",
            "E_4_tilde": "-+.. / .... / .... / ..++ / ..-- / .... / +-.. / ..++",
            "E_6": "-+..",
            "E_7": "++..",
        }.items(),
    )
    def test_equal_to_print(self, name, printed):
        """(4.14)-(4.17), (C.6)."""
        signs = [["-.+".index(mark) - 1 for mark in row.strip()] for row in printed.split("/")]
        assert (2 * se.E_block(name) == np.kron(signs, np.eye(3))).all()

    def test_boundary_versions_are_halves_of_the_one_stage_version(self):
        """[S] calls them obvious: E4hat changes t2, E4bar changes t6 and t7, E4tilde all three."""
        common, hat, bar, tilde = (se.E_block(f"E_4{kind}") for kind in ("", "_hat", "_bar", "_tilde"))
        assert np.flatnonzero((hat != common).any(axis=1)).max() < 3
        assert set(np.flatnonzero((bar != common).any(axis=1)) // 3) == {3, 4}
        assert (hat + bar - common == tilde).all()


class TestInputs:
    @pytest.mark.parametrize("primal", [False, True])
    def test_sizes(self, size, primal):
        n, m = size
        T = se.T_matrix(n, m, primal=primal)
        assert T.shape == (10 * n * m + 1, 8 * n * m if primal else n * (10 * m - 2))
        assert T.shape == se.dimensions(n, m, primal=primal)["T"]
        assert T.shape[1] == len(tc.shell(n, m, primal=primal).tendons)
        assert np.linalg.matrix_rank(T.toarray()) == T.shape[1]

    def test_blocks(self, size):
        """(5.17) block by block; Appendix C at m = 1."""
        n, m = size
        blocks = [se.T_1_prime()] if m == 1 else [se.T_1(), *[np.eye(8)] * (m - 2), se.T_2()]
        upper = sparse.block_diag([block for block in blocks for _ in range(n)])
        side = sparse.lil_array((8 * n * m, 2 * n * m))
        side[: 8 * n, : 2 * n] = sparse.block_diag([se.S_block()] * n)
        first = sparse.lil_array((1, n * (10 * m - 2)))
        first[0, upper.shape[1] + 2 * n - 1] = 1
        lower = sparse.hstack([sparse.csr_array((2 * n * m, upper.shape[1])), sparse.eye_array(2 * n * m)])
        T = sparse.vstack([first, sparse.hstack([upper, side]), lower])
        assert np.abs(T.toarray() - se.T_matrix(n, m).toarray()).max() == 0

    def test_copies_are_equal_inputs(self, size, rng):
        n, m = size
        members, order = se.all_members(n, m), se.input_members(n, m)
        u = dict(zip(order, rng.standard_normal(len(order)), strict=True))
        for member, value in zip(members, se.T_matrix(n, m) @ np.array(list(u.values())), strict=True):
            if (member.alpha, member.j) == (9, 1):
                assert value == u[member._replace(alpha=1)]
            elif (member.alpha, member.j) == (10, m):
                assert value == u[member._replace(alpha=7)]
            else:
                assert value == u[member]

    def test_a_primal_shell_has_the_columns_of_the_full_one_that_stay(self, size):
        n, m = size
        full, kept = se.input_members(n, m), se.input_members(n, m, primal=True)
        columns = [full.index(member) for member in kept]
        assert (se.T_matrix(n, m)[:, columns] != se.T_matrix(n, m, primal=True)).nnz == 0


def test_dimensions_of_the_matrices(size):
    n, m = size
    shapes = se.dimensions(n, m)
    for name, matrix in {
        "Q": se.Q_matrix(n, m),
        "R": se.R_matrix(n, m),
        "B^d": se.B_d(n, m),
        "B^0": se.B_0(n, m),
        "W^0": se.W_0(n, m),
        "P": se.P_matrix(n, m),
        "K^0": se.independent_rows(n, m),
    }.items():
        assert matrix.shape == shapes[name], name


def test_shortening_beyond_the_rest_length_is_refused():
    with pytest.raises(StructureError, match=r"u <= L0 \(5.4\)"):
        se.tendon_forces(sparse.csr_array(np.eye(3)), np.ones(3), np.array([0.6]), np.ones(1), np.array([0.5]))
