"""LQR by harmonics is the dense LQR: gain, cost, poles, commands; with its own certificate and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from harmonic_support import DAMPED, relative
from support import random_motion, shell_scene, solved

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis import care


def nearest(found, wanted):
    """Largest distance from a pole of either set to the other set."""
    gaps = np.abs(found[:, None] - wanted[None])
    return max(gaps.min(axis=0).max(), gaps.min(axis=1).max())


def shown(dynamics, nodes, velocities):
    nothing = np.zeros(len(dynamics.structure.tendons))
    return Measurement(nodes, velocities, nothing, nothing, np.zeros(dynamics.members.inputs.size))


@pytest.fixture(scope="module")
def small():
    """The free (4,2) shell: dynamics, equilibrium, dense model, harmonics and their LQR."""
    dynamics, rest, linear = solved(shell_scene(4, 2))
    model = tc.harmonics(dynamics, rest)
    return dynamics, rest, linear, model, tc.harmonic_lqr(model)


@pytest.mark.parametrize(
    ("size", "given"),
    [((3, 1), {}), ((4, 2), {}), ((6, 3), {}), ((8, 4), {}), ((4, 1), {"pins": ["P1_*_1"], **DAMPED})],
    ids=["(3,1)", "(4,2)", "(6,3)", "(8,4)", "pinned, damped, dragged, EA (4,1)"],
)
def test_agrees_with_the_dense_design(size, given):
    dynamics, rest, linear = solved(shell_scene(*size, **given))
    found, flexible = tc.harmonic_lqr(tc.harmonics(dynamics, rest)), linear.flexible
    R = np.diag(dynamics.members.stiffness / (dynamics.members.rest_lengths if given else 1.0))
    R = R[np.ix_(dynamics.members.inputs, dynamics.members.inputs)]
    wanted = care(flexible.A, flexible.B, np.eye(len(flexible.A)), R)
    K, P = found.dense(linear)
    assert relative(K, wanted.K) < 1e-12
    assert relative(P, wanted.X) < 1e-12
    poles = np.linalg.eigvals(flexible.A - flexible.B @ wanted.K)
    assert nearest(found.poles, poles) < 1e-10 * np.abs(poles).max()
    assert found.residual < 1e-15
    found.verify(1e-15)


def test_agrees_with_the_dense_design_for_any_symmetric_weights(small, rng):
    """Outputs weighed in the sector, and inputs that cost together with those of the next sector."""
    _, _, linear, model, _ = small
    n, p = model.map.inputs.shape
    Q = model.weight_of({"nodes": 3.0, "lengths": rng.uniform(1.0, 2.0, len(model.blocks[0].stretch))})
    own, next_one = rng.standard_normal((2, p, p))
    row = np.zeros((n, p, p))
    row[0] = own @ own.T + 100 * np.eye(p)
    row[1], row[-1] = next_one, next_one.T
    R = model.circulant(row)
    found = tc.harmonic_lqr(model, Q, R)

    bases, inputs = model.changed_basis(linear), model.map.waves(np.eye(model.nu))
    dense_Q = sum(b.copies * (T.conj().T @ M @ T).real for b, M, T in zip(model.blocks, Q, bases, strict=True))
    dense_R = np.zeros((n * p, n * p))
    for s in range(n):
        for t in range(n):
            dense_R[np.ix_(model.map.inputs[s], model.map.inputs[t])] = row[(t - s) % n]
    wanted = tc.lqr(linear, 0.5 * (dense_Q + dense_Q.T), dense_R)
    K, P = found.dense(linear)
    assert relative(K, wanted.K) < 1e-10
    assert relative(P, wanted.P) < 1e-10
    assert len(inputs) == len(model.blocks)
    found.verify(1e-12)


def test_residual_is_that_of_the_whole_structure(small):
    _, _, linear, _, design = small
    flexible, (_, P) = linear.flexible, design.dense(linear)
    B, stiffness = flexible.B, linear.dynamics.members.stiffness[linear.dynamics.members.inputs]

    def left_over(P):
        terms = (flexible.A.T @ P, P @ flexible.A, -P @ (B / stiffness) @ B.T @ P, np.eye(len(P)))
        return np.linalg.norm(sum(terms)) / sum(np.linalg.norm(term) for term in terms)

    assert left_over(P) < 1e-13
    wrong = replace(design, P=tuple(X * (1 + 1e-5) for X in design.P))
    _, wrong_P = wrong.dense(linear)
    with pytest.raises(tc.SynthesisError, match=f"the Riccati residual is {left_over(wrong_P):.1e}"):
        wrong.verify()


def test_commands_are_those_of_the_dense_design(small, rng):
    dynamics, rest, linear, _, design = small
    nodes, velocities = random_motion(rest.potential, rng, reach=0.02)
    measured = shown(dynamics, nodes, 0.01 * velocities)
    assert relative(design.step(0.0, measured), tc.lqr(linear).step(0.0, measured)) < 1e-11


def test_commands_stop_at_the_floors(small, rng):
    dynamics, rest, _, _, design = small
    nodes, velocities = random_motion(rest.potential, rng, speed=1e3)
    left = dynamics.members.rest_lengths - design.step(0.0, shown(dynamics, nodes, velocities))
    assert (left >= dynamics.members.floors * (1 - 1e-12)).all()
    assert (left < 1.01 * dynamics.members.floors).any()


def test_cost_to_go_is_the_dense_one(small, rng):
    _, rest, linear, model, design = small
    nodes, velocities = random_motion(rest.potential, rng, reach=0.02)
    x = linear.flexible.state_of(nodes, velocities)
    _, P = design.dense(linear)
    assert design.cost(model.state_of(nodes, velocities)) == pytest.approx(x @ P @ x, rel=1e-11)


def test_a_turned_motion_is_answered_by_the_turned_command(small, rng):
    """What is seen one sector on is asked for one sector on."""
    dynamics, rest, _, model, design = small
    nodes, velocities = random_motion(rest.potential, rng, reach=0.02)
    symmetry = model.map.point.sector.symmetry
    turn, image = symmetry.turns[1], np.empty(len(nodes), int)
    image[symmetry.nodes] = np.roll(symmetry.nodes, -1, axis=0)
    turned, turned_velocities = np.empty_like(nodes), np.empty_like(nodes)
    turned[image] = (nodes - symmetry.centre) @ turn.T + symmetry.centre
    turned_velocities[image] = velocities @ turn.T
    before = design.step(0.0, shown(dynamics, nodes, velocities))[model.map.inputs]
    after = design.step(0.0, shown(dynamics, turned, turned_velocities))[model.map.inputs]
    assert np.abs(np.roll(before, 1, axis=0) - after).max() < 1e-11 * np.abs(before).max()
    assert np.abs(before - after).max() > 0.1 * np.abs(before).max()


def test_sample_time_is_the_dense_one(small):
    _, _, linear, _, design = small
    assert design.dt == pytest.approx(tc.lqr(linear).dt, rel=1e-12)


def test_margins_are_those_of_the_whole_loop(small):
    """Both enclose the same H-infinity norm, from Hamiltonian matrices of different sizes."""
    _, _, linear, _, design = small
    least, largest = design.enclosure()
    other_least, other_largest = tc.lqr(linear).sensitivity.enclosure()
    assert max(least, other_least) <= min(largest, other_largest) * (1 + 1e-9)


def test_margins_of_one_input_are_those_of_the_whole_loop(small):
    """Sums over harmonics and the dense loop enclose one number, and name images of one tendon."""
    _, _, linear, model, design = small
    for found, dense in (
        (design, tc.lqr(linear)),
        (tc.harmonic_lqr(model, dt=0.02), tc.lqr(linear, dt=0.02)),
    ):
        margin, which = found.sensitivity.weakest_input
        each = dense.sensitivity.each_input
        assert margin.alpha == pytest.approx(min(one.alpha for one in each), rel=1e-5)
        assert each[which].alpha <= margin.largest
        assert margin.largest == pytest.approx(margin.alpha, rel=1e-5)


def test_brings_the_structure_to_rest(small, rng):
    """From a small disturbance, on the full nonlinear structure, in step with the dense design."""
    dynamics, rest, linear, _, design = small
    start = rest.potential.manifold.retract(rest.nodes, 0.003 * rng.standard_normal(rest.potential.manifold.size))
    run = tc.simulate(dynamics, start, controller=design, t_end=0.4, timepts=[0.0, 0.4])
    other = tc.simulate(dynamics, start, controller=tc.lqr(linear), t_end=0.4, timepts=[0.0, 0.4])
    size = [np.linalg.norm(linear.flexible.state_of(run.nodes[k], run.velocities[k])) for k in (0, -1)]
    assert size[1] < 0.8 * size[0]
    assert np.abs(run.nodes - other.nodes).max() < 1e-8


def test_a_size_that_no_dense_model_reaches():
    """(20,10), 3988 states: certified by its residual and by Lyapunov's inequality in every harmonic."""
    scene = shell_scene(20, 10, overlap=0.15)
    model = tc.harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))
    assert (model.nx, model.nu) == (3988, 1960)
    design = tc.harmonic_lqr(model)
    assert design.residual < 1e-14
    design.verify(1e-14)


class TestStiffness:
    @pytest.mark.parametrize("ratio", [1e3, 1e6])
    def test_one_kind_of_tendon_much_stiffer(self, ratio):
        tendons = {"stiffness": {"*": 100.0, "t5_*": 100.0 * ratio}, "rest_ratio": {"*": 0.8, "t5_*": 1 - 0.2 / ratio}}
        scene = shell_scene(4, 1, tendons=tendons)
        model = tc.harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))
        design = tc.harmonic_lqr(model)
        assert np.sqrt(model.omega2.max() / model.omega2.min()) > np.sqrt(ratio)
        assert design.residual < 1e-12
        design.verify(1e-12)


class TestRefusals:
    def test_weights(self, small):
        _, _, _, model, _ = small
        sizes = [block.nx for block in model.blocks]
        eyes = [np.eye(size) for size in sizes]
        with pytest.raises(tc.SynthesisError, match=r"Q has 2 blocks; 3 are expected"):
            tc.harmonic_lqr(model, eyes[:2])
        with pytest.raises(tc.SynthesisError, match=r"Q of harmonic 1 has shape \(3, 3\)"):
            tc.harmonic_lqr(model, [eyes[0], np.eye(3), eyes[2]])
        with pytest.raises(tc.SynthesisError, match=r"Q of harmonic 0 is not Hermitian; give \(Q \+ Q\*\)/2"):
            tc.harmonic_lqr(model, [np.triu(np.ones((sizes[0],) * 2)), *eyes[1:]])
        with pytest.raises(tc.SynthesisError, match="weights are never negative"):
            tc.harmonic_lqr(model, [-eye for eye in eyes])
        with pytest.raises(tc.SynthesisError, match="no finite numbers"):
            tc.harmonic_lqr(model, [eyes[0] * np.nan, *eyes[1:]])
        with pytest.raises(tc.SynthesisError, match="every input needs a positive cost"):
            tc.harmonic_lqr(model, R=np.zeros((18, 18)))

    def test_a_mode_without_drive(self):
        scene = shell_scene(4, 2, actuators={"tendons": ["t5_*_1"]})
        model = tc.harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))
        with pytest.raises(tc.SynthesisError, match=r"^harmonic \d: .* neither damped nor driven"):
            tc.harmonic_lqr(model)

    def test_no_input(self):
        scene = shell_scene(3, 1, actuators={"tendons": []})
        model = tc.harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))
        with pytest.raises(tc.SynthesisError, match="the model has 48 flexible states and 0 inputs"):
            tc.harmonic_lqr(model)

    def test_verify_tells_an_unstable_gain(self, small):
        design = small[-1]
        wrong = replace(design, K=(design.K[0], -design.K[1], design.K[2]))
        with pytest.raises(tc.SynthesisError, match="a closed-loop pole of harmonic 1 is not stable"):
            wrong.verify()


class TestPhysicalWeights:
    """`harmonic_weights` are the weights of `weights`, cross terms included."""

    SIZES = (
        {"energy": 1.0},
        {"energy": 2.0, "nodes": {"P*_2": 0.01}, "rest_lengths": {"*": 0.05, "t5_*": 0.02}},
        {"nodes": 0.01, "tensions": {"*": 5.0, "t1_*": 2.0}, "rest_lengths": 0.1},
    )

    @pytest.mark.parametrize("sizes", SIZES)
    def test_are_the_dense_ones(self, small, sizes):
        _, _, linear, model, _ = small
        found, wanted = tc.harmonic_weights(model, **sizes), tc.weights(linear, **sizes)
        bases, inputs = model.changed_basis(linear), model.map.waves(np.eye(model.nu))
        parts = list(zip(model.blocks, found, bases, inputs, strict=True))
        for name, pick in (("Q", (0, 0)), ("R", (1, 1)), ("N", (0, 1))):
            dense = sum(
                b.copies * np.real(pair[pick[0]].conj().T @ getattr(cost, name) @ pair[pick[1]])
                for b, cost, *pair in parts
            )
            scale = np.abs(wanted.matrix).max()
            assert np.abs(dense - getattr(wanted, name)).max() < 1e-12 * scale

    @pytest.mark.parametrize("dt", [None, 0.01])
    def test_give_the_dense_gain(self, small, dt):
        _, _, linear, model, _ = small
        found = tc.harmonic_lqr(model, cost=tc.harmonic_weights(model, **self.SIZES[2]), dt=dt)
        wanted = tc.lqr(linear, cost=tc.weights(linear, **self.SIZES[2]), dt=dt)
        K, P = found.dense(linear)
        assert relative(K, wanted.K) < 1e-9
        assert relative(P, wanted.P) < 1e-9
        found.verify(1e-11)

    def test_refusals(self, small):
        model = small[3]
        with pytest.raises(tc.SynthesisError, match="sizes of nodes are not the same in all sectors; give images"):
            tc.harmonic_weights(model, energy=1.0, nodes={"P1_1_1": 0.01})
        with pytest.raises(tc.SynthesisError, match="sizes of rest_lengths are not the same in all sectors"):
            tc.harmonic_weights(model, energy=1.0, rest_lengths={"*": 0.1, "t5_1_1": 0.2})
        with pytest.raises(tc.SynthesisError, match="some rest length costs nothing"):
            tc.harmonic_weights(model, nodes=0.01)
        with pytest.raises(tc.SynthesisError, match=r"tensions is -1.0; expected a finite number > 0"):
            tc.harmonic_weights(model, tensions=-1.0)
        with pytest.raises(tc.SynthesisError, match="weights are given twice"):
            tc.harmonic_lqr(model, R=np.eye(18), cost=tc.harmonic_weights(model, energy=1.0))
