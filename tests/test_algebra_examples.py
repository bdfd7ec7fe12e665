"""Every example of [W], with the printed numbers that survive and the corrected ones (docs/williamson_examples.md)."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import tensctl as tc
from tensctl.errors import EquilibriumError
from tensctl.statics.algebra import (
    Configuration,
    Network,
    admissible_ratios,
    component_labels,
    corollary13,
    corollary14,
    end_selectors,
    five_steps,
    lemma17,
    lemma18,
    lemma19,
    node_count,
    ranks,
    theorem11,
)

ROOT3 = 3**0.5


def numbered(n_p, bars, strings):
    """A network from the paper's pairs, which count nodes from 1."""
    return Network.build(n_p, np.array(bars) - 1, np.array(strings) - 1)


def matrix(rows):
    return np.array([[int(x) for x in row.split()] for row in rows])


def X_of(network, gamma, transform=corollary13):
    return lemma18(lemma17(network, transform(network)), gamma).X


EXAMPLE_8 = numbered(4, [(1, 2), (3, 4)], [(1, 3), (3, 2), (2, 4), (4, 1)])
# Two V's of bars; only its counts are the paper's.
EXAMPLE_9 = numbered(
    6, [(1, 2), (2, 3), (4, 5), (5, 6)], [(1, 4), (3, 6), (2, 5), (1, 3), (4, 6), (1, 5), (3, 5), (2, 4)]
)
STRINGS_10 = [(1, 3), (2, 4), (3, 5), (4, 6), (5, 1), (6, 2), (1, 6), (3, 2), (5, 4)]
BARS_10 = [(1, 2), (3, 4), (5, 6)]
EXAMPLE_10A = numbered(6, BARS_10, STRINGS_10)
EXAMPLE_10B = numbered(6, [*BARS_10, (1, 3), (3, 5), (5, 1)], [(2, 4), (4, 6), (6, 2), (1, 6), (3, 2), (4, 5)])
EXAMPLE_10C = numbered(6, [*BARS_10, (1, 3), (3, 5), (5, 1), (4, 5)], [(2, 4), (4, 6), (6, 2), (1, 6), (3, 2)])

positive = st.floats(0.1, 10.0)


# Example 8


def test_example_8_matrices():
    S = matrix(["-1 0 0 1", "0 1 -1 0", "1 -1 0 0", "0 0 1 -1"])
    assert (EXAMPLE_8.C_s.toarray() == S).all()
    assert (EXAMPLE_8.C_b.toarray() == matrix(["-1 0", "1 0", "0 -1", "0 1"])).all()
    known = ranks(EXAMPLE_8)
    assert (known.n_b, known.n_p, known.rho_B, EXAMPLE_8.class_k) == (2, 4, 2, 1)


def test_example_8_counts_loads_as_leaving_the_node():
    """(27) holds with +w at nodes 2 and 3; then w is minus the force applied to the node, against (21)."""
    rng = np.random.default_rng(8)
    p, gamma, lam = rng.normal(size=(4, 2)), rng.uniform(1, 2, 4), rng.uniform(1, 2, 2)
    loose = Configuration.at(EXAMPLE_8, p, gamma, lam)
    t, f = loose.t, loose.f
    applied = -loose.node_forces  # what has to be applied to each node to hold these nodes
    printed = np.array([-t[0] + t[3] + f[0], t[1] - t[2] - f[0], t[0] - t[1] + f[1], t[2] - t[3] - f[1]])
    assert printed == pytest.approx(applied)  # so "+ w = 0" of (27) means w = -applied
    assert Configuration.at(EXAMPLE_8, p, gamma, lam, applied).force_residual < 1e-15


# Example 9


def test_example_9_counts():
    known = ranks(EXAMPLE_9)
    assert (known.n_p, known.n_b, known.n_s, EXAMPLE_9.class_k) == (6, 4, 8, 2)
    assert known.rho_B == 4 == np.linalg.matrix_rank(EXAMPLE_9.C_b.toarray())
    assert node_count(EXAMPLE_9).lone_bars == 0
    EXAMPLE_9.verify()


# Example 10


def test_example_10a_matrices():
    # Rows 4 to 6 of S are partly lost; these are restored from the list of strings, rows 1 to 3 are the paper's.
    S = matrix(
        [
            "-1 0 0 0 1 0 -1 0 0",
            "0 -1 0 0 0 1 0 1 0",
            "1 0 -1 0 0 0 0 -1 0",
            "0 1 0 -1 0 0 0 0 1",
            "0 0 1 0 -1 0 0 0 -1",
            "0 0 0 1 0 -1 1 0 0",
        ]
    )
    assert (EXAMPLE_10A.C_s.toarray() == S).all()
    I_o, I_e = end_selectors(EXAMPLE_10A)
    assert (EXAMPLE_10A.C_b.toarray() == I_e - I_o).all()
    assert (I_o == np.kron(np.eye(3), [[1], [0]])).all()  # (40), n_p x n_b
    known = ranks(EXAMPLE_10A)
    assert (known.rho_B, known.n_b, known.n_p) == (3, 3, 6)  # (41) prints rho_B = n_p


def test_example_10b_has_a_loop_of_bars():
    # The lost row 5 of S is that of s9; s9 runs 4-5 here and 5-4 in (a).
    S = matrix(["0 0 0 -1 0 0", "-1 0 1 0 1 0", "0 0 0 0 -1 0", "1 -1 0 0 0 -1", "0 0 0 0 0 1", "0 1 -1 1 0 0"])
    B = matrix(["-1 0 0 -1 0 1", "1 0 0 0 0 0", "0 -1 0 1 -1 0", "0 1 0 0 0 0", "0 0 -1 0 1 -1", "0 0 1 0 0 0"])
    assert (EXAMPLE_10B.C_s.toarray() == S).all()
    assert (EXAMPLE_10B.C_b.toarray() == B).all()
    known = ranks(EXAMPLE_10B)
    assert (known.n_p, known.n_b, known.n_s) == (6, 6, 6)
    assert (known.rho_B, known.bar_loops) == (5, 1)
    assert known.n_b > known.n_p - 1  # Lemma 7 prints n_b <= n_p - 1
    assert EXAMPLE_10B.class_k == 3  # not the paper's class 2: one strut and two base bars meet at nodes 1, 3, 5


def test_example_10c_has_two():
    known = ranks(EXAMPLE_10C)
    assert (known.n_p, known.n_b, known.n_s, known.rho_B, known.bar_loops) == (6, 7, 5, 5, 2)
    B = EXAMPLE_10C.C_b.toarray()
    # {b4, b5, b6} and {b2, b7, b5}, as printed
    loops = np.array([[0, 0, 0, 1, 1, 1, 0], [0, 1, 0, 0, -1, 0, 1]]).T
    assert not (B @ loops).any()
    assert np.linalg.matrix_rank(loops) == 2
    assert EXAMPLE_10C.class_k == 4


@pytest.mark.parametrize(
    ("network", "values", "multiplicity"),
    [
        (EXAMPLE_10A, [1, 5 / 3], [1, 2]),
        (EXAMPLE_10B, [3 - 8**0.5, 1, 3 + 8**0.5], [2, 1, 2]),
        (EXAMPLE_10C, [3 - 8**0.5, 1 / 2, 3, 3 + 8**0.5], [1, 1, 1, 1]),
    ],
    ids=["a", "b", "c"],
)
def test_example_10_admissible_ratios(network, values, multiplicity):
    ratios = admissible_ratios(network)
    assert ratios.values == pytest.approx(values, rel=1e-13)
    assert ratios.multiplicity.tolist() == multiplicity
    assert ratios.decided


@pytest.mark.parametrize("network", [EXAMPLE_10B, EXAMPLE_10C], ids=["b", "c"])
def test_example_10_with_loops_of_bars_is_prestressed(network):
    ratios = admissible_ratios(network)
    assert ratios.decided
    for ratio, multiplicity in zip(ratios.values, ratios.multiplicity, strict=True):
        steps = five_steps(network, 1.0, ratio)
        assert steps.V_Y2.shape == (5, multiplicity)
        assert steps.residual < 1e-13


# Example 15


def test_example_15_corollary_14():
    P = corollary14(EXAMPLE_8)
    S1, S2 = P.split(EXAMPLE_8.C_s)
    assert (matrix(["1 0 0 -1", "-1 1 0 0"]) == S1).all()
    assert (matrix(["-1 1 -1 1", "1 -1 1 -1"]) == S2).all()
    assert (matrix(["-1 0 0 0", "0 0 -1 0"]) == P.P1).all()
    assert (matrix(["1 1 0 0", "0 0 1 1"]) == P.P2).all()


def test_example_15_corollary_13():
    P = corollary13(EXAMPLE_8)
    S1, S2 = P.split(EXAMPLE_8.C_s)
    assert (matrix(["-1 1 0 0", "0 0 -1 1"]) == 2 * P.P1).all()
    assert (matrix(["1 1 0 0", "0 0 1 1"]) == 2 * P.P2).all()
    assert (matrix(["1 1 -1 -1", "-1 1 1 -1"]) == 2 * S1).all()
    assert (matrix(["-1 1 -1 1", "1 -1 1 -1"]) == 2 * S2).all()


@pytest.mark.parametrize("network", [EXAMPLE_8, EXAMPLE_10A], ids=["8", "10a"])
def test_inverses_of_the_explicit_transformations(network, rng):
    I_o, I_e = end_selectors(network)
    J = I_e + I_o
    B = network.C_b.toarray()
    assert (np.linalg.inv(corollary13(network).P) == np.hstack([B, J])).all()  # (43)
    assert (np.linalg.inv(corollary14(network).P) == np.hstack([B, I_e])).all()  # (48)
    p = rng.normal(size=(network.n_p, 3))
    centres = p[network.bars].mean(axis=1)
    q13, q14 = corollary13(network).coordinates(p), corollary14(network).coordinates(p)
    assert q13[: network.n_b] == pytest.approx(B.T @ p)
    assert q13[network.n_b :] == pytest.approx(2 * centres)  # (46) prints the centres themselves
    assert q14[: network.n_b] == pytest.approx(B.T @ p)
    assert q14[network.n_b :] == pytest.approx(p[network.bars[:, 1]])  # (50)


# Example 24


@given(positive, positive, positive, positive)
def test_example_24_X(g1, g2, g3, g4):
    printed = np.array([[(g2 + g3) * (g4 + g1), g2 * g4 - g3 * g1], [g2 * g4 - g3 * g1, (g3 + g4) * (g2 + g1)]]) / (
        g1 + g2 + g3 + g4
    )
    for transform in (corollary13, corollary14):
        assert X_of(EXAMPLE_8, np.array([g1, g2, g3, g4]), transform) == pytest.approx(printed, rel=1e-13, abs=1e-13)


def test_example_24_X_at_one_point():
    X = 4.4 * X_of(EXAMPLE_8, np.array([1.3, 0.7, 2.0, 0.4]))
    assert pytest.approx(np.array([[4.59, -2.32], [-2.32, 4.80]]), abs=1e-14) == X


def test_example_24_printed_V2_spans_the_null_space_but_is_not_orthonormal():
    V2 = matrix(["1 -1 1", "1 0 0", "0 1 0", "0 0 1"])
    S1, S2 = corollary13(EXAMPLE_8).split(EXAMPLE_8.C_s)
    assert not (S2 @ V2).any()
    with_printed = np.linalg.eigvalsh(S1 @ V2 @ (S1 @ V2).T)
    assert with_printed == pytest.approx([1, 3])
    ours = lemma17(EXAMPLE_8, corollary13(EXAMPLE_8)).V2
    assert np.linalg.eigvalsh(S1 @ ours @ (S1 @ ours).T) == pytest.approx([1, 1])
    gamma = np.array([1.3, 0.7, 2.0, 0.4])
    M = V2.T @ np.diag(1 / gamma) @ V2
    assert S1 @ V2 @ np.linalg.inv(M) @ V2.T @ S1.T == pytest.approx(X_of(EXAMPLE_8, gamma))  # X takes any basis
    ratios = admissible_ratios(EXAMPLE_8)
    assert ratios.values == pytest.approx([1.0])
    assert ratios.multiplicity.tolist() == [2]


@given(positive, positive, positive)
def test_example_24_coefficients_of_a_flat_structure(g1, g2, g3):
    g4 = g3 * g1 / g2  # (85)
    total = g1 + g2 + g3 + g4
    lam = np.array([(g2 + g3) * (g4 + g1), (g3 + g4) * (g2 + g1)]) / total
    gamma = np.array([g1, g2, g3, g4])
    steps = five_steps(EXAMPLE_8, gamma, lam, z_d=np.array([[2.0, 0], [0, 2]]), transformation=corollary13(EXAMPLE_8))
    assert steps.condition.case == "ii"
    steps.verify(1e-12)
    assert steps.b == pytest.approx(np.array([[2.0, 0], [0, 2]]))


def test_example_24_rank_one_means_parallel_bars_and_not_more():
    gamma = np.array([1.3, 0.7, 2.0, 0.4])
    for ratio in admissible_ratios(EXAMPLE_8, gamma=gamma).values:
        steps = five_steps(EXAMPLE_8, gamma, ratio, d=1)
        assert steps.condition.case == "iii"
        assert abs(abs(steps.b[0, 0]) - abs(steps.b[1, 0])) > 0.01 * abs(steps.b[0, 0])
        p = steps.p[:, 0]
        assert min(abs(p[0] - p[2]), abs(p[1] - p[3])) > 0.01  # printed: p1 = p3, p2 = p4
        assert min(abs(p[0] - p[3]), abs(p[1] - p[2])) > 0.01  # nor the other way round


@pytest.mark.parametrize(
    ("z_e", "nodes"),
    [
        ([[0.0, 0.0]], [[-1, 0], [1, 0], [0, -1], [0, 1]]),
        ([[1.0, 1.0]], [[-0.6464, 0.3536], [1.3536, 0.3536], [0.3536, -0.6464], [0.3536, 1.3536]]),
    ],
)
def test_example_24_step_4(z_e, nodes):
    bars = np.array([[2.0, 0], [0, 2]])
    steps = five_steps(EXAMPLE_8, 1.0, 1.0, z_d=bars, z_e=np.array(z_e), transformation=corollary13(EXAMPLE_8))
    steps.verify(1e-15)
    assert steps.p == pytest.approx(np.array(nodes, float), abs=5e-5)
    assert steps.p.mean(axis=0) == pytest.approx(np.array(z_e[0]) / 8**0.5, abs=1e-15)
    # Step 5, not printed: a square of strings and its diagonals
    assert steps.t == pytest.approx(np.array([[1, -1], [1, 1], [-1, 1], [-1, -1]]), abs=1e-14)
    assert steps.s == pytest.approx(steps.t)
    assert steps.f == pytest.approx(bars)


def test_example_24_step_4_depends_on_the_transformation():
    """0.3536 belongs to Corollary 13; Theorem 11's own U_B2 gives 0.5, Corollary 14 0.7071."""
    for transform, shift in ((corollary13, 8**-0.5), (theorem11, 0.5), (corollary14, 2**-0.5)):
        P = transform(EXAMPLE_8)
        near = five_steps(EXAMPLE_8, 1.0, 1.0, z_d=np.zeros((2, 2)), z_e=np.ones((1, 2)), transformation=P)
        assert near.p == pytest.approx(np.full((4, 2), shift), abs=1e-14)


# Example 25


def denominator(b, t, v):
    return 2 * b**2 + 8 * b * t + 6 * b * v + 6 * v * t + 2 * t**2 + 3 * v**2


def printed_X(b, t, v):
    """The printed matrix without its prefactor 1/(gamma_t gamma_b gamma_v)^3 and with X13 of X3 corrected to X1's."""
    x11 = (t + v + b) * (v**2 + 3 * v * t + 3 * b * v + 4 * b * t + b**2 + t**2)
    x12 = -b * v * t - b * t**2 - 4 * b**2 * t - 3 * b**2 * v - b**3 + v * t**2 + 2 * t * v**2 + v**3
    x13 = -4 * b * t**2 - b * v * t - b**2 * t + 2 * b * v**2 + b**2 * v - 3 * v * t**2 - t**3 + v**3
    x22 = 10 * b * v * t + 4 * b * t**2 + 7 * b**2 * t + 5 * b * v**2 + 6 * b**2 * v + b**3
    x22 += 2 * v * t**2 + 3 * t * v**2 + v**3
    x23 = -3 * b * t**2 - b * v * t - v * t**2 + t * v**2 - 3 * b**2 * t + b * v**2 - b**2 * v + v**3
    x33 = 6 * v * t**2 + 5 * t * v**2 + 10 * b * v * t + 7 * b * t**2 + 4 * b**2 * t + t**3 + v**3
    x33 += 3 * b * v**2 + 2 * b**2 * v
    return np.array([[x11, x12, x13], [x12, x22, x23], [x13, x23, x33]]) / denominator(b, t, v)


def lambda_second(b, t, v, c):
    """The second factor of the determinant, every term as printed; c is lambda."""
    return (
        -2 * t**3 * c + 2 * v**2 * t**2 + 2 * v * t**3 + 6 * b**3 * t + 15 * b**2 * t**2 + 2 * b**2 * v**2
        + 6 * b * t**3 + 2 * b**3 * v - 6 * v**2 * t * c - 10 * v * t**2 * c - 16 * b**2 * t * c
        + 2 * b**2 * c**2 - 2 * b**3 * c - 10 * b**2 * v * c + 6 * b * c**2 * v - 6 * b * c * v**2
        + 8 * b * c**2 * t - 16 * b * c * t**2 - 22 * b * c * v * t + 2 * c**2 * t**2 + 3 * c**2 * v**2
        + 6 * c**2 * v * t + 16 * b * t**2 * v + 8 * b * t * v**2 + 16 * b**2 * v * t
    )  # fmt: skip


def coefficients_25(b, t, v):
    """In the order of Example 10, as printed: strings 1-3, 4-6, 7-9."""
    return np.array([b] * 3 + [t] * 3 + [v] * 3)


def coefficients_by_ring(b, t, v):
    """The triangle 1-3-5 as base (strings 1, 3, 5) and 2-4-6 as top (2, 4, 6)."""
    return np.array([b, t, b, t, b, t] + [v] * 3)


@given(positive, positive, positive)
def test_example_25_X(b, t, v):
    X = X_of(EXAMPLE_10A, coefficients_25(b, t, v))
    assert pytest.approx(printed_X(b, t, v), rel=1e-11, abs=1e-12 * np.abs(X).max()) == X


def test_example_25_X_at_one_point():
    b, t, v = 1, 2, 1.5
    X = denominator(b, t, v) * X_of(EXAMPLE_10A, coefficients_25(b, t, v))
    right = np.array([[129.375, -2.125, -37.625], [-2.125, 110.125, -18.375], [-37.625, -18.375, 145.625]])
    assert pytest.approx(right, abs=1e-12) == X
    in_X3 = -4 * b * t**2 - b * v * t - b**2 * t + 2 * b * v**2 + 2 * b * v**2 - 3 * v * t**2 - t**3 + v**3
    assert in_X3 == -34.625  # X13 as X3 prints it, 2 b v^2 twice: not symmetric, not right


def test_example_25_base_of_the_print_is_no_triangle():
    assert component_labels(6, EXAMPLE_10A.strings[:3])[0] == 3  # 1-3-5, 2-4 and 6 alone
    assert ranks(Network.build(6, EXAMPLE_10A.bars, EXAMPLE_10A.strings[[0, 2, 4]])).string_pieces == 4


@given(positive, positive, positive, positive)
def test_example_25_determinant(b, t, v, c):
    Y = X_of(EXAMPLE_10A, coefficients_25(b, t, v)) - c * np.eye(3)
    printed = -(c - v) / denominator(b, t, v) * lambda_second(b, t, v, c)
    assert np.linalg.det(Y) == pytest.approx(printed, abs=1e-11 * (b + t + v + c) ** 3)


@given(positive, positive, positive)
def test_example_25_factors_of_the_determinant(b, t, c):
    at_gamma_v = lambda_second(b, t, c, c)
    scale = 1e-12 * (b + t + c) ** 4 * 10
    expanded = -6 * c**2 * t**2 - 6 * b**2 * c**2 + 6 * b * t**3 + 6 * b**3 * t + 15 * b**2 * t**2
    assert at_gamma_v == pytest.approx(expanded - 6 * b * c**2 * t + 3 * c**4, abs=scale)  # as printed
    factors = (c**2 - t * b - 2 * b**2) * (c**2 - t * b - 2 * t**2)
    assert at_gamma_v == pytest.approx(3 * factors, abs=scale)  # printed without the 3


@given(positive, positive)
def test_example_25_rank_one_and_its_matrix(b, t):
    assume(abs(b - t) > 0.1 * (b + t))
    bt = (t * (b + 2 * t)) ** 0.5
    gamma = coefficients_25(b, t, bt)
    bar_X = np.array(
        [
            [b + 2 * bt + 3 * t, -b - 4 * t - 3 * bt, t + bt],
            [-b - 4 * t - 3 * bt, b + 4 * bt + 6 * t, -2 * t - bt],
            [t + bt, -2 * t - bt, t],
        ]
    )
    factor = (b - t) * (b + t) / (2 * b**2 + 6 * b * bt + 11 * b * t + 8 * t**2 + 6 * t * bt)
    assert X_of(EXAMPLE_10A, gamma) - bt * np.eye(3) == pytest.approx(factor * bar_X, abs=1e-11 * (b + t))
    P = corollary13(EXAMPLE_10A)
    for lam in (bt, (t * b + 2 * b**2) ** 0.5):
        forces = lemma18(lemma17(EXAMPLE_10A, P), coefficients_25(b, t, lam))
        rank = lemma19(forces, P, lam).rank
        assert (rank.rank, rank.decided) == (1, True)
    flat = five_steps(EXAMPLE_10A, gamma, bt)
    flat.verify(1e-12)
    # Two null vectors fill a plane: with unequal coefficients the print never leaves it.
    assert np.linalg.matrix_rank(flat.p - flat.p.mean(axis=0), tol=1e-8) == 2


@given(positive, positive, positive)
def test_example_25_X_with_triangles_is_a_circulant(b, t, v):
    """X = mu I + (v - mu)/3 ones, so X = Lambda exactly when lambda = v = mu, that is v^2 = 3 b t."""
    mu = (3 * b * t + v * (b + t)) / (b + t + v)
    X = X_of(EXAMPLE_10A, coefficients_by_ring(b, t, v))
    assert pytest.approx(mu * np.eye(3) + (v - mu) / 3, abs=1e-13 * (b + t + v)) == X


@given(positive, positive)
def test_example_25_x_is_lambda_for_every_base_and_top(b, t):
    c = (3 * b * t) ** 0.5
    gamma = coefficients_by_ring(b, t, c)
    assert np.abs(X_of(EXAMPLE_10A, gamma) - c * np.eye(3)).max() < 1e-13 * (b + t + c)
    bars = np.random.default_rng(25).normal(size=(3, 3))
    steps = five_steps(EXAMPLE_10A, gamma, c, z_d=bars, transformation=corollary13(EXAMPLE_10A))
    assert steps.condition.case == "ii"
    assert steps.rank_Y.decided
    assert steps.b == pytest.approx(bars)  # bars freely chosen
    steps.verify(1e-12)


def test_example_25_prism_of_figure_3():
    steps = five_steps(EXAMPLE_10A, coefficients_25(1, 1, ROOT3), ROOT3, near=prism_of_10(1.0, 1.0))
    assert steps.p == pytest.approx(prism_of_10(1.0, 1.0), abs=1e-14)
    steps.verify(1e-14)


@given(positive, positive)
def test_example_25_radii_of_base_and_top(b, t):
    """gamma_b r_b^2 = gamma_t r_t^2, twisted by 150 degrees like the prism of equal radii."""
    wanted = prism_of_10(b**-0.5, t**-0.5)
    steps = five_steps(EXAMPLE_10A, coefficients_by_ring(b, t, (3 * b * t) ** 0.5), (3 * b * t) ** 0.5, near=wanted)
    assert steps.p == pytest.approx(wanted, abs=1e-12)


def prism_of_10(base, top):
    """The regular prism with the nodes of Example 10: odd ones below, even ones above."""
    nodes = tc.prism(3).nodes
    nodes = np.vstack([nodes[:3] * [base, base, 1], nodes[3:] * [top, top, 1]])
    return nodes[[0, 3, 1, 4, 2, 5]]


@pytest.mark.parametrize("n", [3, 4, 5, 6, 8, 12])
def test_example_25_for_prisms_of_n_bars(n):
    """lambda = gamma_v = 2 sin(pi/n) sqrt(gamma_b gamma_t) leaves a null space of exactly three: a solid structure."""
    b, t = 1.7, 0.6
    c = 2 * np.sin(np.pi / n) * (b * t) ** 0.5
    gamma = np.repeat([b, t, c], n)
    network = Network.of(tc.prism(n))
    nodes = tc.prism(n).nodes
    wanted = np.vstack([nodes[:n] * [b**-0.5, b**-0.5, 1], nodes[n:] * [t**-0.5, t**-0.5, 1]])
    steps = five_steps(network, gamma, c, near=wanted)
    assert (steps.rank_Y.nullity, steps.rank_Y.decided) == (3, True)
    assert steps.p == pytest.approx(wanted, abs=1e-12)
    steps.verify(1e-13)


# Remarks of the paper that the examples bear on


def test_admissible_ratios_depend_on_the_bars_too():
    """The conclusion of [W] calls them given by the string connectivity alone; P comes from the bars."""
    strings = [(1, 3), (3, 2), (2, 4), (4, 1)]
    crossed = admissible_ratios(EXAMPLE_8).values
    joined = admissible_ratios(numbered(4, [(1, 2), (2, 3), (3, 4)], strings)).values
    assert crossed == pytest.approx([1.0])
    assert len(joined) != len(crossed) or abs(joined - crossed).max() > 0.1


def test_a_zero_eigenvalue_is_no_admissible_ratio():
    """Corollary 20 calls every eigenvalue admissible; lambda > 0 leaves the zeros out."""
    hanging = numbered(4, [(1, 2), (3, 4)], [(1, 3)])
    ratios = admissible_ratios(hanging)
    assert ratios.eigenvalues == pytest.approx(0, abs=1e-15)
    assert len(ratios.values) == 0
    with pytest.raises(EquilibriumError, match="lambda of bar 0 is 0"):
        five_steps(hanging, 1.0, 0.0).verify()


def test_uniqueness_under_load_is_rank_rho_B_not_n_b(rng):
    """After Theorem 22: "if r_Y = n_b" never happens with loops of bars, where rho_B < n_b."""
    loads = rng.normal(size=(6, 3))
    loads -= loads.mean(axis=0)
    steps = five_steps(EXAMPLE_10B, 1.0, rng.uniform(0.2, 0.6, 6), loads=loads)
    assert (steps.rank_Y.rank, EXAMPLE_10B.n_b) == (5, 6)
    assert steps.z_d.shape == (0, 3)
    assert steps.residual < 1e-12
