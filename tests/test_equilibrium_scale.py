"""Equilibria of any size: sparse = dense, a sector = the whole, signs of pivots = eigenvalues, honest verdicts."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from support import network_scene, pendulum_scene, prism_scene, replaced, rotation, shell_scene, taylor_order

import tensctl as tc
from tensctl.elements import Potential
from tensctl.statics import settle
from tensctl.statics.definiteness import Definiteness, at_worst, definiteness
from tensctl.statics.factor import Factor
from tensctl.statics.harmonics import harmonic_smallest
from tensctl.statics.lowest import lowest_modes
from tensctl.statics.newton import Newton, Whole, orthonormal
from tensctl.statics.rigid import unseen_motions
from tensctl.statics.sector import Sector
from tensctl.statics.stability import spectrum, whole_definiteness
from tensctl.statics.symmetry import find_symmetry
from tensctl.statics.trust_region import dense_model, grounded, krylov_model

YES, NO, UNDECIDED = tc.Stability.YES, tc.Stability.NO, tc.Stability.UNDECIDED
LARGE = {"overlap": 0.15}
PUSH = {"P4_1_2": [0.8, -0.5, -1.0]}


def potential_of(*size, **given):
    return Potential.of(shell_scene(*size, **given))


def random_symmetric(rng, size, negative, hermitian=False):
    """A sparse matrix with a known number of negative eigenvalues."""
    A = rng.standard_normal((size, size)) + (1j * rng.standard_normal((size, size)) if hermitian else 0)
    Q = np.linalg.qr(A)[0]
    values = np.where(np.arange(size) < negative, -1.0, 1.0) * rng.uniform(0.5, 2.0, size)
    H = Q @ (values[:, None] * Q.conj().T)
    return sp.csr_array(0.5 * (H + H.conj().T))


class TestFactor:
    @pytest.mark.parametrize("hermitian", [False, True])
    @pytest.mark.parametrize("negative", [0, 1, 7, 30])
    def test_signs_of_pivots_count_eigenvalues(self, rng, negative, hermitian):
        H = random_symmetric(rng, 30, negative, hermitian)
        factor = Factor.of(H)
        assert factor.negative == negative
        x = rng.standard_normal(30)
        assert np.abs(factor.solve(H @ x) - x).max() < 1e-9

    def test_zero_pivot_is_nudged(self):
        """[[0, 1], [1, 0]] has no factor along its diagonal; its eigenvalues are +1 and -1."""
        assert Factor.of(sp.csr_array(np.array([[0.0, 1.0], [1.0, 0.0]]))).negative == 1

    def test_not_finite_is_named(self):
        with pytest.raises(tc.EquilibriumError, match="not finite"):
            Factor.of(sp.csr_array(np.array([[np.nan]])))

    def test_grounding_keeps_signs_and_solution(self, rng):
        potential = potential_of(4, 2)
        rest = settle(potential)
        held = orthonormal(unseen_motions(potential, rest.nodes).basis)
        H = rest.point.hessian
        values = np.linalg.eigvalsh(H.toarray())
        assert Factor.of(grounded(H, held)).negative == (values < -1e-9 * values[-1]).sum() == 0
        right = H @ rng.standard_normal(len(held))
        assert np.abs(H @ Factor.of(grounded(H, held)).solve(right) - right).max() < 1e-9 * np.abs(right).max()


class TestModels:
    @pytest.mark.parametrize("moved", [0.0, 0.1])
    def test_krylov_steps_are_those_of_all_eigenvectors(self, rng, moved):
        """Within a few per cent at the start, where H is indefinite; the Newton step itself near a rest."""
        potential = potential_of(6, 3, pins=["P1_*_1"])
        manifold = potential.manifold
        nodes = manifold.retract(potential.structure.nodes, moved * rng.standard_normal(manifold.size))
        point = potential.at(nodes)
        held = np.zeros((manifold.size, 0))
        dense, krylov = (build(point.hessian, point.gradient, held) for build in (dense_model, krylov_model))
        assert (dense.curvature < 0).any()
        for radius in (0.01, 0.1):
            (a, promised), (b, found) = dense.step(radius), krylov.step(radius)
            assert np.linalg.norm(a - b) < 0.2 * np.linalg.norm(a)
            assert found == pytest.approx(promised, rel=0.05)

    def test_newton_step_near_a_rest(self, rng):
        potential = potential_of(6, 3)
        rest = settle(potential)
        manifold = potential.manifold
        point = potential.at(manifold.retract(rest.nodes, 1e-4 * rng.standard_normal(manifold.size)))
        held = orthonormal(unseen_motions(potential, point.nodes).basis)
        (a, _), (b, _) = (m(point.hessian, point.gradient, held).step(1.0) for m in (dense_model, krylov_model))
        assert np.linalg.norm(a - b) < 1e-3 * np.linalg.norm(a)

    @settings(max_examples=20)
    @given(seed=st.integers(0, 10**6), radius=st.floats(1e-4, 1.0))
    def test_steps_stay_inside_and_go_down(self, seed, radius):
        rng = np.random.default_rng(seed)
        H, g = random_symmetric(rng, 20, 5), rng.standard_normal(20)
        for build in (dense_model, krylov_model):
            step, promised = build(H, g, np.zeros((20, 0))).step(radius)
            assert np.linalg.norm(step) <= 1.01 * radius * np.sqrt(20)
            assert promised > 0
            assert g @ step < 0


class TestSparse:
    """The sparse way on the whole structure, with the symmetry left aside."""

    def test_few_steps_at_2000_degrees_of_freedom(self):
        rest = settle(potential_of(20, 10, **LARGE), symmetric=False)
        assert rest.iterations <= 10
        assert rest.residual < 1e-12
        assert rest.tensions.min() > 0
        assert rest.stable is YES
        assert rest.way == "whole structure"

    @pytest.mark.parametrize("pins", [(), ("P1_*_1",)], ids=["free", "pinned"])
    def test_sparse_is_dense(self, pins, monkeypatch):
        potential = potential_of(6, 3, pins=pins)
        sparse = settle(potential, symmetric=False)
        monkeypatch.setattr("tensctl.statics.newton._DENSE", 10**6)
        dense = settle(potential, symmetric=False)
        assert sparse.energy == pytest.approx(dense.energy, rel=1e-13)
        assert np.abs(sparse.tensions - dense.tensions).max() < 1e-10 * dense.tensions.max()
        assert abs(sparse.iterations - dense.iterations) <= 2

    def test_more_modes_than_asked_for_are_not_computed(self, monkeypatch):
        rest = settle(potential_of(6, 3))
        complete = rest.spectrum
        assert complete.complete
        monkeypatch.setattr("tensctl.statics.stability.ALL_MODES", 100)
        few = spectrum(rest.point)
        assert not few.complete
        assert few.omega2.size == 20
        assert np.abs(few.omega2[6:] - complete.omega2[6:20]).max() < 1e-9 * complete.omega2.max()
        mass = rest.potential.manifold.mass(rest.potential.members.mass)
        assert np.abs(few.shapes.T @ (mass[:, None] * few.shapes) - np.eye(20)).max() < 1e-9

    def test_lowest_modes_of_an_unstable_rest(self):
        """The most negative eigenvalue comes first, not the one nearest to zero; all at once or by Lanczos."""
        rest = tc.find_equilibrium(pendulum_scene(anchor=(-1.5, 0, 0)))
        assert spectrum(rest.point, 1).omega2[0] == pytest.approx(-90.0, rel=1e-12)

    @pytest.mark.parametrize("hermitian", [False, True])
    def test_lanczos_finds_the_lowest_eigenvalues(self, rng, hermitian):
        H = random_symmetric(rng, 200, 3, hermitian)
        every, vectors = np.linalg.eigh(H.toarray())
        held = vectors[:, [0, 150]]
        A = sp.csr_array(H - held @ (np.diag(every[[0, 150]]) @ held.conj().T))
        found, modes = lowest_modes(A, held, 5, 1e-12)
        assert np.abs(found - every[1:6]).max() < 1e-10
        assert np.abs(A @ modes - modes * found).max() < 1e-8
        assert np.abs(held.conj().T @ modes).max() < 1e-10


class TestSymmetry:
    @pytest.mark.parametrize(("n", "m"), [(3, 1), (4, 2), (5, 3), (12, 2)])
    def test_shells_have_n_sectors(self, n, m):
        symmetry = find_symmetry(potential_of(n, m))
        assert symmetry is not None
        assert symmetry.order == n
        assert symmetry.mismatch < 1e-14
        assert np.array_equal(np.sort(symmetry.nodes, axis=None), np.arange(4 * n * m))
        assert symmetry.deviation(potential_of(n, m).structure.nodes) < 1e-14

    @settings(max_examples=10)
    @given(seed=st.integers(0, 10**6))
    def test_found_in_any_position_and_order(self, seed):
        rng = np.random.default_rng(seed)
        recipe = tc.shell(5, 2).as_recipe()
        nodes = np.array(list(recipe["nodes"].values())) @ rotation(rng).T + rng.uniform(-3, 3, 3)
        names = list(recipe["nodes"])
        order = rng.permutation(len(names))
        recipe["nodes"] = {names[k]: nodes[k].tolist() for k in order}
        for key in ("rods", "tendons"):
            items = [(label, ends[:: rng.choice([-1, 1])]) for label, ends in recipe[key].items()]
            rng.shuffle(items)
            recipe[key] = dict(items)
        symmetry = find_symmetry(Potential.of(tc.Scene(structure=recipe)))
        assert symmetry is not None
        assert symmetry.order == 5

    @pytest.mark.parametrize(
        "given",
        [
            {"loads": {"P4_1_1": [0, 0, 1.0], "P1_1_1": [0, 0, -1.0]}},
            {"loads": {"P4_*_1": [1.0, 0, 0], "P1_*_1": [-1.0, 0, 0]}},
            {"pins": ["P1_1_1"]},
            {"tendons": {"stiffness": {"*": 100.0, "t5_2_1": 100.1}}},
            {"tendons": {"rest_ratio": {"*": 0.8, "t5_2_1": 0.8001}}},
            {"rods": {"mass": {"*": 1.0, "r1_1_1": 1.1}}},
            {"gravity": {"g": [1.0, 0.0, 0.0]}, "pins": ["P1_*_1"]},
        ],
        ids=["one load", "loads across", "one pin", "stiffness", "rest length", "mass", "weight across"],
    )
    def test_what_breaks_it(self, given):
        assert find_symmetry(potential_of(4, 1, **given)) is None

    def test_materials_may_alternate(self):
        """Every second element softer: the order is half of n."""
        soft = {f"t5_{i}_1": 80.0 for i in (1, 3, 5)}
        symmetry = find_symmetry(potential_of(6, 1, tendons={"stiffness": {"*": 100.0} | soft}))
        assert symmetry is not None
        assert symmetry.order == 3

    @pytest.mark.parametrize(
        ("given", "size"),
        [
            ({}, (4, 2)),
            ({"pins": ["P1_*_1"]}, (5, 2)),
            ({"pins": ["P1_*_1"], "gravity": {"g": 9.8}, "tendons": {"stiffness": 2000.0}}, (4, 2)),
            ({"loads": {"P4_*_2": [0, 0, 1.0], "P1_*_1": [0, 0, -1.0]}}, (4, 2)),
            ({"tendons": {"EA": 100.0}}, (6, 2)),
        ],
        ids=["free", "pinned", "weight", "pulled", "strain law"],
    )
    def test_one_sector_gives_the_answer_of_the_whole(self, given, size):
        potential = potential_of(*size, **given)
        sector, whole = settle(potential), settle(potential, symmetric=False)
        assert sector.way.startswith(f"one of {size[0]} sectors")
        assert sector.residual < 1e-12
        assert sector.energy == pytest.approx(whole.energy, rel=1e-12)
        assert np.abs(sector.tensions - whole.tensions).max() < 1e-9 * whole.tensions.max()
        assert sector.stable is whole.stable is YES
        assert sector._sector is not None
        block, _ = harmonic_smallest(sector._sector, sector.tolerance)
        assert block == pytest.approx(whole.smallest, rel=1e-8)
        sector.verify(1e-12)

    def test_blocks_have_the_eigenvalues_of_the_whole(self):
        rest = settle(potential_of(5, 2))
        assert rest._sector is not None
        blocks = [np.linalg.eigvalsh(rest._sector.harmonic(k).toarray()) for k in range(5)]
        whole = np.linalg.eigvalsh(rest.point.hessian.toarray())
        assert np.abs(np.sort(np.concatenate(blocks)) - whole).max() < 1e-11 * whole[-1]

    def test_counts_of_an_unstable_rest(self):
        """Standing rods on pins, slack: every rod falls in two directions, whatever harmonic it is counted in."""
        nodes = {}
        rods, tendons = {}, {}
        for i in range(4):
            x, y = np.cos(np.pi * i / 2), np.sin(np.pi * i / 2)
            nodes |= {f"a{i}": [x, y, 0], f"b{i}": [x, y, 1]}
            rods[f"r{i}"] = [f"a{i}", f"b{i}"]
            tendons[f"t{i}"] = [f"b{i}", f"b{(i + 1) % 4}"]
        scene = network_scene(
            nodes, rods, tendons, [f"a{i}" for i in range(4)], tendons={"rest_ratio": 2.0}, gravity={"g": 9.8}
        )
        potential = Potential.of(scene)
        symmetry = find_symmetry(potential)
        assert symmetry is not None
        assert symmetry.order == 4
        rest = replaced(settle(potential), symmetry=symmetry)
        assert rest._sector is not None
        assert rest.definiteness.negative == replaced(rest, symmetry=None).definiteness.negative == 8
        assert rest.stable is NO

    def test_gradient_and_hessian_of_a_sector(self, rng):
        potential = potential_of(4, 2)
        symmetry = find_symmetry(potential)
        assert symmetry is not None
        sector = Sector.of(potential, symmetry, potential.members.rest_lengths)
        origin = sector.at(sector.start)
        way = 0.05 * rng.standard_normal(sector.manifold.size)

        def left(h):
            moved = sector.at(sector.retract(sector.start, h * way))
            quadratic = h * (origin.gradient @ way) + 0.5 * h**2 * (way @ (origin.hessian @ way))
            return moved.energy - origin.energy - quadratic

        assert taylor_order(left, np.array([0.2, 0.1, 0.05])) > 2.8
        whole = potential.at(symmetry.expand(sector.start))
        assert origin.energy * 4 == pytest.approx(whole.energy, rel=1e-13)

    def test_nearly_symmetric_is_balanced_as_it_is(self):
        """Nodes given with nine digits: found in a sector, polished on the structure as given."""
        recipe = tc.shell(6, 2).as_recipe()
        recipe["nodes"] = {key: np.round(p, 10).tolist() for key, p in recipe["nodes"].items()}
        rest = tc.find_equilibrium(tc.Scene(structure=recipe))
        assert rest.symmetry is not None
        assert rest.symmetry.mismatch > 1e-12
        assert rest.residual < 1e-12
        rest.verify(1e-12)

    def test_moved_nodes_are_judged_as_they_are(self, rng):
        """An equilibrium with other nodes does not use a symmetry that these have not."""
        rest = settle(potential_of(4, 2))
        shift = 1e-3 * rng.standard_normal(rest.potential.manifold.size)
        moved = replaced(rest, nodes=rest.potential.manifold.retract(rest.nodes, shift))
        assert moved._sector is None

    def test_loads_without_symmetry_start_from_the_symmetric_rest(self):
        potential = potential_of(6, 2, pins=["P1_*_1"], loads=PUSH)
        one, other = settle(potential), settle(potential, symmetric=False)
        assert one.symmetry is None
        assert one.residual < 1e-12
        assert np.abs(one.nodes - other.nodes).max() < 1e-9
        assert one.stable is YES


def _whole_counts(point, force):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tensctl.statics.stability.unknown_force", lambda _: force)
        return whole_definiteness(point)


class TestDefiniteness:
    @settings(max_examples=20)
    @given(seed=st.integers(0, 10**6), spread=st.floats(0, 12))
    def test_grading_does_not_matter(self, seed, spread):
        """D H D has the signs of H for any diagonal D, over 24 orders of magnitude."""
        rng = np.random.default_rng(seed)
        H = random_symmetric(rng, 12, 3).toarray()
        D = 10.0 ** rng.uniform(-spread, spread, 12)
        graded = sp.csr_array(D[:, None] * H * D)
        zero = np.zeros(12)
        counts = definiteness(graded, zero, zero, np.zeros((12, 0)))
        assert (counts.negative, counts.undecided) == (3, 0)

    def test_zero_is_undecided(self, rng):
        Q = np.linalg.qr(rng.standard_normal((8, 8)))[0]
        H = sp.csr_array(Q @ np.diag([-1, -1, 0, 0, 0, 1, 2, 3.0]) @ Q.T)
        zero = np.zeros(8)
        counts = definiteness(H, zero, zero, np.zeros((8, 0)))
        assert (counts.negative, counts.undecided) == (2, 3)
        held = definiteness(H, zero, zero, Q[:, 2:4])
        assert (held.negative, held.undecided) == (2, 1)

    def test_taut_or_slack_the_verdict_has_to_hold(self):
        taut, slack = Definiteness(1, 0, 1e-14), Definiteness(3, 1, 1e-14)
        assert at_worst(taut, slack) == Definiteness(1, 3, 1e-14)
        assert at_worst(taut, taut) == taut

    def test_a_tie_within_rounding_of_slack_holds_nothing_for_sure(self):
        """A rod whose only hold across is a tie with a tension of 1e-9 of the largest, at a rest known to 1e-8."""
        nodes = {"o": [0, 0, 0], "head": [1, 0, 0], "far": [-1, 0, 0], "side": [1, 1, 0], "other": [1, -1, 0]}
        ties = {"pull": ["head", "far"], "a": ["head", "side"], "b": ["head", "other"]}
        lengths = {"pull": 1.9, "a": 1 - 1e-9, "b": 1 - 1e-9}
        scene = network_scene(nodes, {"rod": ["o", "head"]}, ties, ["o", "far", "side", "other"])
        potential = Potential.of(scene.replaced(tendons={"rest_length": lengths}))
        point = potential.at(potential.structure.nodes)
        sure, unsure = (_whole_counts(point, force) for force in (1e-12, 1e-6))
        assert sure.negative == 1  # down, out of the plane of the ties; across they hold with their stiffness
        assert sure.undecided == 0
        assert unsure.negative + unsure.undecided == 2

    def test_tied_by_a_node_only(self):
        """A long rod that hangs with one end in a prism swings for nothing: neither stable nor unstable."""
        for length in (1.0, 100.0, 1e4):
            recipe = tc.prism(3).as_recipe()
            recipe["nodes"] |= {"c": [0, 0, -2.0], "d": [0, 0, -2.0 - length]}
            recipe["rods"]["long"] = ["c", "d"]
            recipe["tendons"] |= {f"x{i}": ["c", f"a{i}"] for i in (1, 2, 3)}
            assert tc.find_equilibrium(tc.Scene(structure=recipe)).stable is UNDECIDED


def mast_hung_from(length):
    """The (3,1) mast on its base, tied by its top to the foot of a rod that hangs from a pin above."""
    recipe = tc.shell(3, 1, pins=["P1_*_1"]).as_recipe()
    top = max(p[2] for p in recipe["nodes"].values())
    recipe["nodes"] |= {"foot": [0, 0, top + 0.5], "far": [0, 0, top + 0.5 + length]}
    recipe["rods"]["long"] = ["foot", "far"]
    recipe["pins"] = [*recipe["pins"], "far"]
    recipe["tendons"] |= {f"x{i}": ["foot", f"P4_{i}_1"] for i in (1, 2, 3)}
    return tc.Scene(structure=recipe)


def close_pair(gap):
    """A prism with a rod whose end is a gap away from one of its nodes, and tied to it."""
    recipe = tc.prism(3).as_recipe()
    x, y, z = recipe["nodes"]["b1"]
    recipe["nodes"] |= {"e": [x + gap, y, z], "f": [x + 1.0, y, z + 1.0]}
    recipe["rods"]["x"] = ["e", "f"]
    recipe["tendons"] |= {f"y{i}": ["e", f"b{i}"] for i in (1, 2, 3)} | {f"z{i}": ["f", f"b{i}"] for i in (1, 2, 3)}
    return tc.Scene(structure=recipe, tendons={"rest_length": {"*": 0.8, "y1": 0.5 * gap}})


class TestExtremes:
    @pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6, 1e9, 1e12])
    @pytest.mark.parametrize("which", ["t5_*", "t5_1_1"])
    def test_stiffness_ratio(self, ratio, which):
        """The stiffer, the nearer to a tendon that does not stretch; the rest converges like 1/ratio."""
        scene = shell_scene(pins=["P1_*_1"], tendons={"stiffness": {"*": 100.0, which: 100.0 * ratio}})
        rest = tc.find_equilibrium(scene)
        assert rest.iterations <= 60
        assert rest.residual <= max(1e-12, 10 * rest.attainable)
        assert rest.stable is YES
        stiff = [label.startswith(which.rstrip("*")) for label in rest.structure.tendon_labels]
        stretch = (rest.lengths - rest.rest_lengths)[stiff]
        assert np.abs(stretch).max() < 10 / ratio + 1e-15

    @pytest.mark.parametrize("part", [1e-9, 1e-7, 1e-5, 1e-3, 0.1, 0.5, 0.99])
    def test_prestress_of_a_first_order_mechanism(self, part):
        """The prism's mechanism is held by prestress alone: omega^2 grows with it; its sign is known to 1e-9 k l."""
        rest = tc.find_equilibrium(prism_scene(tendons={"rest_ratio": 1 - part}))
        assert rest.stable is YES
        assert rest.residual <= max(1e-12, 10 * rest.attainable)
        if part <= 1e-3:
            weak = tc.find_equilibrium(prism_scene(tendons={"rest_ratio": 1 - 1e-3})).smallest
            assert rest.smallest == pytest.approx(weak * part / 1e-3, rel=2e-3)

    @pytest.mark.parametrize("length", [1.0, 1e3, 1e6])
    def test_one_long_rod(self, length):
        rest = tc.find_equilibrium(mast_hung_from(length))
        assert rest.residual < 1e-12
        assert rest.stable is YES

    @pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-12])
    def test_nearly_coincident_nodes(self, gap):
        rest = tc.find_equilibrium(close_pair(gap))
        assert rest.residual < 1e-12
        assert rest.stable is YES

    @pytest.mark.parametrize("sign", [1, -1])
    def test_nearly_slack_tendon(self, sign):
        """A tendon at its rest length to 1e-13: taut or slack, the others hold the mast."""
        base = tc.find_equilibrium(shell_scene(pins=["P1_*_1"], tendons={"rest_ratio": {"*": 0.8, "t5_1_1": 2.0}}))
        k = base.structure.tendon_labels.index("t5_1_1")
        lengths = dict(zip(base.structure.tendon_labels, base.rest_lengths.tolist(), strict=True))
        lengths["t5_1_1"] = float(base.lengths[k] * (1 - sign * 1e-13))
        rest = tc.find_equilibrium(shell_scene(pins=["P1_*_1"], tendons={"rest_length": lengths}))
        assert np.abs(rest.nodes - base.nodes).max() < 1e-11
        assert rest.stable is YES

    def test_load_that_takes_half_of_the_tendons_slack(self):
        """A standing rod stayed on four sides and pushed into a corner hangs on the two stays behind it."""
        nodes = {"foot": [0, 0, 0], "head": [0, 0, 2.0]}
        nodes |= {f"g{k}": [3 * np.cos(k * np.pi / 2), 3 * np.sin(k * np.pi / 2), 0] for k in range(4)}
        ties = {f"s{k}": ["head", f"g{k}"] for k in range(4)}
        scene = network_scene(
            nodes, {"mast": ["foot", "head"]}, ties, ["foot", "g*"], loads={"head": [200.0, 200.0, 0]}
        )
        rest = tc.find_equilibrium(scene)
        assert (rest.tensions > 0).tolist() == [False, False, True, True]
        assert rest.residual < 1e-12
        assert rest.stable is YES

    def test_load_that_squashes_the_mast(self):
        rest = tc.find_equilibrium(shell_scene(pins=["P1_*_1"], loads={"P4_*_1": [0, 0, -100.0]}))
        assert (rest.tensions == 0).sum() == 9
        assert rest.residual < 1e-12
        assert rest.stable is YES

    def test_nothing_that_can_be_stable(self):
        assert tc.find_equilibrium(pendulum_scene(anchor=(-1.5, 0, 0))).stable is NO
        slack = {"rest_ratio": 2.0}
        assert tc.find_equilibrium(pendulum_scene((0, 0, 2), tendons=slack, gravity={"g": 9.8})).stable is NO
        floating = tc.find_equilibrium(shell_scene(tendons={"rest_ratio": {"*": 2.0, "t5_1_1": 0.9}}))
        assert floating.stable in (UNDECIDED, tc.Stability.NO_PRESTRESS)

    def test_a_hanging_load_is_stable_only_below_its_pin(self):
        """A rod with a load at its end, at any attitude of the same energy to first order."""
        for z, verdict in ((-1, YES), (1, NO)):
            scene = pendulum_scene((0, 0, z), tendons={"rest_ratio": 3.0}, loads={"head": [0, 0, -5.0]})
            assert tc.find_equilibrium(scene).stable is verdict


class TestBadInput:
    def test_parts_that_nothing_joins(self):
        recipe = tc.prism(3).as_recipe()
        other = {f"q{name}": [x + 9, y, z] for name, (x, y, z) in recipe["nodes"].items()}
        for key in ("rods", "tendons"):
            recipe[key] |= {f"q{label}": [f"q{a}" for a in ends] for label, ends in recipe[key].items()}
        recipe["nodes"] |= other
        with pytest.raises(tc.EquilibriumError, match="falls into 2 parts that nothing joins: one is qa1, qa2, qa3"):
            tc.find_equilibrium(tc.Scene(structure=recipe))

    def test_the_ground_joins(self):
        """Two rods, each on its own pin and tied to the ground, are one structure."""
        nodes = {
            f"{k}{i}": p for i in (1, 2) for k, p in (("o", [0, 3 * i, 0]), ("h", [1, 3 * i, 0]), ("a", [3, 3 * i, 0]))
        }
        rods, ties = {f"r{i}": [f"o{i}", f"h{i}"] for i in (1, 2)}, {f"t{i}": [f"h{i}", f"a{i}"] for i in (1, 2)}
        assert tc.find_equilibrium(network_scene(nodes, rods, ties, ["o*", "a*"])).stable is YES

    def test_loads_that_nothing_takes(self):
        scene = shell_scene(loads={"P4_1_1": [0, 2.0, 1.0], "P4_2_1": [0, 0, 1.0]})
        with pytest.raises(
            tc.EquilibriumError, match=r"a force of \[0, 2, 2\] N and a moment of .* N m about the mass"
        ):
            tc.find_equilibrium(scene)

    def test_loads_that_only_turn_end_balanced(self):
        """A couple turns a free structure until its two loads are in line, or says what is left."""
        scene = shell_scene(loads={"P4_1_1": [1.0, 0, 0], "P1_1_1": [-1.0, 0, 0]}, tendons={"stiffness": 1000.0})
        rest = tc.find_equilibrium(scene)
        labels = rest.structure.node_labels
        arm = rest.nodes[labels.index("P4_1_1")] - rest.nodes[labels.index("P1_1_1")]
        assert np.abs(np.cross(arm, [1.0, 0, 0])).max() < 1e-9
        assert rest.stable is YES
        assert rest.spectrum.rigid_count == 4

    def test_newton_on_its_own_is_what_the_search_uses(self):
        potential = potential_of(4, 1)
        rest = potential.members.rest_lengths
        point, steps = Newton().minimise(potential, potential.structure.nodes, rest)
        assert Whole(potential, rest).residual(point) < 1e-12
        assert steps <= 8
