"""Sampled LQR and LQG by harmonics are the dense ones: gains, costs, poles, commands, runs; certificates, refusals."""

import numpy as np
import pytest
from harmonic_support import DAMPED, dense_and_harmonic, relative
from support import random_motion, replaced, shell_scene, solved

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis import Reading

OWN = {f"g{i}": {f"t5_{i}_1": 1.0, f"t6_{i % 5 + 1}_1": 0.5} for i in range(1, 6)}
DRIVEN = {"pins": ["P1_*_1"], "actuators": {"tendons": ["t1_*", "t3_*", "t4_*"], "gangs": OWN}}
DT = 0.02
CASES = {
    "free (3,1)": ((3, 1), {}, {"lengths": 1e-3}),
    "free (4,1)": ((4, 1), {}, {"lengths": 1e-3, "tensions": 0.1}),
    "pinned, damped, dragged (4,1)": (
        (4, 1), {"pins": ["P1_*_1"], **DAMPED}, {"tensions": {"t5_*": 0.05}, "nodes": {"P4_*": 1e-3}},
    ),
    "motors over two sectors, pinned (5,1)": ((5, 1), DRIVEN, {"lengths": 1e-3}),
}  # fmt: skip


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def both(request):
    return dense_and_harmonic(*request.param)


@pytest.fixture(scope="module")
def small():
    """The pinned (4,1) shell: dynamics, equilibrium, dense model, harmonics, sensors."""
    dynamics, rest, linear = solved(shell_scene(4, 1, pins=["P1_*_1"]))
    return dynamics, rest, linear, tc.harmonics(dynamics, rest), tc.sensors(dynamics.structure, lengths=1e-3, seed=3)


class TestSampledLQR:
    def test_agrees_with_the_dense_design(self, both):
        linear, model, _ = both
        found, wanted = tc.harmonic_lqr(model, dt=DT), tc.lqr(linear, dt=DT)
        K, P = found.dense(linear)
        assert relative(K, wanted.K) < 1e-11
        assert relative(P, wanted.P) < 1e-11
        assert found.slowest == pytest.approx(wanted.slowest, rel=1e-8)
        found.verify(1e-12)

    def test_commands_are_those_of_the_dense_design(self, both, rng):
        linear, model, _ = both
        nodes, velocities = random_motion(linear.equilibrium.potential, rng, reach=0.02)
        nothing = np.zeros(len(linear.dynamics.structure.tendons))
        seen = Measurement(nodes, 0.01 * velocities, nothing, nothing, 1e-3 * rng.standard_normal(model.nu))
        found, wanted = (design.step(0.0, seen) for design in (tc.harmonic_lqr(model, dt=DT), tc.lqr(linear, dt=DT)))
        assert relative(found, wanted) < 1e-11

    def test_residual_is_that_of_the_whole_structure(self, small):
        _, _, linear, model, _ = small
        found = tc.harmonic_lqr(model, dt=DT)
        wrong = replaced(found, blocks=tuple(replaced(own, P=1.001 * own.P) for own in found.blocks))
        dense = tc.lqr(linear, dt=DT)
        dense = replaced(dense, P=1.001 * dense.P)
        with pytest.raises(tc.SynthesisError, match="the Riccati residual is") as fault:
            dense.verify()
        with pytest.raises(tc.SynthesisError) as other:
            wrong.verify()
        assert str(other.value) == str(fault.value)

    def test_an_unstable_gain(self, small):
        found = tc.harmonic_lqr(small[3], dt=DT)
        first, second, third = found.blocks
        wrong = replaced(found, blocks=(first, replaced(second, K=-9 * second.K), third))
        with pytest.raises(tc.SynthesisError, match="a pole of the sampled loop of harmonic 1 is not stable"):
            wrong.verify()
        with pytest.raises(tc.SynthesisError, match="dt is -1; expected a finite number > 0"):
            tc.harmonic_lqr(small[3], dt=-1)


class TestLQG:
    @pytest.mark.parametrize("dt", [None, DT])
    def test_agrees_with_the_dense_design(self, both, dt):
        """The cost that noise keeps up comes from the loop's own Lyapunov equation, so it tells of every block."""
        linear, model, eyes = both
        found, wanted = tc.harmonic_lqg(model, eyes, dt=dt), tc.lqg(linear, eyes, dt=dt)
        assert relative(found.regulator.dense(linear)[0], wanted.regulator.K) < 1e-11
        assert relative(found.filter.dense(linear)[0], wanted.filter.gain) < 1e-11
        assert found.expected_cost == pytest.approx(wanted.expected_cost, rel=1e-10)
        assert found.slowest == pytest.approx(wanted.slowest, rel=1e-8)
        found.verify(1e-11)

    def test_commands_are_those_of_the_dense_design(self, both, rng):
        linear, model, eyes = both
        rest = linear.equilibrium
        found, wanted = tc.harmonic_lqg(model, eyes, dt=DT), tc.lqg(linear, eyes, dt=DT)
        for _ in range(4):
            values = eyes.of(rest) + eyes.noise * rng.standard_normal(eyes.noise.size)
            seen = Reading(values, rest.inputs + 1e-3 * rng.standard_normal(model.nu))
            assert relative(found.step(0.0, seen), wanted.step(0.0, seen)) < 1e-10
        found.reset()
        wanted.reset()
        assert relative(found.step(0.0, seen), wanted.step(0.0, seen)) < 1e-11

    @pytest.mark.parametrize("dt", [None, DT])
    def test_margins_are_those_of_the_whole_loop(self, small, dt):
        """Both enclose the same H-infinity norm; full-size and harmonic Hamiltonians know nothing of each other."""
        _, _, linear, model, eyes = small
        least, largest = tc.harmonic_lqg(model, eyes, dt=dt).enclosure()
        other_least, other_largest = tc.lqg(linear, eyes, dt=dt).loop.sensitivity.enclosure()
        assert max(least, other_least) <= min(largest, other_largest) * (1 + 1e-9)
        assert largest - least < 1e-4 * least

    @pytest.mark.parametrize("dt", [None, DT])
    def test_margins_of_one_input_are_those_of_the_whole_loop(self, dt):
        """With motors that come back to themselves after one turn beside tendons of every sector."""
        given = DRIVEN | {"actuators": {"tendons": ["t1_*", "t4_*"], "gangs": {"ring": {"t6_*": 1.0}}}}
        linear, model, eyes = dense_and_harmonic((4, 1), given, {"lengths": 1e-3})
        assert len(model.map.shared) == 1
        margin, which = tc.harmonic_lqg(model, eyes, dt=dt).sensitivity.weakest_input
        each = tc.lqg(linear, eyes, dt=dt).sensitivity.each_input
        assert margin.alpha == pytest.approx(min(one.alpha for one in each), rel=1e-5)
        assert each[which].alpha <= margin.largest

    def test_runs_and_goes_on_from_its_memory(self, small, rng):
        """On the nonlinear structure in step with the dense design; its state restores to the last bit."""
        dynamics, rest, linear, model, eyes = small
        found, wanted = tc.harmonic_lqg(model, eyes, dt=DT), tc.lqg(linear, eyes, dt=DT)
        start = rest.potential.manifold.retract(rest.nodes, 0.003 * rng.standard_normal(rest.potential.manifold.size))
        runs = [tc.simulate(dynamics, start, controller=c, t_end=0.4, timepts=[0.0, 0.4]) for c in (found, wanted)]
        assert np.abs(runs[0].nodes - runs[1].nodes).max() < 1e-9
        assert np.abs(runs[0].inputs[-1]).max() > 1e-4
        memory, seen = found.state(), eyes.read(rest, 20)
        first = found.step(0.4, seen)
        found.restore(memory)
        assert np.array_equal(found.step(0.4, seen), first)
        assert all(array.dtype == float for array in memory.values())

    def test_refusals(self, small):
        _, rest, _, model, eyes = small
        with pytest.raises(tc.SynthesisError, match="designed in continuous time"):
            tc.harmonic_lqg(model, eyes).step(0.0, eyes.read(rest, 0))
        with pytest.raises(tc.SynthesisError, match=r"LQG is shown what its [0-9]+ sensors read"):
            tc.harmonic_lqg(model, eyes, dt=DT).step(0.0, rest)

    def test_an_unstable_loop_is_seen(self, small):
        found = tc.harmonic_lqg(small[3], small[4], dt=DT)
        first, *others = found.estimators
        wrong = replaced(found, estimators=(replaced(first, C=-first.C), *others))
        with pytest.raises(tc.SynthesisError, match="the closed loop of harmonic 0 is not stable"):
            wrong.verify()
