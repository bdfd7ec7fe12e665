"""Equilibria of any network against direct physics, exact arithmetic and invariance ([W] sections 4 and 5)."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from test_algebra_graphs import connected, networks

import tensctl as tc
from tensctl.errors import EquilibriumError, StructureError
from tensctl.statics.algebra import (
    Configuration,
    Network,
    admissible_ratios,
    corollary13,
    corollary14,
    five_steps,
    force_density_matrix,
    forest_transformation,
    lemma17,
    lemma18,
    lemma19,
    lemma23,
    ranks,
    theorem11,
    theorem22,
)

ROOT3 = 3**0.5
PRISM = Network.of(tc.prism(3))  # bars 0-2, strings: base, top, sides
HOLDING = np.array([1.0] * 6 + [ROOT3] * 3)  # with lambda = sqrt(3), every affine prism
LOOPED = Network.build(6, np.vstack([PRISM.bars, PRISM.strings[:3]]), PRISM.strings[3:])  # base of bars: class 3


def sum_of_forces(network, p, gamma, lam, w=None, load_nodes=None):
    """Force on every node, member by member: a string pulls its tail towards its head, a bar pushes."""
    total = np.zeros_like(p)
    for (tail, head), g in zip(network.strings, gamma, strict=True):
        total[tail] += g * (p[head] - p[tail])
        total[head] -= g * (p[head] - p[tail])
    for (tail, head), c in zip(network.bars, lam, strict=True):
        total[tail] -= c * (p[head] - p[tail])
        total[head] += c * (p[head] - p[tail])
    if w is not None:
        np.add.at(total, np.arange(len(w)) if load_nodes is None else load_nodes, w)
    return total


def coefficients_of(network, rng):
    return rng.uniform(0.5, 2.0, network.n_s), rng.uniform(0.5, 2.0, network.n_b)


def imbalance(steps):
    """Independent force sum over the largest force."""
    c = steps.configuration
    total = sum_of_forces(c.network, c.p, c.gamma, c.lam, c.w, c.load_nodes)
    return np.abs(total).max() / max(np.abs(c.t).max(), np.abs(c.f).max(), np.abs(c.w).max(initial=0))


seeds = st.integers(0, 10**6)
structures = networks(min_bars=1, min_strings=1).filter(connected)


@given(structures, seeds)
def test_incidence_matrices_sum_the_forces(network, seed):
    rng = np.random.default_rng(seed)
    gamma, lam = coefficients_of(network, rng)
    p, w, at = rng.normal(size=(network.n_p, 3)), rng.normal(size=(2, 3)), rng.integers(0, network.n_p, 2)
    direct = sum_of_forces(network, p, gamma, lam, w, at)
    assert Configuration.at(network, p, gamma, lam, w, at).node_forces == pytest.approx(direct, abs=1e-12)
    unloaded = sum_of_forces(network, p, gamma, lam)
    assert -(force_density_matrix(network, gamma, lam) @ p) == pytest.approx(unloaded, abs=1e-12)


@given(structures, seeds)
def test_nullity_of_y_is_that_of_all_force_densities_less_translation(network, seed):
    rng = np.random.default_rng(seed)
    gamma, lam = coefficients_of(network, rng)
    ratios = admissible_ratios(network, gamma=gamma, lam=lam)
    assume(ratios.decided and len(ratios.values))
    P = theorem11(network)
    for mu, multiplicity in zip(ratios.values, ratios.multiplicity, strict=True):
        condition = lemma19(lemma18(lemma17(network, P), gamma), P, mu * lam)
        omega = force_density_matrix(network, gamma, mu * lam).toarray()
        assert condition.rank.decided
        assert condition.rank.nullity == multiplicity
        assert (np.abs(np.linalg.eigvalsh(omega)) < 1e-11).sum() == multiplicity + 1


@given(structures, seeds, st.sampled_from([theorem11, forest_transformation]))
def test_unloaded_structures_balance(network, seed, transform):
    rng = np.random.default_rng(seed)
    gamma, lam = coefficients_of(network, rng)
    ratios = admissible_ratios(network, gamma=gamma, lam=lam)
    assume(ratios.decided and len(ratios.values))
    P = transform(network)
    for mu in ratios.values:
        nullity = lemma19(lemma18(lemma17(network, P), gamma), P, mu * lam).rank.nullity
        steps = five_steps(
            network,
            gamma,
            mu * lam,
            z_d=rng.normal(size=(nullity, 3)),
            z_e=rng.normal(size=(1, 3)),
            transformation=P,
        )
        assert imbalance(steps) < 1e-11
        assert steps.residual < 1e-11
        assert steps.configuration.loop_residual < 1e-11
        assert np.linalg.matrix_rank(steps.p - steps.p.mean(axis=0), tol=1e-9) == min(3, nullity)


@given(structures, seeds)
def test_some_positive_lambda_holds_a_line_whenever_strings_resist_the_bars(network, seed):
    rng = np.random.default_rng(seed)
    gamma, lam = coefficients_of(network, rng)
    P = theorem11(network)
    X = lemma18(lemma17(network, P), gamma).X
    assert np.linalg.eigvalsh(X)[0] > -1e-12
    assert (np.abs(X).max() > 1e-9) == (len(admissible_ratios(network, gamma=gamma, lam=lam).values) > 0)


@given(structures, seeds, st.booleans())
def test_theorem_22_finds_every_loaded_structure(network, seed, singular):
    """Any nodes are in equilibrium under the load Omega p; the five steps must give them back."""
    rng = np.random.default_rng(seed)
    gamma, lam = coefficients_of(network, rng)
    if singular:
        ratios = admissible_ratios(network, gamma=gamma, lam=lam)
        assume(ratios.decided and len(ratios.values))
        lam = lam * ratios.values[-1]
    P = theorem11(network)
    condition = lemma19(lemma18(lemma17(network, P), gamma), P, lam)
    kept = condition.rank.smallest_kept / condition.rank.scale
    assume(condition.rank.decided and kept > 1e-4)
    assert (condition.rank.nullity > 0) == singular
    p = rng.normal(size=(network.n_p, 3))
    steps = five_steps(network, gamma, lam, loads=-sum_of_forces(network, p, gamma, lam), near=p)
    assert steps.p == pytest.approx(p, abs=1e-13 / kept)
    assert imbalance(steps) < 1e-14 / kept
    assert steps.residual < 1e-13 / kept
    # The free vectors of a singular Y change the shape and keep the balance.
    other = five_steps(
        network,
        gamma,
        lam,
        loads=steps.configuration.w,
        z_d=steps.z_d + rng.normal(size=steps.z_d.shape),
        z_e=steps.z_e + 1.0,
    )
    assert imbalance(other) < 1e-13 / kept


@pytest.mark.parametrize("network", [PRISM, LOOPED], ids=["class 1", "loop of bars"])
def test_theorem_22_on_the_prism_with_random_coefficients_and_loads(network, rng):
    worst = 0.0
    for _ in range(200):
        gamma, lam = coefficients_of(network, rng)
        loads = rng.normal(size=(4, 3))
        loads -= loads.mean(axis=0)
        steps = five_steps(network, gamma, lam, loads=loads, load_nodes=rng.permutation(6)[:4])
        kept = steps.rank_Y.smallest_kept / steps.rank_Y.scale
        if kept > 1e-2:
            worst = max(worst, imbalance(steps), steps.residual)
    assert worst < 1e-13


def test_the_loops_of_bars_are_there():
    known = ranks(LOOPED)
    assert (known.n_b, known.n_p, known.rho_B, known.bar_loops, LOOPED.class_k) == (6, 6, 5, 1, 3)


@given(networks(min_bars=1, min_strings=1))
def test_lemma_23_sees_every_piece(network):
    P = theorem11(network)
    E = lemma23(lemma18(lemma17(network, P), 1.0), P)
    known = ranks(network)
    assert E.shape == (known.pieces, network.n_p)  # not n_s columns
    C = np.hstack([network.C_s.toarray(), network.C_b.toarray()])
    assert np.abs(E @ C).max() < 1e-13  # constant along every member, strings and bars
    assert np.linalg.matrix_rank(E) == known.pieces


def test_lemma_23_needs_the_bars_when_the_strings_fall_apart():
    network = Network.build(4, [(0, 2), (1, 3)], [(0, 1), (2, 3)])
    known = ranks(network)
    assert (known.string_pieces, known.pieces) == (2, 1)
    P = theorem11(network)
    E = lemma23(lemma18(lemma17(network, P), 1.0), P)
    assert pytest.approx(np.full((1, 4), E[0, 0])) == E


# Solvability


def test_loads_that_do_not_balance_are_named():
    with pytest.raises(EquilibriumError, match=r"the loads add up to \[0. 0. 2.\] N"):
        five_steps(PRISM, 1.0, 0.3, loads=np.array([[0, 0, 1.0], [0, 0, 1.0]]), load_nodes=np.array([0, 1]))


def test_loads_on_the_null_space_of_y_are_named():
    squeeze = np.array([[0, 0, 1.0]] * 3 + [[0, 0, -1.0]] * 3)
    with pytest.raises(EquilibriumError, match=r"null space of Y .*U_Y2' G w is"):
        five_steps(PRISM, HOLDING, ROOT3, loads=squeeze)


def test_a_singular_y_takes_the_loads_that_leave_it_alone():
    """What other nodes would be out of balance by is orthogonal to every shape that the coefficients hold."""
    rng = np.random.default_rng(5)
    omega = force_density_matrix(PRISM, HOLDING, np.full(3, ROOT3)).toarray()
    loads = omega @ rng.normal(size=(6, 3))
    steps = five_steps(PRISM, HOLDING, ROOT3, loads=loads, near=tc.prism(3).nodes)
    steps.verify(1e-13)
    assert steps.condition.case == "ii"
    assert steps.z_d.shape == (3, 3)


def test_coefficients_that_hold_no_shape_are_named():
    with pytest.raises(EquilibriumError, match=r"hold no shape: .*rank 3 of 3.* take lambda from admissible_ratios"):
        five_steps(PRISM, HOLDING, 1.7)


def test_coefficients_rounded_on_paper_need_a_tolerance_and_show_their_residual():
    with pytest.raises(EquilibriumError, match="give rank_tol"):
        five_steps(PRISM, HOLDING, 1.7320508)
    steps = five_steps(PRISM, HOLDING, 1.7320508, rank_tol=1e-6, near=tc.prism(3).nodes)
    assert steps.rank_Y.decided
    assert 1e-10 < steps.residual < 1e-7
    with pytest.raises(EquilibriumError, match="false by"):
        steps.verify()


def test_what_double_precision_cannot_decide_is_said():
    steps = lemma_19_of_prism(ROOT3 * (1 + 1e-13))
    assert not steps.rank.decided
    assert "undecided" in str(steps.rank)
    assert lemma_19_of_prism(ROOT3).rank.decided
    assert lemma_19_of_prism(ROOT3 * (1 + 1e-10)).rank.decided


@pytest.mark.parametrize(("stiff", "decided"), [(1e3, True), (1e9, True), (1e17, False)])
def test_weak_members_beside_stiff_ones_are_not_taken_for_zeros(stiff, decided):
    """Two crosses tied by two strings: the stiff one holds itself, whether the weak one does drowns in it."""
    cross, tie = np.array([(0, 2), (2, 1), (1, 3), (3, 0)]), [(0, 4), (1, 5)]
    network = Network.build(8, [(0, 1), (2, 3), (4, 5), (6, 7)], np.vstack([cross, cross + 4, tie]))
    gamma, lam = np.array([stiff] * 4 + [1.0] * 6), np.array([stiff] * 2 + [0.3] * 2)
    P = corollary13(network)
    assert lemma19(lemma18(lemma17(network, P), gamma), P, lam).rank.decided == decided


def lemma_19_of_prism(lam):
    P = corollary14(PRISM)
    return lemma19(lemma18(lemma17(PRISM, P), HOLDING), P, lam)


# Bad input


@pytest.mark.parametrize(
    ("error", "sentence", "given_"),
    [
        (EquilibriumError, "gamma of string 2 is 0 N/m", {"gamma": np.array([1, 1, 0] + [1.0] * 6)}),
        (StructureError, r"gamma has shape \(8,\); one number or 9", {"gamma": np.ones(8)}),
        (StructureError, r"lambda has shape \(2,\); one number or 3", {"lam": np.ones(2)}),
        (StructureError, "lambda holds a value that is not finite", {"lam": np.array([1, np.nan, 1])}),
        (StructureError, r"z_d has shape \(2, 3\); these coefficients leave \(3, 3\)", {"z_d": np.ones((2, 3))}),
        (StructureError, r"arrays of \[2, 3\] components", {"z_d": np.ones((3, 3)), "z_e": np.ones((1, 2))}),
        (StructureError, r"the wanted nodes have shape \(5, 3\)", {"near": np.arange(15.0).reshape(5, 3)}),
        (StructureError, "bar 0 from node 0 to node 3 has length 0 m", {"near": np.zeros((6, 3))}),
        (StructureError, "near and z_d or z_e were given", {"near": np.eye(6)[:, :3], "z_e": np.ones((1, 3))}),
        (StructureError, r"loads have shape \(2, 3\); one row", {"loads": np.ones((2, 3))}),
        (StructureError, "load 0 acts on node 9", {"loads": np.ones((1, 3)), "load_nodes": np.array([9])}),
        (StructureError, "loads hold a value that is not finite", {"loads": np.full((6, 3), np.inf)}),
    ],
)
def test_bad_input_is_named(error, sentence, given_):
    with pytest.raises(error, match=sentence):
        five_steps(PRISM, **({"gamma": HOLDING, "lam": ROOT3} | given_))


def test_networks_in_pieces_are_refused():
    with pytest.raises(StructureError, match="falls into 2 pieces"):
        five_steps(Network.build(4, [(0, 1)], [(2, 3)]), 1.0, 1.0)


def test_definition_16_is_what_verify_checks():
    steps = five_steps(PRISM, HOLDING, ROOT3, near=tc.prism(3).nodes)
    steps.verify(1e-14)
    good = steps.configuration
    for field, sentence in (
        ("t", r"t = gamma s, f = lambda b \(13\)"),
        ("f", r"t = gamma s, f = lambda b \(13\)"),
        ("s", r"\(13\)|\(19\)"),
        ("b", r"\(13\)|\(19\)"),
        ("p", r"members join the nodes \(19\)"),
    ):
        changed = getattr(good, field).copy()
        changed[1, 0] += 1e-3
        with pytest.raises(EquilibriumError, match=sentence):
            replace(good, **{field: changed}).verify()
    moved = good.p.copy()
    moved[0, 2] += 1e-3
    with pytest.raises(EquilibriumError, match=r"forces balance at every node \(23\)"):
        Configuration.at(PRISM, moved, good.gamma, good.lam).verify()
    for field in ("gamma", "lam"):
        with pytest.raises(EquilibriumError, match="Definition 16 wants every"):
            replace(good, **{field: -getattr(good, field)}).verify()
    with pytest.raises(EquilibriumError, match="b = V_B1 q1: false"):
        replace(steps, q=steps.q + 1e-3 * np.eye(6, 3)).verify()


def test_bars_that_pull_are_refused_unless_allowed():
    loads = np.random.default_rng(1).normal(size=(6, 3))
    steps = five_steps(PRISM, 1.0, -1.0, loads=loads - loads.mean(axis=0))
    steps.verify(1e-13, bars_may_pull=True)
    with pytest.raises(EquilibriumError, match="lambda of bar 0 is -1"):
        steps.verify()


# Invariance


@given(structures, seeds)
def test_direction_and_order_of_members_and_nodes_do_not_matter(network, seed):
    rng = np.random.default_rng(seed)
    gamma, lam = coefficients_of(network, rng)
    p = rng.normal(size=(network.n_p, 3))
    loads = -sum_of_forces(network, p, gamma, lam)
    P = theorem11(network)
    kept = lemma19(lemma18(lemma17(network, P), gamma), P, lam).rank
    assume(kept.decided and kept.smallest_kept > 1e-3 * kept.scale)
    name = rng.permutation(network.n_p)  # old node -> new node
    of_b, of_s = rng.permutation(network.n_b), rng.permutation(network.n_s)
    flip = lambda pairs: np.where(rng.integers(0, 2, (len(pairs), 1)) == 1, pairs[:, ::-1], pairs)  # noqa: E731
    other = Network.build(network.n_p, flip(name[network.bars])[of_b], flip(name[network.strings])[of_s])
    moved = np.empty_like(loads)
    moved[name] = loads
    one = five_steps(network, gamma, lam, loads=loads, near=p)
    two = five_steps(other, gamma[of_s], lam[of_b], loads=moved, near=p[np.argsort(name)])
    assert two.p[name] == pytest.approx(one.p, abs=1e-9)
    assert np.linalg.norm(two.t, axis=1) == pytest.approx(np.linalg.norm(one.t[of_s], axis=1), abs=1e-9)
    assert np.linalg.norm(two.f, axis=1) == pytest.approx(np.linalg.norm(one.f[of_b], axis=1), abs=1e-9)
    ratios = admissible_ratios(network, gamma=gamma, lam=lam)
    again = admissible_ratios(other, gamma=gamma[of_s], lam=lam[of_b])
    assert again.eigenvalues == pytest.approx(ratios.eigenvalues, abs=1e-11)


@pytest.mark.parametrize("transform", [corollary13, corollary14, forest_transformation])
def test_transformations_agree(transform, rng):
    gamma, lam = coefficients_of(PRISM, rng)
    loads = rng.normal(size=(6, 3))
    loads -= loads.mean(axis=0)
    one = five_steps(PRISM, gamma, lam, loads=loads)
    two = five_steps(PRISM, gamma, lam, loads=loads, transformation=transform(PRISM))
    centred = [steps.p - steps.p.mean(axis=0) for steps in (one, two)]
    assert centred[0] == pytest.approx(centred[1], abs=1e-12)
    assert two.t == pytest.approx(one.t, abs=1e-12)
    eigenvalues = [
        admissible_ratios(PRISM, gamma=gamma, transformation=P).eigenvalues for P in (None, transform(PRISM))
    ]
    assert eigenvalues[0] == pytest.approx(eigenvalues[1], abs=1e-13)


def test_units_do_not_matter(rng):
    loads = rng.normal(size=(6, 3))
    loads -= loads.mean(axis=0)
    one = five_steps(PRISM, HOLDING, 1.0, loads=loads)
    two = five_steps(PRISM, 1e9 * HOLDING, 1e9, loads=1e6 * loads)
    assert two.p == pytest.approx(1e-3 * one.p, rel=1e-10, abs=1e-15)
    assert two.rank_Y.gap == pytest.approx(one.rank_Y.gap, rel=0.5)


# Exact arithmetic


def exact_X(network, gamma):
    """X of (70) in rational numbers: clusters' places eliminated from the force densities, class 1, Corollary 14."""
    P = corollary14(network).P.astype(int)
    S = (P @ network.C_s.toarray()).tolist()
    n_b, n_p = network.n_b, network.n_p
    dot = lambda x, y: sum((g * a * b for g, a, b in zip(gamma, x, y, strict=True)), Fraction(0))  # noqa: E731
    K = [[dot(x, y) for y in S] for x in S]
    for k in range(n_p - 1, n_b, -1):  # the first cluster stays: translation
        for i in range(k):
            factor = K[i][k] / K[k][k]
            K[i] = [a - factor * b for a, b in zip(K[i], K[k], strict=True)]
    return np.array([[float(K[i][j]) for j in range(n_b)] for i in range(n_b)])


@pytest.mark.parametrize("spread", [1, 1e4, 1e8, 1e12])
@pytest.mark.parametrize("network", [PRISM, Network.of(tc.shell(3, 1))], ids=["prism", "shell"])
def test_rounding_in_x_is_within_what_is_reported(network, spread, rng):
    for _ in range(10):
        gamma = spread ** rng.uniform(-0.5, 0.5, network.n_s)
        P = corollary14(network)
        forces = lemma18(lemma17(network, P), gamma)
        exact = exact_X(network, [Fraction(float(g)) for g in gamma])
        reported = lemma19(forces, P, 1.0).rank.rounding
        error = np.linalg.norm(forces.X - exact, 2)
        assert error <= reported
        assert error <= 1e-12 * np.linalg.norm(exact, 2)


@given(structures, seeds)
def test_what_is_computed_is_what_the_paper_writes(network, seed):
    """X, T, L and G1 by V2 and M of (67), (70), (76), (79)."""
    rng = np.random.default_rng(seed)
    gamma, _ = coefficients_of(network, rng)
    P = theorem11(network)
    forces = lemma18(lemma17(network, P), gamma)
    space, terms = forces.space, theorem22(forces, P, rng.normal(size=(network.n_p, 3)))
    F = space.V2 @ np.linalg.inv(forces.M) @ space.V2.T
    pinv = space.U1 / space.sigma @ space.V1.T
    assert pytest.approx(F @ space.S1.T, abs=1e-12) == forces.T
    assert pytest.approx(space.S1 @ F @ space.S1.T, abs=1e-12) == forces.X
    assert pytest.approx(pinv @ (F / gamma[:, None] - np.eye(network.n_s)) @ space.S1.T, abs=1e-11) == forces.L
    G1 = (np.eye(network.n_s) - F / gamma) @ (pinv.T @ terms.D2)
    assert pytest.approx(G1, abs=1e-11) == terms.G1
    assert terms.places == pytest.approx(pinv @ (G1 / gamma[:, None]), abs=1e-11)
    assert space.places(forces.T / gamma[:, None], np.eye(P.rho_B)) == pytest.approx(forces.L, abs=1e-11)  # (66)


def test_g1_is_the_tension_of_clusters_held_at_zero(rng):
    """Theorem 22 (i) by direct physics: with q1 = 0 the strings alone carry the load to the clusters."""
    gamma, _ = coefficients_of(LOOPED, rng)
    P = theorem11(LOOPED)
    forces = lemma18(lemma17(LOOPED, P), gamma)
    w = rng.normal(size=(6, 3))
    w -= w.mean(axis=0)
    terms = theorem22(forces, P, w)
    t = terms.G1 @ w
    assert forces.space.S2 @ t == pytest.approx(terms.D2 @ w, abs=1e-13)  # (60)
    assert forces.space.misfit(t / gamma[:, None], np.zeros((5, 3))) == pytest.approx(0, abs=1e-13)  # (65)


def test_a_sheet_of_strings_with_free_nodes_and_bars_that_meet():
    """Class 3, a node without bar, planar."""
    network = Network.build(5, [(0, 1), (0, 2), (0, 3)], [(1, 2), (2, 3), (3, 1), (1, 4), (2, 4), (3, 4)])
    ratios = admissible_ratios(network)
    assert ratios.filling(2) == pytest.approx([4.0])
    steps = five_steps(network, 1.0, ratios.filling(2)[0], d=2)
    steps.verify(1e-13)
    assert steps.p.shape == (5, 2)
    assert imbalance(steps) < 1e-14


@pytest.mark.parametrize(("m", "cls", "class_k"), [(1, 1, 1), (2, 2, 2)])
def test_shells_found_by_energy_are_among_the_shapes(m, cls, class_k):
    """Another method's equilibrium: its coefficients make Y singular three times, its nodes are one of the shapes."""
    scene = tc.Scene(
        structure={"kind": "shell", "n": 3, "m": m, "class": cls}, tendons={"stiffness": 100.0, "rest_ratio": 0.8}
    )
    found = tc.find_equilibrium(scene)
    network = Network.of(found.structure)
    assert network.class_k == class_k
    gamma = found.force_densities
    pull = sum_of_forces(network, found.nodes, gamma, np.zeros(network.n_b))
    push = network.C_b.toarray()[:, :, None] * (network.C_b.T @ found.nodes)
    lam = np.linalg.lstsq(push.transpose(0, 2, 1).reshape(-1, network.n_b), -pull.ravel(), rcond=None)[0]
    steps = five_steps(network, gamma, lam, near=found.nodes, rank_tol=1e-10)
    steps.verify(1e-11)
    assert (steps.rank_Y.nullity, steps.rank_Y.decided) == (3, True)
    assert steps.p == pytest.approx(found.nodes, abs=1e-10)
