"""Graphs, ranks and loops against numpy's singular values and plain counting ([W] sections 2 and 3)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tensctl as tc
from tensctl.errors import EquilibriumError, StructureError
from tensctl.statics.algebra import (
    Network,
    bar_coordinates,
    component_labels,
    decide_rank,
    end_selectors,
    forest_transformation,
    kron,
    lemma17,
    load_incidence,
    loop_gaps,
    loop_matrix,
    node_count,
    ranks,
    solve,
    spanning_forest,
    stack,
    svd,
    theorem11,
    unstack,
)


@st.composite
def networks(draw, max_nodes=9, min_bars=0, min_strings=0):
    """Any graph: several pieces, loops of bars, lonely nodes, members in either direction."""
    n = draw(st.integers(3, max_nodes))
    pairs = [(i, j) for i in range(n) for j in range(i)]
    count = st.integers(min_bars + min_strings, min(len(pairs), 3 * n))
    chosen = draw(st.permutations(pairs))[: draw(count)]
    turned = [pair if draw(st.booleans()) else pair[::-1] for pair in chosen]
    cut = draw(st.integers(min_bars, len(turned) - min_strings))
    members = np.array(turned, int).reshape(-1, 2)
    return Network(n, members[:cut], members[cut:])


def connected(network):
    return ranks(network).pieces == 1


def rank_of(A):
    return np.linalg.matrix_rank(A.toarray() if hasattr(A, "toarray") else A)


@given(networks())
def test_ranks_of_the_graph_are_ranks_of_its_matrices(network):
    known = ranks(network)
    C_s, C_b = network.C_s.toarray(), network.C_b.toarray()
    assert known.rho_B == rank_of(C_b) == network.n_b - known.bar_loops
    assert known.rho_S == rank_of(C_s)
    assert known.rho_A == rank_of(np.hstack([C_s, C_b]))


@given(networks(min_bars=1, min_strings=1), st.sampled_from([theorem11, forest_transformation]))
def test_transformations_decouple_the_bars_of_any_graph(network, transform):
    P = transform(network)
    known = ranks(network)
    assert P.residual(network) < 1e-13
    assert P.rho_B == known.rho_B == rank_of(P.V_B1)
    assert rank_of(P.P) == network.n_p
    S1, S2 = P.split(network.C_s)
    assert rank_of(S2) == known.rho_2 if S2.size else known.rho_2 == 0
    p = np.random.default_rng(network.n_p).normal(size=(network.n_p, 3))
    q = P.coordinates(p)
    assert P.nodes(q) == pytest.approx(p, abs=1e-12)
    assert P.V_B1 @ q[: P.rho_B] == pytest.approx(network.C_b.T @ p, abs=1e-12)
    assert bar_coordinates(P, network.C_b.T @ p) == pytest.approx(q[: P.rho_B], abs=1e-12)
    assert S1.T @ q[: P.rho_B] + S2.T @ q[P.rho_B :] == pytest.approx(network.C_s.T @ p, abs=1e-12)  # (32)


@given(networks(min_bars=1, min_strings=1))
def test_theorem_11_is_orthonormal_and_the_forest_is_integer(network):
    V = theorem11(network).V_B1
    assert pytest.approx(np.eye(V.shape[1]), abs=1e-13) == V.T @ V
    P = forest_transformation(network).P
    assert set(np.unique(P)) <= {-1.0, 0.0, 1.0}
    assert abs(round(np.linalg.det(P))) == 1


@given(networks(min_bars=1, min_strings=1))
def test_lemma_17_splits_s2_at_its_rank(network):
    space = lemma17(network, theorem11(network))
    known = ranks(network)
    assert space.V2.shape == (network.n_s, known.free_tensions)
    assert space.U2.shape[1] == known.free_positions == known.pieces
    assert np.abs(space.S2 @ space.V2).max(initial=0) < 1e-13
    assert np.abs(space.U2.T @ space.S2).max(initial=0) < 1e-13
    assert space.U1 * space.sigma @ space.V1.T == pytest.approx(space.S2, abs=1e-13)


@given(networks())
def test_loops_close_and_are_independent(network):
    loops = loop_matrix(network.n_p, network.members)
    C = np.hstack([network.C_s.toarray(), network.C_b.toarray()])
    assert loops.shape[1] == ranks(network).loops == rank_of(loops) if loops.size else ranks(network).loops == 0
    assert not (C @ loops.toarray()).any()  # exact: integers
    assert set(np.unique(loops.toarray())) <= {-1, 0, 1}


@given(networks())
def test_branch_vectors_of_nodes_obey_the_loop_law_and_others_do_not(network):
    p = np.random.default_rng(7).normal(size=(network.n_p, 3))
    s, b = network.C_s.T @ p, network.C_b.T @ p
    gaps = loop_gaps(network, s, b)
    assert np.abs(gaps).max(initial=0) < 1e-13
    if len(gaps):
        everywhere = loop_matrix(network.n_p, network.members).toarray()
        k = int(np.abs(everywhere).sum(axis=1).argmax())
        e = np.vstack([s, b])
        e[k] += 1.0
        assert np.abs(loop_gaps(network, e[: network.n_s], e[network.n_s :])).max() > 0.5


@given(networks())
def test_the_forest_reaches_every_node(network):
    forest = spanning_forest(network.n_p, network.members)
    pieces, _ = component_labels(network.n_p, network.members)
    assert len(forest.roots) == pieces
    assert len(forest.tree) + len(forest.chords) == len(network.members)
    p = np.random.default_rng(3).normal(size=(network.n_p, 2))
    e = p[network.members[forest.tree, 1]] - p[network.members[forest.tree, 0]]
    assert forest.paths @ e + p[forest.roots[forest.root_of]] == pytest.approx(p, abs=1e-13)


@given(networks())
def test_nodes_are_counted_as_the_paper_counts_them(network):
    count = node_count(network)
    touching = network.n_b - count.lone_bars
    assert count.n_p == network.n_p
    assert 2 * count.of_touching_bars <= 3 * touching  # sharper than the printed 2 (n_b - n_b0)
    if touching:
        assert count.of_touching_bars < 2 * touching


def test_a_star_of_bars_has_one_node_more_than_bars():
    star = Network.build(8, [(0, k) for k in range(1, 6)] + [(6, 7)], [(1, 6)])
    count = node_count(star)
    assert (count.lone_bars, count.of_touching_bars, star.class_k) == (1, 5 + 1, 5)


def test_pairs_of_touching_bars_meet_the_sharper_count():
    pairs = Network.build(6, [(0, 1), (1, 2), (3, 4), (4, 5)], [(0, 3)])
    assert node_count(pairs).of_touching_bars == 6 == 3 * pairs.n_b // 2


@given(networks())
def test_incidence_matrices_are_sparse_integers_with_one_head_and_one_tail(network):
    for C, members in ((network.C_s, network.strings), (network.C_b, network.bars)):
        assert C.dtype == np.int64
        assert C.nnz == 2 * len(members)
        p = np.arange(network.n_p) ** 2
        assert (C.T @ p == p[members[:, 1]] - p[members[:, 0]]).all()


def test_loads_enter_their_nodes():
    assert load_incidence(4, np.array([2, 0])).toarray().tolist() == [[0, 1], [0, 0], [1, 0], [0, 0]]
    with pytest.raises(StructureError, match="load 1 acts on node 4"):
        load_incidence(4, np.array([0, 4]))


def test_a_structure_gives_its_network():
    network = Network.of(tc.shell(3, 1))
    assert (network.n_p, network.n_b, network.n_s, network.class_k) == (12, 6, 24, 1)
    network.verify()
    assert ranks(network).rho_2 == 5


@pytest.mark.parametrize(
    ("bars", "strings", "sentence"),
    [
        ([(0, 1)], [(1, 2), (2, 1)], "strings 0 and 1 join the same nodes 2 and 1; give one string"),
        ([(0, 1), (1, 0)], [], "bars 0 and 1 join the same nodes"),
        ([(0, 0)], [], "bar 0 starts and ends at node 0"),
        ([(0, 4)], [], "bar 0 joins nodes 0 and 4; the network has 4 nodes"),
        ([(0, -1)], [], "bar 0 joins nodes 0 and -1"),
        ([(0, 1, 2)], [], "bars have shape"),
    ],
)
def test_bad_members_are_named(bars, strings, sentence):
    with pytest.raises(StructureError, match=sentence.replace("(", r"\(")):
        Network.build(4, bars, strings)


def test_a_network_in_pieces_is_built_but_not_verified():
    network = Network.build(5, [(0, 1), (2, 3)], [(1, 4)])
    assert ranks(network).pieces == 2
    with pytest.raises(StructureError, match="2 pieces \\(node 2 is not joined to node 0\\)"):
        network.verify()
    with pytest.raises(StructureError, match="1 bars and 0 strings"):
        Network.build(2, [(0, 1)], []).verify()


def test_class_one_is_asked_of_the_corollaries():
    with pytest.raises(StructureError, match="node 1 ends 2 bars"):
        end_selectors(Network.build(3, [(0, 1), (1, 2)], [(0, 2)]))


def test_members_of_a_network_cannot_be_changed():
    network = Network.build(3, [(0, 1)], [(1, 2)])
    with pytest.raises(ValueError, match="read-only"):
        network.bars[0, 0] = 2


# Lemmas 1 and 2


@given(st.integers(1, 4), st.integers(1, 4), st.integers(1, 4), st.integers(1, 3), st.integers(0, 10**6))
def test_lemma_1(n, r, p, d, seed):
    rng = np.random.default_rng(seed)
    A, B, C = rng.normal(size=(n, r)), rng.normal(size=(n, r)), rng.normal(size=(r, p))
    assert (kron(A.T, d) != kron(A, d).T).nnz == 0
    assert (kron(A, d) + kron(B, d)).toarray() == pytest.approx(kron(A + B, d).toarray())
    assert (kron(A, d) @ kron(C, d)).toarray() == pytest.approx(kron(A @ C, d).toarray())
    assert rank_of(kron(A, d)) == d * rank_of(A)
    X = rng.normal(size=(r, d))
    assert unstack(kron(A, d) @ stack(X), d) == pytest.approx(A @ X)


def test_lemma_1_repeats_eigenvalues(rng):
    A = rng.normal(size=(4, 4))
    A = A + A.T
    once, thrice = np.linalg.eigvalsh(A), np.linalg.eigvalsh(kron(A, 3).toarray())
    assert thrice == pytest.approx(np.repeat(once, 3))


@given(st.integers(1, 5), st.integers(1, 5), st.integers(0, 5), st.integers(0, 10**6))
def test_lemma_2_gives_all_solutions(n, m, r, seed):
    rng = np.random.default_rng(seed)
    r = min(n, m, r)
    A = rng.normal(size=(n, r)) @ rng.normal(size=(r, m))
    Y = A @ rng.normal(size=(m, 3))
    found = solve(A, Y)
    assert found.null.shape == (m, m - found.rank.rank)  # z has m - r entries, not n - r as printed
    anything = rng.normal(size=(m - found.rank.rank, 3))
    assert A @ (found.particular + found.null @ anything) == pytest.approx(Y, abs=1e-9)
    parts = svd(A)
    assert parts.U1 * parts.sigma @ parts.V1.T == pytest.approx(A, abs=1e-12)


def test_lemma_2_names_what_cannot_be_reached():
    with pytest.raises(EquilibriumError, match="has no solution: the part of Y outside"):
        solve(np.array([[1.0], [1.0]]), np.array([[1.0], [0.0]]))


# Rank decisions


def test_a_rank_shows_its_gap():
    clear = decide_rank(np.array([2.0, 1e-16, 1.0]), scale=2.0, rounding=1e-15)
    assert (clear.rank, clear.nullity, clear.decided, clear.gap) == (2, 1, True, pytest.approx(1e15))
    doubtful = decide_rank(np.array([1.0, 3e-15]), scale=1.0, rounding=1e-15)
    assert (doubtful.rank, doubtful.decided) == (2, False)
    assert "undecided" in str(doubtful)
    asked = decide_rank(np.array([1.0, 3e-15]), scale=1.0, rounding=1e-15, rank_tol=1e-10)
    assert (asked.rank, asked.decided) == (1, True)
    nothing = decide_rank(np.array([1e-17]), scale=1.0, rounding=1e-15)
    assert (nothing.rank, nothing.decided) == (0, True)
