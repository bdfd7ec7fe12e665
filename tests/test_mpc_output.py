"""Predictive control from sensors: the filter against dense equations, no offset with a wrong model, faults."""

from dataclasses import dataclass

import numpy as np
import pytest
from support import shell_scene, solved
from test_mpc import Rough

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis.disturbance import disturbed
from tensctl.synthesis.offset_filter import offset_filter
from tensctl.synthesis.sensors import Reading
from tensctl.synthesis.signal import Courses

DT = 0.02


@pytest.fixture(scope="module")
def eyes(mast):
    return tc.sensors(mast[0].structure, lengths=1e-4, tensions=1e-2, seed=1)


@pytest.fixture(scope="module")
def wrong(mast):
    """The mast with every stiffness 5 % off, at random up or down."""
    rest, labels = mast[0].members.rest_lengths, mast[0].structure.tendon_labels
    off = np.random.default_rng(0).choice([-0.05, 0.05], len(labels))
    stiffness = dict(zip(labels, (100 * (1 + off)).tolist(), strict=True))
    rest_length = dict(zip(labels, rest.tolist(), strict=True))
    return tc.build_dynamics(shell_scene(pins=["P1_*_1"], tendons={"stiffness": stiffness, "rest_length": rest_length}))


@pytest.fixture(scope="module")
def weak():
    return solved(shell_scene(
        4, 1, cls=2, pins=["P1_*_1"], gravity={"g": 1.0}, loads={"*P4_1_1*": [0.5, 0.2, 0.0]},
        tendons={"damping": 0.2, "rest_ratio": 0.85},
    ))  # fmt: skip


def late_errors(mast, dynamics, controller, **options):
    """Largest node error over the last 3 s, and of the mean over them."""
    nodes = mast[1].nodes
    run = tc.simulate(dynamics, (nodes, 0 * nodes), controller=controller, t_end=10.0, **options)
    mean = np.linalg.norm(run.nodes[-150:].mean(axis=0) - nodes, axis=1).max()
    return run.distance_to(nodes)[-150:].max(), mean


class TestNoOffset:
    def test_wrong_stiffness(self, mast, eyes, wrong):
        worst, mean = late_errors(mast, wrong, tc.OutputMPC(mast[2], eyes, horizon=10, tension_min=0.5))
        assert worst < 1e-3
        assert mean < 1e-4

    def test_without_disturbances_it_stays(self, mast, eyes, wrong):
        """The same controller whose disturbances do not move: what the other one takes away is there."""
        _, mean = late_errors(mast, wrong, tc.OutputMPC(mast[2], eyes, horizon=10, tension_min=0.5, drift=1e-7))
        assert mean > 5e-3


class TestWeakDirections:
    """Two directions of the lengths of a class 2 shell follow rest lengths by 1e-3 of what the best one does."""

    def test_a_push_is_calmed(self, weak):
        """3 N for 0.1 s; a target that takes all of a step's estimate at once swings by 0.1 m for good."""
        dynamics, rest, linear = weak
        eyes = tc.sensors(dynamics.structure, seed=1, lengths=1e-4, tensions=1e-2)
        controller = tc.OutputMPC(linear, eyes, horizon=8, tension_min=0.05)
        push = tc.Push(dynamics.structure.node_labels[-1], [3.0, 0.9, 0.0], 0.1, 0.2)
        run = tc.simulate(dynamics, rest, controller=controller, t_end=5.0, pushes=[push])
        assert run.distance_to(rest.nodes)[-100:].max() < 2e-3

    def test_a_target_that_stays_is_the_best_one(self, weak, rng):
        """Step by step it comes to the least squares of what is tracked, from the best directions on."""
        dynamics, _, linear = weak
        eyes = tc.sensors(dynamics.structure, seed=1, lengths=1e-4, tensions=1e-2)
        programme = (controller := tc.OutputMPC(linear, eyes, horizon=2)).programme
        wide, margin = np.full(28, 1e3), np.full_like(controller.margin_at_rest, 1e6)
        d, near, gain = rng.standard_normal(64), 1e-3 * rng.standard_normal(28), programme.gain
        best = near - np.linalg.pinv(gain) @ (programme.disturbed @ d + gain @ near)
        left, size = np.linalg.svd(gain, full_matrices=False)[:2]
        target, shares = None, []
        for _ in range(200):
            target = programme.at(d, np.zeros(32), near, (-wide, wide), margin, target)
            shares.append(np.abs(left.T @ gain @ (target.inputs - best)) / np.abs(left.T @ gain @ (near - best)))
        assert (shares[0][size > 0.1 * size[0]] < 0.1).all()
        assert (shares[0][size < 0.01 * size[0]] > 0.9).all()
        assert (np.diff(shares, axis=0)[:5, -2:] < 0).all()
        assert shares[-1][:-2].max() < 1e-5
        assert shares[-1][-2] < 0.9

    def test_prestress_of_a_path_is_followed_at_once(self, mast, eyes):
        """What shows in nothing tracked is as the path has it, without delay."""
        programme = (controller := tc.OutputMPC(mast[2], eyes, horizon=2)).programme
        still = np.linalg.svd(programme.gain)[2][-1]
        wide, margin = np.full(21, 1e3), np.full_like(controller.margin_at_rest, 1e6)
        first = programme.at(np.zeros(48), np.zeros(24), 0 * still, (-wide, wide), margin, None)
        moved = programme.at(np.zeros(48), np.zeros(24), 0.01 * still, (-wide, wide), margin, first)
        assert np.abs(moved.inputs - 0.01 * still).max() < 1e-9


class TestModel:
    def test_rank_condition(self, mast, eyes):
        model = disturbed(mast[2].flexible, eyes, DT)
        model.verify()
        assert model.forces == 20
        assert model.shown.shape == (48, 48)

    @pytest.mark.parametrize(("size", "force"), [(1e-3, 1.0), (1.0, 1e6), (1.0, 1e-6), (1e-3, 1e-3)])
    def test_rank_margin_is_the_same_in_all_units(self, mast, eyes, size, force):
        """A mast whose metre is `size` and whose newton is `force`, with sensors to match."""
        dynamics, _, linear = solved(shell_scene(
            pins=["P1_*_1"], radius=size, height=size, overlap=0.3 * size, rods={"mass": force / size},
            tendons={"stiffness": 100 * force / size},
        ))  # fmt: skip
        small = tc.sensors(dynamics.structure, lengths=1e-4 * size, tensions=1e-2 * force)
        model = disturbed(linear.flexible, small, DT)
        model.verify()
        assert model.forces == 20
        assert model.rank_margin == pytest.approx(disturbed(mast[2].flexible, eyes, DT).rank_margin, rel=1e-9)

    def test_each_disturbance_shows_as_one_deviation_at_rest(self, mast, eyes):
        """They show in orthogonal directions of the sensors in units of noise."""
        model = disturbed(mast[2].flexible, eyes, DT)
        seen = (model.C @ model.rest[1] + model.shown) / eyes.noise[:, None]
        assert np.abs(seen.T @ seen - np.eye(48)).max() < 1e-9


@pytest.fixture(scope="module")
def found(mast, eyes):
    return offset_filter(disturbed(mast[2].flexible, eyes, DT), 0.01, 1.0)


class TestFilter:
    def test_missing_rows_against_the_information_form(self, found, rng):
        """The posterior of a Gaussian: P^-1 + H'V^-1 H, and its mean, with the rows that are there only."""
        y = 1e-3 * rng.standard_normal(48)
        y[rng.random(48) < 0.4] = np.nan
        there = np.isfinite(y)
        before, mean, u = found.begin(), 1e-3 * rng.standard_normal(90), np.zeros(21)
        after = found.update(before, mean, y, u)
        H, noise = found.model.H[there], found.model.sensors.noise[there]
        information = np.linalg.inv(found.constant.X) + (H.T / noise**2) @ H
        P = np.linalg.inv(information)
        wanted = mean + P @ (H.T @ ((y[there] - H @ mean) / noise**2))
        ahead = found.model.F @ P @ found.model.F.T + found.W
        assert after.missing == (~there).sum()
        assert after.rejected == 0
        assert np.abs(after.mean - wanted).max() < 1e-6 * np.abs(wanted).max()
        assert np.abs(after.covariance - ahead).max() < 1e-6 * np.abs(ahead).max()

    def test_silence_lets_the_covariance_grow_and_speech_brings_it_back(self, found):
        silent, u = np.full(48, np.nan), np.zeros(21)
        after = found.update(found.begin(), np.zeros(90), silent, u)
        wanted = found.model.F @ found.constant.X @ found.model.F.T + found.W
        assert np.abs(after.covariance - wanted).max() < 1e-12 * np.abs(wanted).max()
        for _ in range(3000):
            after = found.update(after, found.predict(after, u, u), np.zeros(48), u)
            if after.covariance is None:
                break
        assert after.covariance is None

    def test_one_absurd_value_is_refused_and_a_lasting_one_believed(self, found):
        u, y = np.zeros(21), np.zeros(48)
        y[3] = 1.0
        after = found.update(found.begin(), np.zeros(90), y, u)
        assert after.rejected == 1
        assert np.abs(after.mean).max() < 1e-12
        for _ in range(8):
            after = found.update(after, found.predict(after, u, u), y, u)
        assert after.rejected == 5


@dataclass(frozen=True, eq=False)
class Faulty(tc.Sensors):
    """Sensors that drop values, fall silent and shout."""

    def read(self, state, sample):
        reading = super().read(state, sample)
        rng, values = np.random.default_rng([9, sample]), reading.values.copy()
        values[rng.random(values.size) < 0.1] = np.nan
        values[rng.random(values.size) < 0.01] = 1e6
        return Reading(np.full_like(values, np.nan) if sample % 50 > 46 else values, reading.inputs)


def test_faults_pushes_and_a_reference_that_cannot_be_reached(mast, eyes, wrong):
    dynamics, rest, linear = mast
    faulty = Faulty(**vars(eyes))
    controller = tc.OutputMPC(linear, faulty, horizon=5, path=Rough(rest, 0))
    rng = np.random.default_rng(4)
    pushes = [tc.Push("P4_*", 10 * rng.standard_normal(3), 0.4 * k, 0.4 * k + 0.05) for k in range(8)]
    run = tc.simulate(wrong, (rest.nodes, 0 * rest.nodes), controller=controller, t_end=4.0, pushes=pushes)
    assert np.isfinite(run.nodes).all()
    assert controller.estimate.missing > 48 * 10
    assert controller.estimate.rejected > 10
    assert controller.target.missed > 1
    assert (run.rest_lengths >= dynamics.members.floors * (1 - 1e-12)).all()
    rates = np.abs(np.diff(run.rest_lengths, axis=0)) / np.diff(run.time)[:, None]
    assert rates.max() <= controller.rate_max * (1 + 1e-9)


def test_goes_on_from_what_it_remembers(mast, eyes):
    """With a measurement missing on the way, so that the covariance is on the way too."""
    first, second = (tc.OutputMPC(mast[2], eyes, horizon=3, delay=0.5 * DT) for _ in range(2))
    for k in range(6):
        reading = eyes.read(mast[1], k)
        if k == 2:
            reading.values[5] = np.nan
        if k == 4:
            second.reset()
            second.restore({name: np.array(value) for name, value in first.state().items()})
        answer = first.step(DT * k, reading)
        if k >= 4:
            assert (second.step(DT * k, reading) == answer).all()


def test_refused(mast, eyes):
    with pytest.raises(tc.SynthesisError, match="48 sensors read"):
        tc.OutputMPC(mast[2], eyes, horizon=2).step(0.0, mast[1])
    with pytest.raises(tc.SynthesisError, match="drift is 0"):
        tc.OutputMPC(mast[2], eyes, horizon=2, drift=0)
    one = tc.sensors(mast[0].structure, lengths={"t5_1_1": 1e-3})
    with pytest.raises(
        tc.SynthesisError, match=r"mode 0 at 0\.8\d+ Hz \(and 6 more\) is neither damped nor seen: symmetry"
    ):
        tc.OutputMPC(mast[2], one, horizon=2)


LENGTH = {"lengths:t5_1_1": 1e-3}


class TestSignal:
    """Outputs that leave the target by a signal."""

    def test_a_measured_output_is_met_by_a_wrong_model(self, mast, eyes, wrong):
        """A length is to grow by 1 cm; control of the exact state by the same model misses it."""
        rest = mast[1]
        tendon = rest.structure.tendon_labels.index("t5_1_1")
        goal = rest.lengths[tendon] + 0.01
        options = {"horizon": 10, "weights": tc.Weights(outputs=LENGTH), "signal": lambda t: goal}
        missed = {}
        for controller in (tc.OutputMPC(mast[2], eyes, tension_min=0.5, **options), tc.MPC(mast[2], **options)):
            run = tc.simulate(wrong, (rest.nodes, 0 * rest.nodes), controller=controller, t_end=6.0)
            missed[type(controller)] = abs(run.lengths[-100:, tendon].mean() - goal)
        assert missed[tc.OutputMPC] < 5e-5
        assert missed[tc.MPC] > 20 * missed[tc.OutputMPC]

    @pytest.mark.parametrize("preview", [True, False])
    def test_at_rest_it_plans_as_with_the_state(self, mast, eyes, preview):
        """With nothing to estimate both are the same problem, courses and totals alike."""
        _, rest, linear = mast
        begin = rest.lengths[rest.structure.tendon_labels.index("t5_1_1")]
        options = {"horizon": 6, "weights": tc.Weights(outputs=LENGTH), "preview": preview}
        quiet = Reading(eyes.of(rest), rest.inputs)
        shown = Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, rest.tensions, rest.inputs)
        total, course = ([0.05, 0.15], [begin, begin + 0.01]), Courses({"l_t5_1_1": ([0.05, 0.15], [0.0, 0.01])})
        t = 0.08
        by_state = tc.MPC(linear, signal=total, **options).step(t, shown)
        assert np.abs(by_state).max() > 1e-3
        for signal in (total, course):
            by_output = tc.OutputMPC(linear, eyes, signal=signal, **options).step(t, quiet)
            assert np.abs(by_output - by_state).max() < 1e-9

    def test_on_a_path_the_signal_that_it_is_changes_nothing(self, mast, eyes):
        """In total, at every end of a period to come."""
        _, rest, linear = mast
        path = tc.plan_shape(shell_scene(pins=["P1_*_1"]), {"height_scale": 1.02, "duration": 0.4}, start=rest)
        tendon = rest.structure.tendon_labels.index("t5_1_1")

        def along(t):
            return rest.structure.lengths_at(path.nodes_at(t))[tendon]

        options = {"horizon": 4, "weights": tc.Weights(outputs=LENGTH), "path": path}
        quiet = Reading(eyes.of(rest), rest.inputs)
        with_signal = tc.OutputMPC(linear, eyes, signal=lambda t: np.vectorize(along)(t)[..., None], **options)
        difference = with_signal.step(0.2, quiet) - tc.OutputMPC(linear, eyes, **options).step(0.2, quiet)
        assert np.abs(difference).max() < 1e-10
