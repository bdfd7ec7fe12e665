"""The constant matrices of [S]: derived from the topology, equal to what is printed once that is corrected."""

import numpy as np
import pytest
from shell_blocks_printed import CORRECTED, PRINTED, read

import tensctl as tc
import tensctl.model.shell_equations as se
from tensctl.errors import StructureError

SIZES = [(3, 1), (4, 1), (3, 2), (4, 2), (5, 3), (8, 4)]
_LAYOUT = {"d": se.dependent_members, "0": se.independent_members}


@pytest.fixture(params=SIZES, ids=str)
def size(request):
    return request.param


def random_forces(n, m, rng):
    """Random forces of all tendons, copies as [S] has them: f9 = -f1 at the base, f10 = -f7 at the top."""
    f = rng.standard_normal((11, m, n, 3))
    f[9, 0], f[10, -1] = -f[1, 0], -f[7, -1]
    return f


def stacked(f, members):
    return np.concatenate([f[t.alpha, t.j - 1, t.i - 1] for t in members])


def by_matrices(f, w, n, m):
    fd, f0 = (stacked(f, members(n, m)) for members in _LAYOUT.values())
    return se.B_d(n, m) @ fd + se.B_0(n, m) @ f0 + se.W_0(n, m) @ w.ravel()


def nodal(sums):
    """Forces on nodes back from sums and differences."""
    s = sums.reshape(-1, 2, 3)
    return np.stack([s[:, 0] + s[:, 1], s[:, 0] - s[:, 1]], axis=1).reshape(-1, 3) / 2


class TestElementBlocks:
    @pytest.mark.parametrize("name", sorted(PRINTED))
    def test_equal_to_print_where_print_is_right(self, name):
        printed = read(PRINTED[name])
        if name in CORRECTED:
            assert np.abs(se.force_block(name) - printed).max() == 1
            printed = read(CORRECTED[name])
        assert (se.force_block(name) == printed).all()

    def test_lost_pages_leave_two_blocks_to_rebuild(self):
        """(E.11)-(E.15) hold the only printed Bd_nm and Bd_1m; (E.4) gives their columns."""
        assert set(se.BLOCK_NAMES) - set(PRINTED) == {"Bd_nm", "Bd_1m"}
        assert (se.force_block("Bd_1m")[:, :21] == se.force_block("Bd_12_bar")[:, :21]).all()
        assert not se.force_block("Bd_1m")[:, 21:].any()
        top = se.force_block("Bd_nm").reshape(4, 3, 8, 3)[:, 0, :, 0]
        assert top.tolist() == [
            [0, 0, 0, 0, 0, 0, -1, 0],
            [0, 0, 0, 0, 0, 0, -1, 0],
            [0, 0, 0, -1, 1, 0, 0, 0],
            [0, 0, 0, 1, -1, 0, 0, 0],
        ]

    def test_an_unknown_name_is_refused(self):
        with pytest.raises(StructureError, match="B9 is no block"):
            se.force_block("B9")


class TestNodalForces:
    """(2.15) against the typical element of (E.3), the structure's own connection, and the laws of mechanics."""

    def test_equal_to_the_typical_element_with_its_rules_of_closure(self, size, rng):
        n, m = size
        f, w = random_forces(n, m, rng), rng.standard_normal((m, n, 4, 3))
        by_index = se.sums_and_differences(se.nodal_forces(f, w))
        assert np.abs(by_matrices(f, w, n, m) - by_index).max() < 1e-14

    def test_equal_to_the_shell_tendon_by_tendon(self, size, rng):
        n, m = size
        f, structure = random_forces(n, m, rng), tc.shell(n, m)
        forces = np.zeros_like(structure.nodes)
        for label, (tail, head) in zip(structure.tendon_labels, structure.tendons, strict=True):
            alpha, i, j = (int(part) for part in label[1:].split("_"))
            forces[tail] += f[alpha, j - 1, i - 1]
            forces[head] -= f[alpha, j - 1, i - 1]
        assert np.abs(nodal(by_matrices(f, np.zeros((m, n, 4, 3)), n, m)) - forces).max() < 1e-14

    def test_newtons_third_law_of_every_tendon(self, size):
        """Each column of B^d and B^0 adds up to nothing over all nodes: what pulls one node pulls another back."""
        n, m = size
        for matrix in (se.B_d(n, m), se.B_0(n, m)):
            on_nodes = nodal_columns(matrix)
            assert not on_nodes.sum(axis=0).any()
            assert np.isin(np.abs(on_nodes).sum(axis=0), (0, 2)).all()

    def test_copies_act_once(self, size):
        n, m = size
        acts = dict.fromkeys(se.all_members(n, m), 0)
        for matrix, members in ((se.B_d(n, m), se.dependent_members), (se.B_0(n, m), se.independent_members)):
            for column, member in enumerate(members(n, m)):
                acts[member] += int(matrix[:, [3 * column]].nnz > 0)
        wanted = {t: int((t.alpha, t.j) not in ((9, 1), (10, m))) for t in acts}
        assert acts == wanted

    def test_cyclic_symmetry(self, size, rng):
        """Forces moved around by one element move the nodal forces around."""
        n, m = size
        f, w = random_forces(n, m, rng), rng.standard_normal((m, n, 4, 3))
        here = by_matrices(f, w, n, m).reshape(m, n, 12)
        around = by_matrices(np.roll(f, 1, axis=2), np.roll(w, 1, axis=1), n, m).reshape(m, n, 12)
        assert np.abs(np.roll(here, 1, axis=1) - around).max() < 1e-14

    def test_virtual_work(self, size):
        """A tendon acts on q as its vector depends on q: block = -2 S E', S = BlockDiag[I, -I, I, -I]."""
        n, m = size
        signs = np.tile(np.repeat([1.0, -1.0, 1.0, -1.0], 3), n * m)
        for members, matrix, rows in (
            (se.dependent_members(n, m), se.B_d(n, m), se.R_matrix(n, m)),
            (se.independent_members(n, m), se.B_0(n, m), se.independent_rows(n, m)),
        ):
            acts = np.repeat(np.abs(matrix).sum(axis=0).reshape(-1, 3).all(axis=1), 3)
            assert acts.sum() >= 3 * (len(members) - 2 * n - 1)
            difference = matrix.toarray() + 2 * signs[:, None] * rows.toarray().T
            assert not difference[:, acts].any()


def nodal_columns(matrix):
    """(nodes, tendons): what each tendon's force along x does to each node."""
    dense = matrix.toarray().reshape(-1, 2, 3, matrix.shape[1])
    sums, differences = dense[:, 0, 0, ::3], dense[:, 1, 0, ::3]
    return np.concatenate([sums + differences, sums - differences]) / 2


class TestOneStage:
    """Appendix C is Appendix E at m = 1."""

    @pytest.mark.parametrize("n", [3, 4, 5, 6])
    def test_appendix_c(self, n, rng):
        f, w = random_forces(n, 1, rng), rng.standard_normal((1, n, 4, 3))
        assert np.abs(by_matrices(f, w, n, 1) - se.sums_and_differences(appendix_c(f, w))).max() < 1e-14

    @pytest.mark.parametrize("n", [3, 6])
    def test_ring_matrices(self, n):
        assert (se.B_d(n, 1) != se.B_3(n, single=True)).nnz == 0
        assert (se.B_0(n, 1) != se.B_1(n)).nnz == 0
        assert (se.B_3(n, single=True) != se.B_3(n)).nnz > 0
        assert (se.R_matrix(n, 1)[3:] != se.R_11(n, True, True)).nnz == 0


def appendix_c(f, w):
    """(C.1) typed as printed, for 1 < i < n with i cyclic."""
    g = f[:, 0]
    left, right = np.roll(g, 1, axis=1), np.roll(g, -1, axis=1)
    p1 = left[1] + left[2] - g[2] + g[3]
    p2 = -g[1] - g[4] + g[5] - g[8]
    p3 = g[8] - g[7] - right[3] + right[4]
    p4 = -g[5] + g[6] - left[6] + left[7]
    return np.stack([p1, p2, p3, p4], axis=1)[None] + w


class TestRings:
    """B^d and B^0 have the pattern that (E.17)-(E.20) print."""

    def test_pattern(self):
        n, m = 4, 4
        B_d = [
            [se.B_3(n), se.B_4(n), None, None],
            [se.B_5(n), se.B_6(n), se.B_4(n), None],
            [None, se.B_5bar(n), se.B_6(n), se.B_4(n)],
            [None, None, se.B_5bar(n), se.B_8(n)],
        ]
        ends = np.cumsum([0, 24 * n + 3, 24 * n, 24 * n, 24 * n])
        for a, row in enumerate(B_d):
            for b, block in enumerate(row):
                part = se.B_d(n, m)[12 * n * a : 12 * n * (a + 1), ends[b] : ends[b + 1]]
                assert part.nnz == 0 if block is None else (part != block).nnz == 0

    def test_first_ring_holds_t_1n1_first(self):
        n = 5
        B_3, B_1 = se.B_3(n).toarray(), se.B_1(n).toarray()
        assert (B_3[:12, :3] == se.force_block("B_1n1")).all()
        assert (B_3[-12:, :3] == se.force_block("B_1n1_bar")).all()
        assert not B_3[12:-12, :3].any()
        assert (B_1[-12:, -6:] == se.force_block("B0_n1")).all()
        assert (B_1[:12, :6] == se.force_block("B0_11")).all()
        assert not B_1[:12, -6:].any()

    def test_second_ring(self):
        n = 4
        assert (se.B_7(n).toarray()[12:24, 6:12] == se.force_block("B0_11")).all()
        assert (se.B_2(n).toarray()[12:24, 6:12] == se.force_block("B0_12")).all()
        assert (se.W_1(n).toarray()[:12, :12] == se.force_block("W")).all()
        assert not se.B_5(n)[:, :3].nnz


class TestClosure:
    def test_rules_hold_for_any_nodes(self, size, rng):
        n, m = size
        t = se.tendon_vectors(rng.standard_normal((4 * n * m, 3)), n, m)
        for number, left in se.closure_residuals(t).items():
            assert np.abs(left).max() < 1e-14, number

    def test_vectors_are_those_of_the_shell(self, size, rng):
        """(4.10), (4.11) typed as printed, against the topology table."""
        n, m = size
        structure, nodes = tc.shell(n, m), rng.standard_normal((4 * n * m, 3))
        t = se.tendon_vectors(nodes, n, m)
        for label, (tail, head) in zip(structure.tendon_labels, structure.tendons, strict=True):
            alpha, i, j = (int(part) for part in label[1:].split("_"))
            assert np.abs(t[alpha, j - 1, i - 1] - (nodes[head] - nodes[tail])).max() < 1e-14

    def test_class_two_shell_is_closed_on_the_cylinder(self):
        open_shell = tc.shell(5, 3)
        closed = tc.shell(5, 3, twist=2 * np.pi / 5, overlap=0.5)
        for structure, gap in ((closed, 0.0), (open_shell, 0.1)):
            gaps = se.class_two_gaps(se.tendon_vectors(structure.nodes, 5, 3))
            sizes = [np.linalg.norm(v, axis=-1).min() for v in gaps.values()]
            assert max(sizes) < 1e-14 if gap == 0 else min(sizes) > gap

    def test_two_of_the_four_class_two_constraints_are_independent(self, rng):
        gaps = se.class_two_gaps(se.tendon_vectors(rng.standard_normal((60, 3)), 5, 3))
        for one, other in (("-t1 + t4", "t2 + t3"), ("t5 + t6", "t7 + t8")):
            assert np.abs(gaps[one] + gaps[other]).max() < 1e-14
        both = np.stack([gaps["-t1 + t4"].ravel(), gaps["t5 + t6"].ravel()])
        assert np.linalg.matrix_rank(both) == 2

    @pytest.mark.parametrize(("n", "m"), [(4, 2), (5, 3)])
    def test_printed_rules_lose_forces(self, n, m, rng):
        """(2.3), (2.4), (2.9) as printed: n - 1 nodes P1 at the base and all n nodes P4 at the top are wrong."""
        f = random_forces(n, m, rng)
        wrong = np.linalg.norm(se.nodal_forces(f, rules="printed") - se.nodal_forces(f), axis=-1) > 1e-9
        assert np.argwhere(wrong).tolist() == [[0, i, 0] for i in range(1, n)] + [[m - 1, i, 3] for i in range(n)]


def test_sizes_that_make_no_shell_are_refused():
    with pytest.raises(StructureError, match=r"\(n, m\) = \(2, 1\)"):
        se.B_d(2, 1)
