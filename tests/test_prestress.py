"""Prestress at given nodes: bases span what they claim, optima are optima, and verdicts tell the truth."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from support import pendulum_scene, replaced, rotation, shell_scene, taylor_order

import tensctl as tc
from tensctl.elements import Potential
from tensctl.statics import settle
from tensctl.statics.inverse import inverse_statics
from tensctl.statics.prestress import (
    admissible_prestress,
    cyclic_orbits,
    equilibrium_matrix,
    prestress_levels,
    rod_motions,
    second_variation,
    self_stress,
    stability_orders,
    stress_matrix,
    tendon_groups,
)

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
SIDES = [[0, 1], [1, 2], [2, 3], [3, 0]]


def snelson_x():
    """Two crossed rods in a square of tendons: the smallest planar tensegrity."""
    return tc.network(SQUARE, [[0, 2], [1, 3]], SIDES)


def moved(structure, nodes):
    return replaced(structure, nodes=np.asarray(nodes))


def member_lengths(nodes, members):
    return np.linalg.norm(nodes[members[:, 1]] - nodes[members[:, 0]], axis=1)


def of_prestress(prestress, **given):
    return stability_orders(
        prestress.structure,
        prestress.nodes,
        prestress.tensions,
        prestress.rod_forces,
        **({"stiffness": 100.0, "loads": prestress.loads} | given),
    )


@pytest.fixture(scope="module")
def joined():
    """The class 2 (3,2) shell: six self-stresses, so there is something to choose."""
    return tc.shell(3, 2, cls=2)


class TestEquilibriumMatrix:
    @pytest.mark.parametrize("pins", [(), ("P1_*_1",)])
    def test_columns_are_virtual_work(self, rng, pins):
        """Lengths change by -A_t'v and A_r'v, to second order in the step."""
        structure = tc.shell(3, 2, pins=pins)
        matrix = equilibrium_matrix(structure)
        v = np.zeros(structure.nodes.size)
        v[matrix.free] = rng.standard_normal(matrix.free.size)

        def remainder(members, rate):
            def of(step):
                there = member_lengths(structure.nodes + step * v.reshape(-1, 3), members)
                return there - member_lengths(structure.nodes, members) - step * rate

            return of

        steps = np.array([1e-2, 3e-3, 1e-3])
        assert taylor_order(remainder(structure.tendons, -matrix.tendons.T @ v[matrix.free]), steps) > 1.9
        assert taylor_order(remainder(structure.rods, matrix.rods.T @ v[matrix.free]), steps) > 1.9

    def test_left_over_is_the_equilibriums_own(self, free):
        _, rest, _ = free
        matrix = equilibrium_matrix(rest.structure, rest.nodes)
        left = matrix.left_over(rest.tensions, rest.rod_forces, np.zeros_like(rest.nodes))
        assert np.abs(left).max() < 1e-12 * rest.tensions.max()

    def test_refuses_members_without_direction(self):
        nodes = tc.prism(3).nodes.copy()
        nodes[1] = nodes[0]
        with pytest.raises(tc.EquilibriumError, match="tendon base1 has length 0 m"):
            _ = equilibrium_matrix(tc.prism(3), nodes).tendons

    def test_refuses_nodes_of_another_shape(self):
        with pytest.raises(tc.EquilibriumError, match=r"shape \(5, 3\).*\(6, 3\)"):
            equilibrium_matrix(tc.prism(3), np.zeros((5, 3)))


class TestSelfStress:
    @pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 9])
    def test_prism(self, n):
        """At twist pi/2 + pi/n: one state, T/l of sides over base 2 sin(pi/n), rods as sides; 2n - 5 mechanisms."""
        spaces = self_stress(tc.prism(n))
        spaces.verify(1e-12)
        assert (spaces.states, spaces.mechanism_count, len(spaces.rigid)) == (1, 2 * n - 5, 6)
        assert spaces.decision.decided
        q = spaces.tendon_basis[:, 0] / spaces.structure.tendon_lengths
        rods = spaces.rod_basis[:, 0] / spaces.structure.rod_lengths
        assert q == pytest.approx(q[0] * np.repeat([1, 1, 2 * np.sin(np.pi / n)], n), rel=1e-11)
        assert rods == pytest.approx(q[2 * n], rel=1e-11)

    def test_away_from_its_twist_the_prism_holds_nothing(self):
        spaces = self_stress(tc.prism(3, twist=2.5))
        assert (spaces.states, spaces.mechanism_count) == (0, 0)

    @pytest.mark.parametrize(
        ("structure", "counts"),
        [
            (tc.shell(3, 1), (0, 0)),
            (tc.shell(3, 2, cls=2), (6, 0)),
            (tc.prism(3, pins=["a*"]), (1, 1)),
            (tc.prism(3, pins=["a*", "b1"]), (1, 0)),
            (snelson_x(), (1, 1)),
        ],
        ids=["shell", "class 2", "pinned", "more pins", "X"],
    )
    def test_counts(self, structure, counts):
        spaces = self_stress(structure)
        spaces.verify(1e-12)
        assert (spaces.states, spaces.mechanism_count) == counts

    @pytest.mark.parametrize(
        ("pins", "rigid"), [((), 6), (("P1_1_1",), 3), (("P1_1_1", "P1_2_1"), 1), (("P1_*_1",), 0)]
    )
    def test_mechanisms_are_those_of_the_rods_tangent_space(self, pins, rigid):
        """Tangent coordinates in which no tendon lengthens span the same motions, rigid-body ones included."""
        rest = tc.find_equilibrium(shell_scene(pins=pins))
        spaces, point = self_stress(rest.structure, rest.nodes, rank_tol=1e-10), rest.point
        stretch = spaces.matrix.tendons.T @ point.tangent[spaces.matrix.free]
        _, values, rows = np.linalg.svd(stretch.toarray())
        flat = rows[(values > 1e-9).sum() :].T
        motions = np.linalg.qr(point.tangent @ flat)[0]
        ours = np.concatenate([spaces.mechanisms, spaces.rigid]).reshape(-1, rest.nodes.size).T
        assert len(spaces.rigid) == rigid
        assert ours.shape == motions.shape
        assert np.abs(ours - motions @ (motions.T @ ours)).max(initial=0.0) < 1e-9

    def test_rods_alone_leave_five_motions_a_rod(self):
        assert rod_motions(tc.shell(4, 2)).left_null.shape == (96, 80)
        assert rod_motions(tc.shell(3, 2, cls=2)).left_null.shape == (54, 42)
        assert rod_motions(tc.shell(3, 1, pins=["P1_*_1"])).left_null.shape == (27, 21)

    @given(seed=st.integers(0, 10**6), size=st.sampled_from([1e-6, 1.0, 1e6]))
    @settings(max_examples=10)
    def test_neither_place_nor_size_nor_order_matters(self, seed, size):
        rng = np.random.default_rng(seed)
        plain, order = tc.shell(3, 1, pins=["P1_1_1"]), rng.permutation(24)
        turned = size * (plain.nodes @ rotation(rng).T + rng.standard_normal(3))
        other = replaced(plain, nodes=turned, tendons=plain.tendons[order][:, ::-1])
        a, b = self_stress(plain).decision, self_stress(other).decision
        assert a.rank == b.rank
        assert a.values == pytest.approx(b.values, rel=1e-9, abs=1e-12)

    def test_verify_tells_a_wrong_basis(self, joined):
        spaces = self_stress(joined)
        with pytest.raises(tc.EquilibriumError, match="leaves a nodal force"):
            replaced(spaces, tendon_basis=spaces.tendon_basis[::-1]).verify()
        with pytest.raises(tc.EquilibriumError, match="Maxwell"):
            replaced(spaces, tendon_basis=spaces.tendon_basis[:, 1:], rod_basis=spaces.rod_basis[:, 1:]).verify()


class TestRankDecision:
    @pytest.mark.parametrize("power", [2, 5, 8, 10])
    def test_near_mechanisms_are_seen_as_what_they_are(self, power):
        """The smallest singular value agrees with 50 digits to rounding, and the rank is full."""
        import mpmath as mp

        structure = tc.prism(3, twist=5 * np.pi / 6 + 10.0**-power)
        decision = self_stress(structure).decision
        with mp.workdps(50):
            A = mp.zeros(18, 12)
            for m, (a, b) in enumerate(np.vstack([structure.tendons, structure.rods]).tolist()):
                d = [mp.mpf(structure.nodes[b, i]) - mp.mpf(structure.nodes[a, i]) for i in range(3)]
                for i in range(3):
                    A[3 * a + i, m] = d[i] / mp.norm(d)
                    A[3 * b + i, m] = -d[i] / mp.norm(d)
            true = float(min(mp.svd_r(A, compute_uv=False)))
        assert decision.values[-1] == pytest.approx(true, abs=1e-15)
        assert decision.decided
        assert decision.rank == 12

    def test_between_decided_and_rounding_it_says_undecided(self):
        verdicts = {p: self_stress(tc.prism(3, twist=5 * np.pi / 6 + 10.0**-p)).decision for p in (10, 13, 17)}
        assert verdicts[10].decided
        assert verdicts[10].rank == 12
        assert not verdicts[13].decided
        assert verdicts[17].decided
        assert verdicts[17].rank == 11

    def test_rounded_nodes_need_a_tolerance(self):
        prism = tc.prism(5)
        nodes = np.round(prism.nodes, 5)
        assert self_stress(prism, nodes).states == 0
        loose = self_stress(prism, nodes, rank_tol=1e-4)
        assert loose.states == 1
        assert loose.decision.gap > 1e3
        loose.verify(1e-4)

    def test_values_around_the_gap_are_shown(self):
        spaces = self_stress(tc.prism(3)).spaces
        assert spaces.around[:3] == pytest.approx(spaces.decision.values[8:11])
        assert spaces.around[3] < 1e-15


class TestAdmissible:
    def in_basis(self, structure):
        spaces = self_stress(structure)
        return spaces.tendon_basis

    def test_least_norm_is_that_of_another_solver(self, joined):
        found = admissible_prestress(joined, tension_min=1.0)
        found.verify(1e-12)
        basis = self.in_basis(joined)
        start = np.linalg.lstsq(basis, found.tensions * 1.5, rcond=None)[0]
        other = scipy.optimize.minimize(
            lambda a: 0.5 * a @ a,
            start,
            jac=lambda a: a,
            constraints={"type": "ineq", "fun": lambda a: basis @ a - 1, "jac": lambda a: basis},
            options={"ftol": 1e-15, "maxiter": 500},
        )
        # Rods count in the basis' norm but not in the goal: compare under the goal, which the other one may only raise.
        assert found.tensions @ found.tensions <= (basis @ other.x) @ (basis @ other.x) * (1 + 1e-9)
        assert np.linalg.lstsq(basis, found.tensions, rcond=None)[1].sum() < 1e-24 * (found.tensions @ found.tensions)

    def test_largest_minimum_is_that_of_another_solver(self, joined):
        found = admissible_prestress(joined, tension_min=0.1, tension_max=10.0, goal="largest minimum")
        found.verify(1e-12)
        basis = self.in_basis(joined)
        count, s = basis.shape
        rows = np.vstack([np.hstack([-basis, np.ones((count, 1))]), np.hstack([basis, np.zeros((count, 1))])])
        limits = np.concatenate([np.zeros(count), np.full(count, 10.0)])
        other = scipy.optimize.linprog(np.r_[np.zeros(s), -1.0], rows, limits, bounds=(None, None), method="highs-ipm")
        assert found.smallest == pytest.approx(-other.fun, rel=1e-9)

    @pytest.mark.parametrize("goal", ["least norm", "nearest"])
    def test_no_admissible_tensions_are_nearer(self, joined, rng, goal):
        """The variational inequality (T - g) . (S - T) >= 0 for other admissible S: what makes T the optimum."""
        wanted = None if goal == "least norm" else rng.uniform(1, 5, 42)
        found = admissible_prestress(joined, tension_min=1.0, tension_max=12.0, goal=goal, wanted=wanted)
        towards = found.tensions - (0.0 if wanted is None else wanted)
        for _ in range(10):
            kinds = {"tension_min": 1.0, "tension_max": 12.0, "goal": "nearest", "wanted": rng.uniform(1, 12, 42)}
            other = admissible_prestress(joined, **kinds).tensions
            assert np.linalg.norm(other - found.tensions) > 1e-3
            assert towards @ (other - found.tensions) > -1e-11 * (towards @ towards)

    def test_bounds_hold_and_balance_is_exact(self, joined):
        found = admissible_prestress(joined, tension_min=2.0, tension_max=40.0, goal="nearest", wanted=5.0)
        assert found.residual < 1e-14
        assert found.beyond == 0.0
        assert abs(found.gap) < 1e-12

    def test_symmetric_goals_have_symmetric_answers(self, joined):
        """Tying the orbits loses nothing in a strictly convex goal, and both answers are one."""
        orbits = cyclic_orbits(joined).groups
        plain = admissible_prestress(joined, tension_min=1.0)
        tied = admissible_prestress(joined, tension_min=1.0, groups=orbits)
        tied.verify(1e-12)
        assert tied.tensions == pytest.approx(plain.tensions, rel=1e-10)
        assert len(np.unique(orbits)) == 14

    def test_ties_cost_something_when_the_goal_is_uneven(self, joined, rng):
        wanted = rng.uniform(1, 5, 42)
        kinds = {"goal": "nearest", "wanted": wanted, "tension_min": 0.5}
        plain = admissible_prestress(joined, **kinds)
        tied = admissible_prestress(joined, groups=cyclic_orbits(joined).groups, **kinds)
        tied.verify(1e-12)
        assert np.ptp(tied.tensions[cyclic_orbits(joined).groups == 0]) == 0
        assert np.sum((tied.tensions - wanted) ** 2) > np.sum((plain.tensions - wanted) ** 2) * 1.01

    def test_loads_are_balanced(self, rng):
        structure = tc.shell(3, 2, cls=2, pins=["P1_*_1"])
        loads = 0.3 * rng.standard_normal(structure.nodes.shape)
        found = admissible_prestress(structure, tension_min=1.0, loads=loads)
        found.verify(1e-12)
        assert found.residual < 1e-13
        lost = admissible_prestress(structure, tension_min=1.0).tensions
        assert np.abs(found.tensions - lost).max() > 0.1

    def test_floors_by_label(self, joined):
        found = admissible_prestress(joined, tension_min={"*": 0.5, "t5_*": 3.0})
        five = [label.startswith("t5_") for label in joined.tendon_labels]
        assert found.tensions[five].min() >= 3.0 - 1e-12
        assert found.tensions.min() < 3.0

    def test_many_members(self):
        """(8,4), 304 tendons: sparse, without any basis, and still to rounding."""
        rest = tc.find_equilibrium(shell_scene(8, 4))
        floor = 0.5 * rest.tensions.min()
        kinds = {"tension_min": floor, "goal": "nearest", "wanted": rest.tensions}
        found = admissible_prestress(rest.structure, rest.nodes, **kinds)
        found.verify(1e-10)
        assert found.tensions == pytest.approx(rest.tensions, rel=1e-9)

    def test_verify_tells_a_wrong_answer(self, joined):
        found = admissible_prestress(joined, tension_min=1.0)
        with pytest.raises(tc.EquilibriumError, match="out of balance"):
            replaced(found, tensions=found.tensions[::-1]).verify()
        with pytest.raises(tc.EquilibriumError, match="beyond a bound"):
            replaced(found, tensions=0.9 * found.tensions, rod_forces=0.9 * found.rod_forces).verify()
        with pytest.raises(tc.EquilibriumError, match="away from the optimum"):
            replaced(found, tensions=1.1 * found.tensions, rod_forces=1.1 * found.rod_forces).verify()
        with pytest.raises(tc.EquilibriumError, match="away from the optimum"):
            replaced(found, multipliers=0 * found.multipliers).verify()


class TestInfeasible:
    def test_no_self_stress(self):
        with pytest.raises(tc.EquilibriumError, match=r">= 1 N.*reached is 0 N \(base1.*nearest_shape"):
            admissible_prestress(tc.prism(3, twist=2.5), tension_min=1.0)

    def test_tendons_that_would_have_to_push(self):
        swapped = tc.network(SQUARE, [[0, 1], [2, 3]], [[0, 2], [1, 3], [1, 2], [3, 0]])
        assert self_stress(swapped).states == 1
        with pytest.raises(tc.EquilibriumError, match="no self-stress pulls in every tendon"):
            admissible_prestress(swapped, tension_min=1.0)

    def test_ceiling_too_low(self):
        """The prism's sides pull more than its base by 2 sin(pi/3) l_side/l_base."""
        prism = tc.prism(3)
        ratio = np.sqrt(3) * prism.tendon_lengths[6] / prism.tendon_lengths[0]
        reached = 1.05 / ratio
        with pytest.raises(tc.EquilibriumError, match=rf"<= 1.05 N: the largest.*reached is {reached:.4g} N"):
            admissible_prestress(prism, tension_min=1.0, tension_max=1.05)

    def test_loads_that_a_mechanism_gives_way_to(self):
        prism = tc.prism(3, pins=["a*"])
        loads = np.where(prism.pinned[:, None], 0.0, [0.0, 0.0, -1.0])
        with pytest.raises(tc.EquilibriumError, match="cannot be balanced"):
            admissible_prestress(prism, tension_min=1.0, loads=loads)

    @pytest.mark.parametrize(
        ("given", "sentence"),
        [
            ({"goal": "largest minimum"}, "without tension_max has no end"),
            ({"goal": "most"}, 'goal is "most"'),
            ({"goal": "nearest"}, "wanted tensions go with"),
            ({"wanted": 1.0}, "wanted tensions go with"),
            ({"loads": np.zeros((2, 3))}, r"loads have shape \(2, 3\)"),
            ({"tension_max": np.ones(3)}, r"tension_max has shape \(3,\)"),
            ({"tension_max": 0.5}, "exceeds tension_max at tendon base1"),
        ],
    )
    def test_bad_input(self, given, sentence):
        with pytest.raises(tc.EquilibriumError, match=sentence):
            admissible_prestress(tc.prism(3), tension_min=1.0, **given)


class TestGroups:
    @pytest.mark.parametrize(("structure", "order"), [(tc.shell(8, 4), 8), (tc.prism(5), 5), (snelson_x(), 4)])
    def test_orbits(self, structure, order):
        found = cyclic_orbits(structure)
        assert found.order == order
        assert found.misfit < 1e-14
        assert np.bincount(found.groups).max() == order

    def test_a_pin_takes_symmetry_away(self):
        assert cyclic_orbits(tc.prism(3, pins=["a1"])) is None
        assert cyclic_orbits(tc.prism(3, pins=["a*"])).order == 3

    def test_a_turned_prism_has_its_symmetry_about_its_own_axis(self, rng):
        prism, Q = tc.prism(5), rotation(rng)
        found = cyclic_orbits(prism, prism.nodes @ Q.T + 3.0)
        assert found.order == 5
        assert abs(found.axis @ Q[:, 2]) == pytest.approx(1.0, rel=1e-9)

    def test_by_label(self):
        shell = tc.shell(3, 1)
        groups = tendon_groups(shell, {"inner": ["t1_*", "t2_*"], "t5": ["t5_*"]})
        assert len(np.unique(groups)) == 24 - 9 + 2
        assert len(np.unique(tendon_groups(shell, ["t1_*", "t2_*", "t5_*"]))) == 24 - 9 + 3

    def test_bad_groups(self):
        with pytest.raises(tc.StructureError, match="in the groups t1_\\* and t\\*"):
            tendon_groups(tc.shell(3, 1), ["t1_*", "t*"])
        with pytest.raises(tc.StructureError, match=r"one integer a tendon"):
            tendon_groups(tc.shell(3, 1), np.zeros(3))
        with pytest.raises(tc.StructureError, match="names nothing"):
            tendon_groups(tc.shell(3, 1), ["x*"])


class TestOrders:
    @pytest.mark.parametrize("pins", [(), ("a1",), ("a1", "a2"), ("a*",)])
    @pytest.mark.parametrize("n", [3, 4, 5, 6])
    def test_prisms_are_super_stable(self, n, pins):
        """Connelly and Terrell 1995: a prism at its twist is, however it is pinned."""
        orders = of_prestress(admissible_prestress(tc.prism(n, pins=pins), tension_min=1.0))
        orders.verify()
        assert orders.first_order is tc.Stability.NO
        assert orders.mechanisms == self_stress(tc.prism(n, pins=pins)).mechanism_count > 0
        assert orders.prestress_stable is orders.stable is orders.super_stable is tc.Stability.YES

    @pytest.mark.parametrize(("pins", "needed"), [((), 6), (("a1",), 6), (("a1", "a2"), 5), (("a*",), 3)])
    def test_pins_take_affine_motions_away(self, pins, needed):
        """Q has d(d+1)/2 entries, less v(v+1)/2 that the pins' own v dimensions hold."""
        orders = of_prestress(admissible_prestress(tc.prism(4, pins=pins), tension_min=1.0))
        assert orders.for_ever.needed == needed == orders.for_ever.affine.rank

    @pytest.mark.parametrize(
        ("offset", "verdict"),
        [
            (1e-8, tc.Stability.YES),
            (-1e-8, tc.Stability.NO),
            (1e-17, tc.Stability.UNDECIDED),
            (0, tc.Stability.UNDECIDED),
        ],
    )
    def test_the_edge_of_stability(self, offset, verdict):
        """Anchored `offset` beside its pin, a rod of 1 m is held by T/(1 - offset) - T across it."""
        # Two more nodes on the ground: pins at one point alone would make turning about it a rigid-body motion.
        nodes = [[0, 0, 0], [1, 0, 0], [offset, 0, 0], [0, 3, 5], [4, 0, 2]]
        structure = tc.network(nodes, [[0, 1]], [[1, 2]], [0, 2, 3, 4])
        orders = of_prestress(admissible_prestress(structure, tension_min=3.0))
        assert orders.on_mechanisms.smallest == pytest.approx(3 * offset, rel=1e-6, abs=1e-14)
        assert orders.prestress_stable == orders.stable == verdict

    def test_the_stress_matrix_balances(self, free):
        _, rest, _ = free
        omega = stress_matrix(rest.structure, rest.force_densities, rest.rod_force_densities)
        assert np.abs(omega @ rest.nodes).max() < 1e-12 * rest.tensions.max()
        assert np.abs(omega @ np.ones(12)).max() < 1e-13 * rest.tensions.max()

    @pytest.mark.parametrize("pins", [(), ("P1_*_1",)])
    @pytest.mark.parametrize("law", ["k", "EA"])
    def test_second_variation_is_the_hessian_on_the_manifold(self, rng, pins, law):
        """Two derivations: force densities of all members here, great circles of the rods there; loads included."""
        tendons = {"stiffness": 100.0} if law == "k" else {"EA": 100.0}
        loads = {"P4_*": [0.3, 0, -0.5]} if pins else None
        rest = tc.find_equilibrium(shell_scene(pins=pins, tendons=tendons, loads=loads))
        xi = rng.standard_normal((rest.potential.manifold.size, 4))
        matrix = equilibrium_matrix(rest.structure, rest.nodes)
        stiffness = 100.0 if law == "k" else 100.0 / rest.rest_lengths
        stiff = np.broadcast_to(stiffness, rest.tensions.shape)
        form = second_variation(matrix, rest.tensions, rest.rod_forces, stiff, (rest.point.tangent @ xi)[matrix.free])
        assert np.abs(form - xi.T @ (rest.point.hessian @ xi)).max() < 1e-11 * np.abs(form).max()

    def test_rod_pulled_towards_its_pin(self):
        """v'Omega v = T/l - T/L across the rod: -0.6 T for l = 2.5 m and L = 1 m, whatever the stiffness."""
        structure = tc.build_structure(pendulum_scene(anchor=(-1.5, 0, 0)))
        found = admissible_prestress(structure, tension_min=2.0)
        for k in (1e-3, 1e6):
            orders = of_prestress(found, stiffness=k)
            assert orders.mechanisms == 2
            assert orders.on_mechanisms.smallest == pytest.approx(-1.2, rel=1e-13)
            assert orders.prestress_stable is orders.super_stable is tc.Stability.NO

    def test_rod_pulled_away_from_its_pin(self):
        """A rod in tension holds its direction (T/l + T/L = 2 T), but the prestress is no proper one."""
        structure = tc.build_structure(pendulum_scene(anchor=(2.0, 0, 0)))
        orders = of_prestress(admissible_prestress(structure, tension_min=2.0))
        assert orders.on_mechanisms.smallest == pytest.approx(4.0, rel=1e-13)
        assert orders.prestress_stable is tc.Stability.YES
        assert orders.super_stable is tc.Stability.NO
        assert not orders.for_ever.proper

    def test_planar_structures_count_their_own_dimensions(self):
        orders = of_prestress(admissible_prestress(snelson_x(), tension_min=1.0))
        assert (orders.for_ever.dimension, orders.for_ever.needed, orders.for_ever.affine.rank) == (2, 3, 3)
        # Omega of the square: densities 1 and -1, eigenvalue 4 on (1, -1, 1, -1), zero on affine functions.
        assert orders.for_ever.smallest == pytest.approx(4.0, rel=1e-13)
        assert orders.super_stable is tc.Stability.YES

    def test_first_order_rigid_needs_no_prestress(self, joined):
        orders = of_prestress(admissible_prestress(joined, tension_min=1e-6))
        assert orders.first_order is tc.Stability.YES
        assert orders.on_mechanisms.smallest == np.inf
        assert orders.stable is tc.Stability.YES

    def test_margins_scale_with_the_prestress(self):
        found = admissible_prestress(tc.prism(3), tension_min=1.0)
        one = of_prestress(found)
        for scale in (1e-12, 1e-6, 1e6):
            other = stability_orders(
                found.structure, None, scale * found.tensions, scale * found.rod_forces, stiffness=100.0 * scale
            )
            assert other.on_mechanisms.smallest == pytest.approx(scale * one.on_mechanisms.smallest, rel=1e-9)
            assert other.on_all.smallest == pytest.approx(scale * one.on_all.smallest, rel=1e-9)
            assert other.super_stable is tc.Stability.YES

    @pytest.mark.parametrize("ratio", [1e3, 1e6, 1e9, 1e12])
    def test_stiffness_ratio_does_not_blur_the_mechanisms(self, ratio):
        found = admissible_prestress(tc.prism(3), tension_min=1.0)
        k = np.ones(9)
        k[0] = ratio
        orders = of_prestress(found, stiffness=k)
        assert orders.on_mechanisms.smallest == pytest.approx(of_prestress(found).on_mechanisms.smallest, rel=1e-12)
        assert orders.prestress_stable is tc.Stability.YES
        assert orders.stable in (tc.Stability.YES, tc.Stability.UNDECIDED)

    def test_where_the_rank_is_undecided_so_is_the_order(self):
        found = admissible_prestress(tc.prism(3), tension_min=1.0)
        nodes = tc.prism(3, twist=5 * np.pi / 6 + 1e-13).nodes
        forces = found.tensions, found.rod_forces
        orders = stability_orders(found.structure, nodes, *forces, stiffness=100.0, rank_tol=0.0)
        assert orders.first_order is orders.prestress_stable is tc.Stability.UNDECIDED

    def test_an_equilibrium_is_judged_to_its_own_residual(self):
        """Settled nodes balance to 1e-12, so their mechanism has a singular value of that size and not of 1e-16."""
        rest = tc.find_equilibrium(shell_scene(pins=["P1_1_1", "P1_2_1"]))
        orders = stability_orders(rest.structure, rest.nodes, rest.tensions, rest.rod_forces, stiffness=100.0)
        assert orders.rank.decided
        assert orders.mechanisms == 1
        assert orders.prestress_stable is tc.Stability.YES

    def test_verify_tells_forces_that_do_not_balance(self):
        found = admissible_prestress(tc.prism(3), tension_min=1.0)
        orders = of_prestress(replaced(found, tensions=found.tensions * np.linspace(1, 1.1, 9)))
        with pytest.raises(tc.EquilibriumError, match="out of balance"):
            orders.verify()

    def test_super_stability_is_silent_under_loads(self, rng):
        structure = tc.shell(3, 2, cls=2, pins=["P1_*_1"])
        found = admissible_prestress(structure, tension_min=1.0, loads=0.1 * rng.standard_normal(structure.nodes.shape))
        assert of_prestress(found).super_stable is tc.Stability.UNDECIDED


class TestLevels:
    @pytest.mark.parametrize("tendons", [{"stiffness": 100.0}, {"EA": 100.0}])
    def test_rest_lengths_make_the_level(self, tendons):
        """Settled again with the new rest lengths, the nodes stay and the tensions are scaled."""
        rest = tc.find_equilibrium(shell_scene(tendons=tendons))
        levels = prestress_levels(rest, [0.1, 1.0, 1.7])
        levels.verify(1e-11)
        for scale, level in zip(levels.scales, levels.equilibria, strict=True):
            members = replaced(rest.potential.members, rest_lengths=level.rest_lengths)
            again = settle(replaced(rest.potential, members=members), start=rest.nodes)
            assert np.abs(again.nodes - rest.nodes).max() < 1e-11
            assert again.tensions == pytest.approx(scale * rest.tensions, rel=1e-9)

    def test_a_mechanism_stiffens_with_the_root_of_the_prestress(self, free):
        _, rest, _ = free
        levels = prestress_levels(rest, [1e-4, 1e-3, 1e-2])
        assert np.diff(np.log(levels.frequency)) / np.log(10) == pytest.approx(0.5, abs=1e-3)
        assert np.diff(np.log(levels.stiffness)) / np.log(10) == pytest.approx(1.0, abs=2e-3)

    def test_first_order_rigid_structures_keep_their_stiffness(self, joined):
        """Without mechanisms the elastic part holds alone: the lowest frequency tends to a limit above zero."""
        found = inverse_statics(Potential.of(tc.Scene(structure=joined)), tension_min=1.0)
        levels = prestress_levels(found.equilibrium, [1e-8, 1e-4, 1e-2])
        assert levels.frequency[0] == pytest.approx(levels.frequency[1], rel=1e-3)
        assert levels.frequency[0] > 0.1

    def test_bad_input(self, free):
        _, rest, _ = free
        with pytest.raises(tc.EquilibriumError, match="positive numbers"):
            prestress_levels(rest, [1.0, -1.0])
        with pytest.raises(tc.EquilibriumError, match="rest length below zero"):
            prestress_levels(rest, [100.0])
        loaded = tc.find_equilibrium(shell_scene(pins=["P1_*_1"], loads={"P4_*": [0, 0, -0.1]}))
        with pytest.raises(tc.EquilibriumError, match="only a self-stress"):
            prestress_levels(loaded, [1.0])


def test_linear_programmes_print_nothing():
    """Not even once a process, as a solver may."""
    asked = "import tensctl as tc\ntry: tc.admissible_prestress(tc.prism(3, twist=80), tension_min=1.0)\n"
    asked += "except tc.EquilibriumError: pass\nelse: raise SystemExit('a prestress was found')"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
