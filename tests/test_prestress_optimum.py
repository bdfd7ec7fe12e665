"""Optima of prestress do not hang on a solver's last digits, and no program is refused without a proof."""

import numpy as np
import pytest
from support import replaced, shell_scene

import tensctl as tc
from tensctl.statics.prestress import admissible_prestress, choose, vertex
from tensctl.statics.prestress.choose import QP_SOLVERS, choose_nearest, excluded
from tensctl.statics.prestress.groups import tendon_groups
from tensctl.statics.prestress.matrix import equilibrium_matrix
from tensctl.statics.prestress.optimum import contradiction, largest_minimum_bound
from tensctl.statics.prestress.polish import active, highest, misfit, polish
from tensctl.statics.prestress.program import Balanced, Program, least_squares, least_violation
from tensctl.statics.prestress.vertex import SOLVERS, largest_vertex

JOINED = tc.shell(3, 2, cls=2)
PINNED = tc.shell(3, 2, cls=2, pins=["P1_*_1"])
WIDE = tc.shell(5, 2, cls=2)


def program(structure, nodes=None, *, low=1.0, high=np.inf, loads=None):
    count = len(structure.tendons)
    loads = np.zeros_like(structure.nodes) if loads is None else loads
    bounds = np.broadcast_to(low, count).astype(float), np.broadcast_to(high, count).astype(float)
    return Program(equilibrium_matrix(structure, nodes), loads, *bounds, tendon_groups(structure, None))


def box():
    """Bounds on both sides and wanted tensions far outside: full active-set steps go in circles here."""
    high = 1.05 * admissible_prestress(WIDE, tension_min=1.0).tensions.max()
    wanted = np.random.default_rng(0).uniform(0.5, 2 * high, len(WIDE.tendons))
    return program(WIDE, high=high), wanted


def programs():
    rng = np.random.default_rng(3)
    count = len(JOINED.tendons)
    loads = 3.0 * rng.standard_normal(PINNED.nodes.shape)
    return {
        "least norm": (program(JOINED), np.zeros(count)),
        "nearest": (program(JOINED), rng.uniform(0.5, 6, count)),
        "loads": (program(PINNED, loads=loads), np.zeros(len(PINNED.tendons))),
        "box": box(),
    }


@pytest.fixture(scope="module", params=["least norm", "nearest", "loads", "box"])
def optimum(request):
    asked, target = programs()[request.param]
    weights = np.ones(target.size)
    return asked, weights, target, choose_nearest(asked, weights, target)


def nothing(asked):
    return Balanced(np.zeros(asked.lower.size), np.zeros(asked.matrix.rods.shape[1]), np.zeros(asked.load.size))


def rough_of(optimum, part, seed):
    """The optimum with a relative error in every number of a solver's answer."""
    rng = np.random.default_rng(seed)
    found = optimum[3]
    return Balanced(
        *(
            x + part * np.abs(x).max(initial=0.0) * rng.standard_normal(x.size)
            for x in (found.tensions, found.rod_forces, found.multipliers)
        )
    )


class TestPolish:
    def test_multipliers_say_the_tensions(self, optimum):
        assert misfit(*optimum) < 1e-13

    @pytest.mark.parametrize("part", [1e-12, 1e-9, 1e-6, 1e-3, 1.0])
    def test_errors_of_the_start_leave_no_trace(self, optimum, part):
        """Down to errors at which balance and bounds alone could not tell the rough answer from the polished one."""
        asked, weights, target, found = optimum
        for seed in range(3):
            polished = polish(asked, weights, target, rough_of(optimum, part, seed))
            assert polished.settled
            assert polished.misfit < 1e-13
            assert polished.found.tensions == pytest.approx(found.tensions, rel=1e-11)

    def test_a_feasible_start_is_not_taken_for_the_optimum(self, optimum):
        """Balance and bounds to the last digit, wrong multipliers: as good as the optimum to a judge of the two."""
        asked, weights, target, found = optimum
        feasible = choose_nearest(asked, weights, 1.5 * found.tensions)
        start = replaced(feasible, multipliers=found.multipliers * 1.001)
        polished = polish(asked, weights, target, start)
        assert polished.found.tensions == pytest.approx(found.tensions, rel=1e-11)

    def test_no_start_is_needed(self, optimum):
        asked, weights, target, found = optimum
        polished = polish(asked, weights, target, nothing(asked))
        assert polished.settled
        assert polished.found.tensions == pytest.approx(found.tensions, rel=1e-11)

    @pytest.mark.parametrize("solver", QP_SOLVERS)
    def test_every_solver_leads_there(self, optimum, solver):
        asked, weights, target, found = optimum
        rough = least_squares(asked, weights, target, solver)
        assert rough is not None
        assert polish(asked, weights, target, rough).found.tensions == pytest.approx(found.tensions, rel=1e-11)

    def test_steps_end_at_the_top_of_the_dual_function(self, optimum, rng):
        """Its slope, by the definition, changes sign where `highest` says."""
        asked, weights, target, found = optimum
        low, high = asked.bounds
        y, d = found.multipliers + rng.standard_normal(asked.load.size), rng.standard_normal(asked.load.size)

        def slope(s):
            pull = asked.tied.T @ (y + s * d)
            return float(asked.load @ d + (asked.tied.T @ d) @ np.clip(target - pull / weights, low, high))

        d = d if slope(0.0) > 0 else -d
        top = highest(asked, weights, target, y, d)
        if np.isfinite(top):
            assert abs(slope(top)) < 1e-9 * max(abs(slope(0.0)), 1.0)
        else:
            assert slope(1e9) > 0

    def test_an_idle_bound_may_fall_on_either_side(self):
        """The floor is the least of the optimum's own tensions: it touches, and nothing presses."""
        free = choose_nearest(program(JOINED), np.ones(42), np.zeros(42)).tensions
        loads = program(JOINED, low=free.min())
        for shift in (-1e-15, 0.0, 1e-15):
            asked = replaced(loads, lower=loads.lower * (1 + shift))
            found = choose_nearest(asked, np.ones(42), free)
            assert found.tensions == pytest.approx(free, rel=1e-12)
            fixed = active(asked, np.ones(42), free, found.multipliers)
            assert np.isnan(fixed).any()


class TestInvariance:
    @pytest.mark.parametrize("scale", [1e-3, 1e-1, 1e3])
    def test_units_of_force(self, optimum, scale):
        asked, weights, target, found = optimum
        other = Program(asked.matrix, scale * asked.loads, scale * asked.lower, scale * asked.upper, asked.groups)
        there = choose_nearest(other, weights, scale * target)
        assert there.tensions == pytest.approx(scale * found.tensions, rel=1e-11)

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_units_of_length_and_weight(self, optimum, scale):
        asked, weights, target, found = optimum
        matrix = equilibrium_matrix(asked.matrix.structure, scale * asked.matrix.nodes)
        there = choose_nearest(replaced(asked, matrix=matrix), scale * weights, target)
        assert there.tensions == pytest.approx(found.tensions, rel=1e-11)

    @pytest.mark.parametrize("seed", range(3))
    def test_order_of_members(self, optimum, seed):
        asked, weights, target, found = optimum
        structure, rng = asked.matrix.structure, np.random.default_rng(seed)
        order = rng.permutation(len(structure.tendons))
        labels = tuple(structure.tendon_labels[k] for k in order)
        other = replaced(structure, tendons=structure.tendons[order][:, ::-1], tendon_labels=labels)
        matrix = equilibrium_matrix(other)
        moved = Program(matrix, asked.loads, asked.lower[order], asked.upper[order], asked.groups)
        there = choose_nearest(moved, weights[order], target[order])
        assert there.tensions == pytest.approx(found.tensions[order], rel=1e-11)


class TestVerdicts:
    def test_settled_nodes_are_held_when_every_solver_gives_up(self, monkeypatch):
        """Nodes that settle to 1e-13 make balance contradict itself by as much, and solvers may then find nothing."""
        rest = tc.find_equilibrium(shell_scene(4, 3))
        floor = 0.5 * rest.tensions.min()
        monkeypatch.setattr(choose, "least_squares", lambda *_: None)
        found = admissible_prestress(rest.structure, rest.nodes, tension_min=floor)
        found.verify(1e-10)

    @pytest.mark.parametrize("solver", SOLVERS)
    def test_proofs_of_each_solver(self, solver):
        """The prism's sides pull 1.1 of its base and more: a ceiling of 1.05 cannot hold, one of 5 can."""
        prism = tc.prism(3)
        tight, wide = program(prism, high=1.05), program(prism, high=5.0)
        assert contradiction(tight, least_violation(tight, solver)) > 1e-3
        assert not excluded(wide, (solver,))

    @pytest.mark.parametrize("seed", range(5))
    def test_nothing_contradicts_what_is_possible(self, optimum, seed):
        """No y at all can prove a program impossible that has an answer."""
        asked, *_, found = optimum
        rng = np.random.default_rng(seed)
        for y in (rng.standard_normal(asked.load.size), found.multipliers, 1e9 * found.multipliers):
            assert contradiction(asked, y) < 1e-13

    def test_rays_prove_what_solvers_would(self):
        structure = tc.prism(3, twist=2.5)
        asked = program(structure)
        polished = polish(asked, np.ones(9), np.zeros(9), nothing(asked))
        assert polished.ray is not None
        assert contradiction(asked, polished.ray) > 1e-3

    def test_large_multipliers_do_not_stay(self):
        """Settled nodes leave 1e-13 out of balance, and interior points come with multipliers of 1e4 along it."""
        rest = tc.find_equilibrium(shell_scene(4, 3))
        asked = program(rest.structure, rest.nodes, low=0.5 * rest.tensions.min())
        weights, count = np.ones(rest.tensions.size), asked.load.size
        across = np.linalg.svd(asked.matrix.full.toarray())[0][:, -6:] @ np.full(6, 1e5)
        assert across.size == count
        start = replaced(nothing(asked), multipliers=across)
        polished = polish(asked, weights, rest.tensions, start)
        assert np.abs(polished.found.multipliers).max() < 1.0
        assert polished.found.tensions == pytest.approx(rest.tensions, rel=1e-10)

    def test_without_answer_or_proof_it_says_so(self, monkeypatch):
        """Solvers that find nothing are no proof: when none is recomputed, the verdict is that there is no verdict."""
        prism = tc.prism(3)
        monkeypatch.setattr(choose, "contradiction", lambda *_: 0.0)
        with pytest.raises(tc.EquilibriumError, match="not decided"):
            admissible_prestress(prism, tension_min=1.0, tension_max=1.05)

    @pytest.mark.parametrize("short", [1e-3, 1e-6, 1e-8])
    def test_ceilings_just_below_and_above(self, short):
        prism = tc.prism(3)
        ratio = np.sqrt(3) * prism.tendon_lengths[6] / prism.tendon_lengths[0]
        admissible_prestress(prism, tension_min=1.0, tension_max=ratio * (1 + short)).verify(1e-12)
        with pytest.raises(tc.EquilibriumError, match="no prestress holds"):
            admissible_prestress(prism, tension_min=1.0, tension_max=ratio * (1 - short))


class TestVertex:
    @pytest.mark.parametrize("solver", SOLVERS)
    @pytest.mark.parametrize("structure", [JOINED, PINNED, WIDE], ids=["joined", "pinned", "wide"])
    def test_every_solver_leads_to_the_same_value(self, monkeypatch, structure, solver):
        asked = program(structure, low=0.0, high=10.0)
        first = largest_vertex(asked)
        monkeypatch.setattr(vertex, "SOLVERS", (solver,))
        found = largest_vertex(asked)
        assert found.misfit < 1e-12
        assert found.reached == pytest.approx(first.reached, rel=1e-12)
        assert largest_minimum_bound(asked, found.found.multipliers) == pytest.approx(found.reached, rel=1e-12)

    def test_an_error_of_the_solver_leaves_no_trace(self, monkeypatch, rng):
        asked = program(JOINED, low=0.0, high=10.0)
        value, exact = vertex.largest_minimum(asked, "HIGHS")
        noise = (1e-8 * np.abs(x).max() * rng.standard_normal(x.size) for x in (exact.tensions, exact.rod_forces))
        rough = Balanced(exact.tensions + next(noise), exact.rod_forces + next(noise), exact.multipliers)
        monkeypatch.setattr(vertex, "largest_minimum", lambda *_: (value * (1 + 1e-8), rough))
        found = largest_vertex(asked)
        assert found.misfit < 1e-12
        assert found.reached == pytest.approx(value, rel=1e-11)

    def test_settled_nodes_balance_as_well_as_they_can(self):
        """A solver stops at its tolerance, which is 1e-10 here; the nodes themselves balance a hundred times better."""
        rest = tc.find_equilibrium(shell_scene(5, 4))
        ceiling = 1.5 * rest.tensions.max()
        kinds = {"tension_min": 0.5 * rest.tensions.min(), "tension_max": ceiling, "goal": "largest minimum"}
        admissible_prestress(rest.structure, rest.nodes, **kinds).verify(1e-12)
