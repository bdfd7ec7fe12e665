"""Rest lengths for given nodes, nearest shapes, and how nodes follow rest lengths and loads."""

import numpy as np
import pytest
import scipy.optimize
from support import REFERENCE, prism_scene, reference_prism, replaced, rotation, shell_scene, taylor_order

import tensctl as tc
from tensctl.elements import Potential
from tensctl.statics import Equilibrium, settle
from tensctl.statics.inverse import inverse_statics
from tensctl.statics.nearest import nearest_shape
from tensctl.statics.prestress import self_stress
from tensctl.statics.response import (
    compliance,
    displacement_under,
    rest_length_influence,
    static_influence,
    static_response,
    tension_influence,
)

LAWS = [{"stiffness": 100.0}, {"EA": 100.0}]


def resettled(equilibrium, rest_lengths, forces=None):
    """The equilibrium with other rest lengths and loads, found by Newton."""
    members = equilibrium.potential.members
    members = replaced(members, rest_lengths=rest_lengths, forces=members.forces if forces is None else forces)
    return settle(replaced(equilibrium.potential, members=members), start=equilibrium.nodes)


def as_it_stands(scene):
    """The structure's own nodes with the scene's rest lengths, taken as an equilibrium."""
    potential = Potential.of(scene)
    return Equilibrium(potential, potential.structure.nodes, potential.members.rest_lengths, 0)


@pytest.fixture(scope="module")
def prism_data():
    with np.load(REFERENCE / "prism_pinned_linear.npz", allow_pickle=False) as data:
        return dict(data)


class TestReferencePrism:
    """Numbers of other codes: an independent rigid-rod calculation in double precision, and elastic finite elements."""

    PINS = ("a", "b", "c")

    def test_pinned_frequencies(self, prism_data):
        rest = as_it_stands(reference_prism(self.PINS))
        rest.verify(1e-14)
        frequency = np.sqrt(rest.omega2) / (2 * np.pi)
        printed = [2.188274508, 4.970573614, 4.970573614, 10.840783026, 10.840783026, 12.767044727]
        assert np.abs(frequency - printed).max() < 6e-10
        assert frequency == pytest.approx(prism_data["freq_rigid_hz"], rel=1e-13)

    def test_free_frequencies(self):
        rest = as_it_stands(reference_prism())
        frequency = np.sqrt(np.maximum(rest.omega2, 0)) / (2 * np.pi)
        printed = [2.665597479, *2 * [8.052123287], *2 * [9.992079002], 14.38628877, *2 * [16.27651360], 19.12518900]
        digits = [5e-10, *2 * [5e-10], *2 * [5e-10], 5e-9, *2 * [5e-9], 5e-9]
        assert frequency[:6].max() < 1e-6
        assert (np.abs(frequency[6:] - printed) < 1.2 * np.array(digits)).all()

    @pytest.mark.parametrize("form", ["dense", "sparse"])
    def test_influence_for_constant_stiffness(self, prism_data, form):
        rest = as_it_stands(reference_prism(self.PINS))
        influence = rest_length_influence(rest, np.arange(9), form=form)[3:].reshape(9, 9)
        assert np.abs(influence - prism_data["static_influence_constk"]).max() < 1e-13

    @pytest.mark.parametrize("form", ["dense", "sparse"])
    def test_influence_for_constant_EA(self, prism_data, form):
        rest = as_it_stands(self.with_EA(prism_data))
        rest.verify(1e-13)
        influence = rest_length_influence(rest, np.arange(9), form=form)[3:].reshape(9, 9)
        assert np.abs(influence - prism_data["static_influence_constEA"]).max() < 1e-12

    def test_influence_of_the_elastic_code(self, prism_data):
        """-A21^-1 B2 of its state matrices: 6.7e-7 away, because its bars give a little."""
        A, B = prism_data["tsgfem_A"], prism_data["tsgfem_B"]
        elastic = -np.linalg.solve(A[9:, :9], B[9:, 12:])
        rest = as_it_stands(self.with_EA(prism_data))
        ours = rest_length_influence(rest, np.arange(9))[3:].reshape(9, 9)
        assert 1e-7 < np.abs(elastic - ours).max() < 6.7e-7

    def with_EA(self, prism_data):
        scene = reference_prism(self.PINS)
        labels = [f"s{k}" for k in range(9)]
        EA = dict(zip(labels, prism_data["EA"][3:].tolist(), strict=True))
        rest = dict(zip(labels, prism_data["l0"][3:].tolist(), strict=True))
        return scene.replaced(tendons={"EA": EA, "rest_length": rest})


class TestInfluence:
    SCENES = (
        {"pins": ["P1_*_1"]},
        {"pins": ["P1_1_1", "P1_2_1", "P3_1_1"], "gravity": {"g": 1.0}},
        {"n": 3, "m": 2, "cls": 2, "pins": ["P1_*_1"]},
        {},
    )

    @pytest.mark.parametrize("tendons", LAWS, ids=["k", "EA"])
    @pytest.mark.parametrize("scene", SCENES, ids=["pinned", "hanging", "class 2", "free"])
    def test_settled_equilibria_follow_it(self, rng, scene, tendons):
        """Nodes and tensions of re-settled structures, to second order in the change of rest lengths."""
        rest = tc.find_equilibrium(shell_scene(**({"tendons": tendons} | scene)))
        inputs = rest.potential.members.inputs
        change = np.zeros(rest.rest_lengths.size)
        change[inputs] = rng.standard_normal(inputs.size)
        slope = rest_length_influence(rest) @ change[inputs]
        pull = -tension_influence(rest) @ change[inputs]
        steps = np.array([4e-3, 2e-3, 1e-3])
        there = {h: resettled(rest, rest.rest_lengths + h * change) for h in steps}
        lengths = slope[rest.structure.tendons[:, 1]] - slope[rest.structure.tendons[:, 0]]
        d = rest.nodes[rest.structure.tendons[:, 1]] - rest.nodes[rest.structure.tendons[:, 0]]
        rate = np.einsum("ti,ti->t", d, lengths) / rest.lengths
        assert taylor_order(lambda h: there[h].lengths - rest.lengths - h * rate, steps) > 1.8
        assert taylor_order(lambda h: there[h].tensions - rest.tensions - h * pull, steps) > 1.8
        if rest.structure.pinned.sum() > 2:
            assert taylor_order(lambda h: there[h].nodes - rest.nodes - h * slope, steps) > 1.8

    @pytest.mark.parametrize("scene", SCENES, ids=["pinned", "hanging", "class 2", "free"])
    def test_dense_is_sparse_is_modal(self, scene):
        rest = tc.find_equilibrium(shell_scene(**scene))
        spectrum, inputs = rest.spectrum, rest.potential.members.inputs
        shapes, drive = spectrum.shapes[:, spectrum.rigid_count :], rest.point.input_map[:, inputs].toarray()
        modal = shapes @ ((shapes.T @ drive) / spectrum.omega2[spectrum.rigid_count :, None])
        for form in ("dense", "sparse"):
            assert np.abs(static_influence(rest, form=form) - modal).max() < 1e-11 * np.abs(modal).max()

    def test_one_direction_moves_nothing(self, free):
        """At an unloaded prestressed rest, rest lengths that only scale the prestress: du = T/k."""
        _, rest, _ = free
        still = rest_length_influence(rest) @ (rest.tensions / 100.0)
        assert np.abs(still).max() < 1e-12
        tighter = tension_influence(rest) @ (rest.tensions / 100.0)
        assert tighter == pytest.approx(rest.tensions, rel=1e-10)

    def test_without_stiffness_it_is_refused(self):
        slack = tc.find_equilibrium(shell_scene(tendons={"rest_ratio": 1.2}))
        for form in ("dense", "sparse"):
            with pytest.raises(tc.EquilibriumError, match="motion without stiffness"):
                static_influence(slack, form=form)
        assert static_response(slack, "dense").condition == np.inf


class TestCompliance:
    @pytest.mark.parametrize("tendons", LAWS, ids=["k", "EA"])
    @pytest.mark.parametrize("scene", TestInfluence.SCENES[:3], ids=["pinned", "hanging", "class 2"])
    def test_settled_equilibria_follow_it(self, rng, scene, tendons):
        rest = tc.find_equilibrium(shell_scene(**({"tendons": tendons} | scene)))
        load = np.where(rest.structure.pinned[:, None], 0.0, rng.standard_normal(rest.nodes.shape))
        slope = displacement_under(rest, load)
        steps = np.array([2e-3, 1e-3, 5e-4])
        forces = rest.potential.members.forces

        def remainder(h):
            return resettled(rest, rest.rest_lengths, forces + h * load).nodes - rest.nodes - h * slope

        assert taylor_order(remainder, steps) > 1.8

    def test_balanced_loads_on_a_free_structure(self, free, rng):
        """Lengths follow; where the structure goes as a whole is nobody's business."""
        _, rest, _ = free
        rigid = self_stress(rest.structure, rest.nodes).rigid.reshape(6, -1)
        load = rng.standard_normal(36)
        load = (load - rigid.T @ (rigid @ load)).reshape(-1, 3)
        slope = displacement_under(rest, load)
        ends = rest.structure.tendons
        d = rest.nodes[ends[:, 1]] - rest.nodes[ends[:, 0]]
        rate = np.einsum("ti,ti->t", d, slope[ends[:, 1]] - slope[ends[:, 0]]) / rest.lengths
        steps = np.array([4e-3, 2e-3, 1e-3])
        # The moment of a dead load changes as nodes move, so it balances to first order only: compare small steps.
        columns = compliance(rest) @ load.ravel()
        assert columns.reshape(-1, 3) == pytest.approx(slope, abs=1e-12)
        for h in steps:
            turned = resettled_balanced(rest, h * load)
            assert np.abs(turned - rest.lengths - h * rate).max() < 2 * h**2

    def test_is_symmetric_and_positive(self, mast):
        _, rest, _ = mast
        C = compliance(rest)
        assert np.abs(C - C.T).max() < 1e-13 * np.abs(C).max()
        assert np.linalg.eigvalsh(C).min() > -1e-14
        assert np.abs(C[np.repeat(rest.structure.pinned, 3)]).max() == 0.0

    def test_is_the_inverse_of_the_stiffness_on_what_moves(self, mast):
        _, rest, _ = mast
        J, H = rest.point.tangent.toarray(), rest.point.hessian.toarray()
        assert np.abs(compliance(rest) - J @ np.linalg.solve(H, J.T)).max() < 1e-13

    def test_columns_one_by_one(self, mast):
        _, rest, _ = mast
        some = np.array([5, 17, 30])
        assert np.abs(compliance(rest, some, form="sparse") - compliance(rest)[:, some]).max() < 1e-14

    def test_turns_with_the_structure(self, rng):
        Q = rotation(rng)
        plain = tc.find_equilibrium(shell_scene(pins=["P1_*_1"]))
        there = replaced(plain.structure, nodes=plain.structure.nodes @ Q.T)
        other = tc.find_equilibrium(tc.Scene(structure=there), start=plain.nodes @ Q.T)
        load = rng.standard_normal(plain.nodes.shape)
        assert displacement_under(other, load @ Q.T) == pytest.approx(displacement_under(plain, load) @ Q.T, abs=1e-11)

    def test_loads_that_nothing_holds(self, free):
        _, rest, _ = free
        with pytest.raises(tc.EquilibriumError, match="moves the free structure along translation z"):
            displacement_under(rest, np.tile([0.0, 0.0, 1.0], (12, 1)))
        with pytest.raises(tc.EquilibriumError, match=r"loads have shape \(3,\)"):
            displacement_under(rest, np.zeros(3))


def resettled_balanced(rest, load):
    """Tendon lengths under a self-balanced load on a free structure, kept in balance by springs to nothing.

    Newton on the bordered system: the rigid-body part of the load is taken away at every step, as the compliance does.
    """
    nodes = rest.nodes
    forces = rest.potential.members.forces + load
    potential = replaced(rest.potential, members=replaced(rest.potential.members, forces=forces))
    for _ in range(12):
        point = potential.at(nodes, rest.rest_lengths)
        mass = potential.manifold.mass(potential.members.mass)
        rigid = mass[:, None] * Equilibrium(rest.potential, nodes, rest.rest_lengths, 0).spectrum.rigid.basis
        H, border = point.hessian.toarray(), 100 * rigid
        K = np.block([[H, border], [border.T, np.zeros((6, 6))]])
        step = np.linalg.solve(K, np.r_[-point.gradient, np.zeros(6)])[: len(H)]
        nodes = potential.manifold.retract(nodes, step)
    ends = rest.structure.tendons
    return np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)


class TestInverse:
    @pytest.mark.parametrize("tendons", LAWS, ids=["k", "EA"])
    @pytest.mark.parametrize("scene", TestInfluence.SCENES, ids=["pinned", "hanging", "class 2", "free"])
    def test_an_equilibrium_needs_no_change(self, scene, tendons):
        rest = tc.find_equilibrium(shell_scene(**({"tendons": tendons} | scene)))
        held = inverse_statics(rest.potential, rest.nodes, tension_min=0.5 * rest.tensions.min())
        held.verify()
        assert np.abs(held.change).max() < 1e-11
        assert held.tensions == pytest.approx(rest.tensions, rel=1e-9)

    @pytest.mark.parametrize("tendons", LAWS, ids=["k", "EA"])
    @pytest.mark.parametrize("goal", ["rest lengths", "least norm"])
    def test_rest_lengths_hold_the_nodes(self, tendons, goal):
        """Newton, started at the nodes with these rest lengths, stays there."""
        rest = tc.find_equilibrium(shell_scene(3, 2, cls=2, tendons=tendons))
        held = inverse_statics(rest.potential, rest.nodes, tension_min=1.1 * rest.tensions.min(), goal=goal)
        held.verify(1e-10)
        assert held.residual < 1e-12
        again = resettled(rest, held.rest_lengths)
        assert np.abs(again.nodes - rest.nodes).max() < 1e-10
        assert again.tensions.min() >= 1.1 * rest.tensions.min() * (1 - 1e-9)
        assert np.abs(held.change).max() > 1e-3

    @pytest.mark.parametrize("tendons", LAWS, ids=["k", "EA"])
    def test_least_change_is_that_of_another_solver(self, tendons):
        """The same statement over the self-stress basis, minimised without its convexity being used."""
        scene = shell_scene(3, 2, cls=2, tendons=tendons)
        rest = tc.find_equilibrium(scene)
        members, floor = rest.potential.members, 1.2 * rest.tensions.min()
        held = inverse_statics(rest.potential, rest.nodes, tension_min=floor)
        basis = self_stress(rest.structure, rest.nodes, rank_tol=1e-9).tendon_basis
        k, length = members.stiffness, rest.lengths

        def change(a):
            T = basis @ a
            L = length - T / k if members.law == "k" else k * length / (k + T)
            return 1e3 * np.sum((L - members.rest_lengths) ** 2)

        start = np.linalg.lstsq(basis, rest.tensions * 1.3, rcond=None)[0]
        limits = {"type": "ineq", "fun": lambda a: basis @ a - floor, "jac": lambda a: basis}
        other = scipy.optimize.minimize(change, start, constraints=limits, options={"ftol": 1e-14, "maxiter": 1000})
        ours = 1e3 * np.sum(held.change**2)
        assert ours == pytest.approx(other.fun, rel=1e-5)
        assert ours <= other.fun * (1 + 1e-9)

    def test_wanted_tensions(self):
        rest = tc.find_equilibrium(shell_scene(3, 2, cls=2))
        held = inverse_statics(rest.potential, rest.nodes, tension_min=1.0, goal="nearest", wanted=2.0 * rest.tensions)
        held.verify(1e-12)
        assert held.tensions == pytest.approx(2.0 * rest.tensions, rel=1e-9)

    def test_rest_length_floors_are_kept(self):
        """Wanted tensions that would take half of the rest lengths below 0.9 L0 are cut there, and balance holds."""
        rest = tc.find_equilibrium(shell_scene(3, 2, cls=2, actuators={"floor": 0.9}))
        wanted = {"goal": "nearest", "wanted": 3.0 * rest.tensions, "tension_min": 1.0}
        held = inverse_statics(rest.potential, rest.nodes, **wanted)
        held.verify(1e-11)
        over = held.rest_lengths / rest.potential.members.rest_lengths
        assert over.min() == pytest.approx(0.9, abs=1e-12)
        assert held.tensions.max() < 3.0 * rest.tensions.max()

    def test_slack_tendons_stay_as_they_are(self):
        """With a floor of 0 N, a rest with slack tendons needs no change either."""
        rest = tc.find_equilibrium(shell_scene(pins=["P1_1_1"], gravity={}))
        assert (rest.tensions == 0).any()
        held = inverse_statics(rest.potential, rest.nodes, tension_min=0.0)
        held.verify()
        assert np.abs(held.change).max() < 1e-11

    def test_tendons_without_actuator_keep_their_rest_length(self):
        rest = tc.find_equilibrium(shell_scene(3, 2, cls=2, actuators={"tendons": ["t5_*", "t8_*", "t1_*", "t2_*"]}))
        held = inverse_statics(rest.potential, rest.nodes, tension_min=1.0, actuated_only=True)
        held.verify()
        kept = ~rest.potential.members.actuated
        assert kept.sum() > 10
        assert np.abs(held.change[kept]).max() == 0.0
        with pytest.raises(tc.EquilibriumError, match="has no actuator and carries"):
            inverse_statics(rest.potential, rest.nodes, tension_min=2 * rest.tensions.max(), actuated_only=True)

    def test_grounded_tendons_keep_their_rest_length(self, mast):
        _, rest, _ = mast
        held = inverse_statics(
            rest.potential, rest.nodes, tension_min=1.5 * rest.tensions[~rest.structure.grounded_tendons].min()
        )
        held.verify()
        grounded = rest.structure.grounded_tendons
        assert grounded.sum() == 3
        assert np.abs(held.change[grounded]).max() == 0.0

    def test_shapes_that_cannot_be_held(self):
        with pytest.raises(tc.EquilibriumError, match=r"no prestress holds these nodes.*nearest_shape"):
            inverse_statics(Potential.of(shell_scene()), tension_min=1.0)

    def test_bad_input(self, mast):
        _, rest, _ = mast
        with pytest.raises(tc.EquilibriumError, match=r"rod .* is .* m long but .*rods are rigid"):
            inverse_statics(rest.potential, rest.nodes * 1.001, tension_min=1.0)
        with pytest.raises(tc.EquilibriumError, match=r"move a pinned node by 0\.1 m"):
            inverse_statics(rest.potential, rest.nodes + np.array([0.1, 0, 0]), tension_min=1.0)
        with pytest.raises(tc.EquilibriumError, match='goal is "least"'):
            inverse_statics(rest.potential, rest.nodes, tension_min=1.0, goal="least")

    def test_verify_tells_wrong_rest_lengths(self, free):
        _, rest, _ = free
        held = inverse_statics(rest.potential, rest.nodes, tension_min=1.0)
        with pytest.raises(tc.EquilibriumError, match="no equilibrium"):
            replaced(held, rest_lengths=held.rest_lengths * np.linspace(0.99, 1.01, 24)).verify()
        with pytest.raises(tc.EquilibriumError, match="tensions differ"):
            replaced(held, rest_lengths=held.rest_lengths - 0.01 * held.tensions / 100.0).verify()


class TestNearest:
    @pytest.mark.parametrize("tendons", LAWS, ids=["k", "EA"])
    def test_prism_turned_too_far(self, tendons):
        """The nearest is a prism at its own twist: found again over its radii and turn alone, rods kept."""
        scene = prism_scene(3, twist=2.5, tendons=tendons)
        found = nearest_shape(Potential.of(scene), tension_min=1.0, tension_max=50.0)
        found.verify()
        wanted = tc.prism(3, twist=2.5).nodes
        rod = np.sum((wanted[3] - wanted[0]) ** 2)

        def nodes(x):
            lower, upper, turn, rise = x
            base = turn + 2 * np.pi * np.arange(3) / 3
            height = np.sqrt(rod - lower**2 - upper**2 + 2 * lower * upper * np.cos(5 * np.pi / 6))
            low = np.column_stack([lower * np.cos(base), lower * np.sin(base), np.full(3, rise)])
            top = base + 5 * np.pi / 6
            return np.vstack(
                [low, np.column_stack([upper * np.cos(top), upper * np.sin(top), np.full(3, rise + height)])]
            )

        def far(x):
            return np.sum((nodes(x) - wanted) ** 2)

        best = scipy.optimize.minimize(far, [1.0, 1.0, 0.0, 0.0], options={"gtol": 1e-12})
        assert found.distance == pytest.approx(np.sqrt(best.fun), rel=1e-8)
        assert found.stationarity < 1e-7
        assert found.equilibrium.stable

    def test_what_can_be_held_is_found_again(self, mast):
        _, rest, _ = mast
        found = nearest_shape(rest.potential, rest.nodes, tension_min=0.9 * rest.tensions.min(), tension_max=50.0)
        found.verify()
        assert found.distance < 1e-6

    @pytest.mark.parametrize("scene", TestInfluence.SCENES, ids=["pinned", "hanging", "class 2", "free"])
    def test_no_known_equilibrium_is_nearer(self, scene):
        """The wanted shape is not held; the scene's own rest is, and the nearest found from there is no farther."""
        rest = tc.find_equilibrium(shell_scene(**scene))
        wanted = rest.structure.nodes * [1.0, 1.0, 1.05]
        wanted[rest.structure.pinned] = rest.structure.nodes[rest.structure.pinned]
        limits = {"tension_min": 0.99 * rest.tensions.min(), "tension_max": 1.01 * rest.tensions.max()}
        found = nearest_shape(rest.potential, wanted, start=rest, **limits)
        found.verify()
        assert found.distance < np.linalg.norm(rest.nodes - wanted)
        assert found.stationarity < 1e-6

    @pytest.mark.parametrize("tendons", LAWS, ids=["k", "EA"])
    def test_rest_length_floors_end_the_search(self, tendons):
        """Without tension_max the nearest shape takes some rest lengths to their floors, and is stationary there."""
        scene = shell_scene(pins=["P1_*_1"], tendons=tendons, actuators={"floor": 0.5})
        potential = Potential.of(scene)
        found = nearest_shape(potential, tension_min=1.0)
        found.verify()
        over = found.equilibrium.rest_lengths / potential.members.floors
        assert over[~potential.structure.grounded_tendons].min() == pytest.approx(1.0, abs=1e-6)
        assert found.equilibrium.tensions.min() == pytest.approx(1.0, abs=1e-6)

    def test_verify_tells_a_shape_that_is_not_the_nearest(self, free):
        """Another equilibrium is held as well, but farther."""
        _, rest, _ = free
        limits = {"tension_min": 1.0, "tension_max": 50.0}
        found = nearest_shape(rest.potential, start=rest, **limits)
        with pytest.raises(tc.EquilibriumError, match="not the nearest"):
            replaced(found, equilibrium=rest).verify()
        with pytest.raises(tc.EquilibriumError, match="below tension_min"):
            replaced(found, tension_min=found.tension_min + 100.0).verify()

    def test_loads_that_no_shape_holds(self):
        potential = Potential.of(shell_scene(loads={"P4_1_1": [0.0, 0.0, 1.0]}))
        with pytest.raises(tc.EquilibriumError, match="no shape near the wanted one"):
            nearest_shape(potential, tension_min=1.0, tension_max=50.0, max_iterations=60)
