"""LQG: dual of LQR, separation, noise that costs what was computed, margins that hold, only sensors are seen."""

import control
import numpy as np
import pytest
import scipy.linalg
from support import replaced, shell_scene, solved

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis import Reading
from tensctl.synthesis.crossed import optimal
from tensctl.synthesis.kalman import kalman, white_forces
from tensctl.synthesis.lyapunov import h2_norm, lyapunov
from tensctl.synthesis.over_period import integral
from tensctl.synthesis.weights import Cost


@pytest.fixture(scope="module")
def eyes(mast):
    return tc.sensors(mast[0].structure, lengths=1e-3, tensions={"t5_*": 0.05}, nodes={"P4_1_1": 2e-3}, seed=7)


@pytest.fixture(scope="module", params=[None, 0.02], ids=["continuous", "sampled"])
def design(request, mast, eyes):
    return tc.lqg(mast[2], eyes, dt=request.param)


@pytest.fixture(scope="module")
def running(mast, eyes):
    return tc.lqg(mast[2], eyes, dt=0.02)


class TestFilter:
    def system(self, rng):
        A, C = rng.standard_normal((5, 5)) / 2, rng.standard_normal((2, 5))
        G, V = rng.standard_normal((5, 5)), np.diag(rng.uniform(0.5, 2, 2))
        return A, C, G @ G.T, V

    def test_agrees_with_lqe(self, rng):
        A, C, W, V = self.system(rng)
        ours = kalman(A, C, W, V)
        gain, X, _ = control.lqe(A, np.eye(5), C, W, V)
        assert np.abs(ours.gain - gain).max() < 1e-9 * np.abs(gain).max()
        assert np.abs(ours.X - X).max() < 1e-9 * np.abs(X).max()
        assert ours.residual < 1e-14

    def test_agrees_with_dlqe(self, rng):
        """python-control's gain corrects the prediction, F X C'(CXC' + V)^-1; ours the estimate."""
        F, C, W, V = self.system(rng)
        ours = kalman(F, C, W, V, sampled=True)
        gain, X, _ = control.dlqe(F, np.eye(5), C, W, V)
        assert np.abs(F @ ours.gain - gain).max() < 1e-9 * np.abs(gain).max()
        assert np.abs(ours.X - X).max() < 1e-9 * np.abs(X).max()

    def test_is_the_dual_of_lqr(self, rng):
        A, C, W, V = self.system(rng)
        assert np.abs(kalman(A, C, W, V).gain - optimal(A.T, C.T, Cost(W, V, np.zeros((5, 2)))).K.T).max() < 1e-13

    def test_forces_leave_momentum(self, free):
        """Trace of the intensity: with all modes it is that of J M^-1 J', whatever the basis."""
        dynamics, rest, linear = free
        W = white_forces(linear, 0.3)
        manifold = rest.potential.manifold
        J, mass = rest.point.tangent.toarray(), manifold.mass(dynamics.members.mass)
        assert np.trace(W) == pytest.approx(0.3**2 * (J**2 / mass).sum(), rel=1e-12)
        assert np.trace(white_forces(linear, {"P4_1_1": 0.3})) < np.trace(W) / 4

    def test_process_noise_of_a_period(self, rng):
        """What white noise leaves in a period: of the pure integrator W dt, of the oscillator it turns round."""
        A = np.array([[0.0, 2.0], [-2.0, 0.0]])
        left = integral(A.T, np.diag([0.0, 1.0]), np.pi)[1]
        assert np.abs(left - np.eye(2) * np.pi / 2).max() < 1e-13


class TestCertificate:
    def test_holds(self, design):
        design.verify(1e-12)
        assert design.left == ()
        assert design.order == 42

    def test_separation(self, design):
        """The loop's own spectrum, computed from both together, is that of regulator and filter."""
        assert design.separation < 1e-9
        assert replaced_loop_is_seen(design)

    def test_covariance_of_the_filter_is_that_of_the_loop(self, design):
        """E (z - estimate)(...)' from the loop's Lyapunov equation: the Riccati solution (updated, when sampled)."""
        n, X = 42, design.covariance.X
        pick = np.hstack([np.eye(n), np.zeros((n, X.shape[0] - 2 * n)), -np.eye(n)])
        C, P = design.plant.C, design.filter.X
        wanted = P if design.dt is None else P - design.filter.gain @ C @ P
        assert np.abs(pick @ X @ pick.T - wanted).max() < 1e-9 * np.abs(wanted).max()

    def test_expected_cost_by_two_formulas(self, mast, eyes):
        """tr(P W) + tr(X K'RK) = tr(X Q) + tr(P L V L'), and both are the loop's."""
        design = tc.lqg(mast[2], eyes)
        P, X, K, L = design.regulator.P, design.filter.X, design.regulator.K, design.filter.gain
        W, V, Q, R = design.filter.W, design.filter.V, design.cost.Q, design.cost.R
        first = np.trace(P @ W) + np.trace(X @ K.T @ R @ K)
        second = np.trace(X @ Q) + np.trace(P @ L @ V @ L.T)
        assert first == pytest.approx(second, rel=1e-10)
        assert design.expected_cost == pytest.approx(first, rel=1e-9)

    def test_sampled_noise_is_what_a_march_shows(self, running):
        """Standard deviations of the inputs in 4000 periods of the linear loop, to 5 %."""
        rng, loop = np.random.default_rng(5), running.loop
        w = rng.multivariate_normal(np.zeros(42), running.filter.W, 4000, method="cholesky")
        v = rng.standard_normal((4000, running.sensors.noise.size)) * running.sensors.noise
        x, asked = np.zeros(len(loop.A)), []
        for push, error in zip(w, v, strict=True):
            x = loop.A @ x + loop.pushed @ push + loop.misread @ error
            asked.append(loop.asked @ x)
        wanted = np.sqrt(np.trace(loop.asked @ running.covariance.X @ loop.asked.T))
        assert np.sqrt((np.array(asked[200:]) ** 2).sum(axis=1).mean()) == pytest.approx(wanted, rel=0.05)

    def test_faults_are_seen(self, design):
        with pytest.raises(tc.SynthesisError, match="filter's Riccati residual is"):
            replaced(design, filter=replaced(design.filter, residual=1e-3)).verify()
        wrong = replaced(design.estimator, C=-design.estimator.C, direct=design.estimator.direct)
        with pytest.raises(tc.SynthesisError, match="not stable"):
            replaced(design, estimator=wrong).verify()


def replaced_loop_is_seen(design):
    """A gain changed behind the certificate's back moves the loop's poles off the two spectra."""
    wrong = replaced(design, estimator=replaced(design.estimator, C=1.05 * design.estimator.C))
    return wrong.separation > 1e-4


def test_h2_norm_by_quadrature():
    """Of a lightly damped pair, against the integral of |G|^2 over frequency; and of its sampled response."""
    A = np.array([[0.0, 3.0, 0], [-3.0, -0.4, 1.0], [0, 0, -2.0]])
    B, C = np.array([[0.0], [1.0], [0.5]]), np.array([[1.0, 0.2, 0.0]])

    def squared(w):
        return abs((C @ np.linalg.solve(1j * w * np.eye(3) - A, B))[0, 0]) ** 2

    half = scipy.integrate.quad(squared, 0, 200, limit=400)[0] + scipy.integrate.quad(squared, 200, np.inf)[0]
    assert h2_norm(A, B, C) == pytest.approx(np.sqrt(half / np.pi), rel=1e-8)
    F = scipy.linalg.expm(0.1 * A)
    response = np.array([(C @ np.linalg.matrix_power(F, k) @ B)[0, 0] for k in range(1500)])
    assert h2_norm(F, B, C, sampled=True) == pytest.approx(np.linalg.norm(response), rel=1e-9)
    with pytest.raises(tc.SynthesisError, match="not stable"):
        lyapunov(-A, np.eye(3))


class TestMargins:
    def test_gain_at_the_border_is_the_border(self, design):
        """One input times its margin's own complex factor puts a pole on the boundary; half of the way does not."""
        whole, single = design.margins
        at = int(np.argmin([margin.alpha for margin in single]))
        margin = single[at]
        assert whole.alpha <= margin.largest
        loop, w = design.loop, 2 * np.pi * margin.frequency
        S = loop.sensitivity.at(w)[at, at]
        # (S - 1/2) delta = 1 with |delta| = alpha closes the loop u = f (...) with f = (1 + delta/2)/(1 - delta/2).
        delta = 1 / (S - 0.5)
        assert abs(delta) == pytest.approx(margin.largest, rel=1e-9)
        for share, lost in ((1.0, 0.0), (0.5, None)):
            factor = (1 + share * delta / 2) / (1 - share * delta / 2)
            A = loop.A + (factor - 1) * np.outer(loop.disturbed[:, at], loop.asked[at])
            point = 1j * w if design.dt is None else np.exp(1j * w * design.dt)
            gap = np.abs(np.linalg.eigvals(A.astype(complex)) - point).min()
            assert (gap < 1e-8) if lost == 0 else (gap > 1e-3)

    def test_gains_within_the_margin_keep_the_loop(self, design, rng):
        whole, _ = design.margins
        low, high = whole.gain
        for _ in range(20):
            gains = rng.uniform(low, high, 21)
            A = design.loop.A + design.loop.disturbed @ ((gains - 1)[:, None] * design.loop.asked)
            poles = np.linalg.eigvals(A)
            assert (poles.real.max() < 0) if design.dt is None else (np.abs(poles).max() < 1)
        assert 0 < whole.phase < 90

    def test_agrees_with_python_control(self):
        """A loop with one input: 10/(s+1)^3/4 closed by its observer form equals control.disk_margins."""
        from tensctl.synthesis.margins import Sensitivity

        plant = control.ss(control.tf([2.0], [1, 3, 3, 1]))
        A = plant.A - plant.B @ plant.C
        ours = Sensitivity(A, plant.B, -plant.C, None).all_inputs
        found = control.disk_margins(plant, np.geomspace(1e-2, 1e2, 20000))
        assert ours.alpha == pytest.approx(float(np.asarray(found[0]).ravel()[0]), rel=1e-4)


class TestOnTheStructure:
    def start(self, mast, rng):
        return mast[1].potential.manifold.retract(mast[1].nodes, 0.01 * rng.standard_normal(21))

    def test_brings_it_to_rest_from_what_sensors_show(self, mast, running, rng):
        dynamics, rest, _ = mast
        run = tc.simulate(dynamics, self.start(mast, rng), controller=running, t_end=4.0)
        away = run.distance_to(rest.nodes)
        assert away[-50:].max() < 0.1 * away[0]
        run.verify()

    def test_estimate_is_the_state(self, mast, running, rng):
        """With sensors nearly free of noise the estimate follows the structure's own state."""
        dynamics, _, linear = mast
        sharp = tc.sensors(dynamics.structure, lengths=1e-5)
        design = tc.lqg(linear, sharp, dt=0.02)
        run = tc.simulate(dynamics, self.start(mast, rng), controller=design, t_end=3.0)
        x = linear.flexible.state_of(run.nodes[-1], run.velocities[-1])
        first = linear.flexible.state_of(run.nodes[0], run.velocities[0])
        assert np.linalg.norm(design.state()["estimate"] - x) < 0.02 * np.linalg.norm(first)

    def test_sees_sensors_only(self, mast, eyes):
        """What step() is given holds the reading and the inputs, and nothing of nodes or velocities."""
        dynamics, rest, _ = mast
        shown = []

        class Spy:
            dt, sensors = 0.02, eyes

            def reset(self):
                pass

            def step(self, t, measurement):
                shown.append(measurement)
                return measurement.inputs

        run = tc.simulate(dynamics, rest, controller=Spy(), t_end=0.1)
        assert {type(reading) for reading in shown} == {Reading}
        assert not hasattr(shown[0], "nodes")
        errors = np.stack([reading.values for reading in shown]) - eyes.of(rest)
        assert np.abs(errors / eyes.noise).max() < 5
        assert len(np.unique(errors)) == errors.size
        assert run.nodes.shape[0] == 6

    def test_noise_is_white_with_its_size(self, mast, eyes):
        _, rest, _ = mast
        drawn = np.stack([eyes.read(rest, k).values - eyes.of(rest) for k in range(4000)]) / eyes.noise
        assert np.abs(drawn.mean(axis=0)).max() < 0.08
        assert np.abs(drawn.std(axis=0) - 1).max() < 0.06
        assert np.abs((drawn[1:] * drawn[:-1]).mean(axis=0)).max() < 0.08

    def test_runs_repeat_and_differ_by_seed(self, mast, running):
        dynamics, rest, _ = mast
        once, again = (tc.simulate(dynamics, rest, controller=running, t_end=0.4) for _ in range(2))
        assert (once.nodes == again.nodes).all()
        other = replaced_seed(running, 8)
        assert not (tc.simulate(dynamics, rest, controller=other, t_end=0.4).nodes == once.nodes).all()

    def test_resumes_to_the_last_bit(self, mast, running, tmp_path):
        dynamics, rest, _ = mast
        whole = tc.simulate(dynamics, rest, controller=running, t_end=0.8, chunk=11, store=tmp_path / "whole.nc")

        class BrokenOffError(Exception):
            pass

        class Stops:
            def __init__(self):
                self.steps = 0

            def advance(self, n=1):
                self.steps += n
                if self.steps == 25:
                    raise BrokenOffError

        with pytest.raises(BrokenOffError):
            tc.simulate(
                dynamics, rest, controller=running, t_end=0.8, chunk=11, store=tmp_path / "cut.nc", progress=Stops()
            )
        tc.resume(dynamics, tmp_path / "cut.nc", controller=running)
        whole, cut = tc.Run.load(tmp_path / "whole.nc"), tc.Run.load(tmp_path / "cut.nc")
        assert (whole.nodes == cut.nodes).all()
        assert whole.time.size == cut.time.size == 41

    def test_free_structure_by_lengths(self, free):
        dynamics, _, linear = free
        design = tc.lqg(linear, tc.sensors(dynamics.structure, lengths=1e-3), dt=0.02)
        design.verify(1e-12)
        assert design.order == 48


def replaced_seed(design, seed):
    return replaced(design, sensors=replaced(design.sensors, seed=seed))


class TestOrder:
    def test_fewer_states_hold_the_loop(self, mast, eyes, rng):
        dynamics, rest, linear = mast
        full, less = tc.lqg(linear, eyes, dt=0.02), tc.lqg(linear, eyes, dt=0.02, order=24)
        assert less.order == 24
        less.verify(1e-11)
        assert less.loop.stability < 0
        assert full.expected_cost <= less.expected_cost < 10 * full.expected_cost
        start = rest.potential.manifold.retract(rest.nodes, 0.01 * rng.standard_normal(21))
        run = tc.simulate(dynamics, start, controller=less, t_end=6.0)
        assert run.distance_to(rest.nodes)[-50:].max() < 0.3 * run.distance_to(rest.nodes)[0]

    def test_full_order_is_the_full_controller(self, design, mast, eyes):
        same = tc.lqg(mast[2], eyes, dt=design.dt, order=42)
        assert same.expected_cost == pytest.approx(design.expected_cost, rel=1e-8)

    def test_too_few_are_refused_with_the_number_that_does(self, mast):
        loud = tc.sensors(mast[0].structure, lengths=1e-3)
        with pytest.raises(
            tc.SynthesisError, match=r"with 6 states the closed loop is not stable; with \d+ it is"
        ) as said:
            tc.lqg(mast[2], loud, dt=0.02, order=6, force_noise=1.0)
        enough = int(str(said.value).split("with ")[2].split()[0])
        assert tc.lqg(mast[2], loud, dt=0.02, order=enough, force_noise=1.0).loop.stability < 0
        with pytest.raises(tc.SynthesisError, match="order is 43; a whole number from 1 to 42"):
            tc.lqg(mast[2], loud, order=43)


class TestMistakes:
    @pytest.mark.parametrize(
        ("given", "sentence"),
        [
            ({}, "no sensor is given; measure lengths, tensions or nodes"),
            ({"lengths": 0.0}, "sensors.lengths is 0.0; expected a finite number > 0 .m"),
            ({"tensions": {"t5_*": -1.0}}, 'sensors.tensions."t5_\\*" is -1.0; expected a finite number > 0 .N'),
            ({"lengths": {"t77": 1.0}}, "t77"),
        ],
    )
    def test_sensors(self, mast, given, sentence):
        with pytest.raises(tc.TensctlError, match=sentence):
            tc.sensors(mast[0].structure, **given)

    def test_positions_of_a_free_structure(self, free):
        with pytest.raises(tc.SynthesisError, match="drift and turning"):
            tc.sensors(free[0].structure, nodes=1e-3)

    def test_continuous_designs_do_not_run(self, mast, eyes):
        with pytest.raises(tc.SynthesisError, match="designed in continuous time; give lqg a control period dt"):
            tc.simulate(mast[0], mast[1], controller=tc.lqg(mast[2], eyes), dt=0.02, t_end=0.1)

    def test_the_whole_state_is_not_read(self, mast, running):
        nothing = np.zeros(24)
        seen = Measurement(mast[1].nodes, 0 * mast[1].nodes, nothing, nothing, np.zeros(21))
        with pytest.raises(tc.SynthesisError, match=r"is shown what its [0-9]+ sensors read"):
            running.step(0.0, seen)

    def test_sensors_of_another_structure(self, mast, free):
        with pytest.raises(tc.SynthesisError, match="belong to another structure"):
            tc.lqg(mast[2], tc.sensors(free[0].structure, lengths=1e-3))

    def test_modes_that_no_sensor_tells_of(self, free):
        one = tc.sensors(free[0].structure, tensions={"t5_1_1": 0.01})
        with pytest.raises(tc.SynthesisError, match=r"mode \d+ at .* Hz .* is neither damped nor seen: symmetry"):
            tc.lqg(free[2], one, dt=0.02)
        design = tc.lqg(free[2], one, dt=0.02, stabilisable_only=True)
        assert len(design.left) == 8
        assert design.order == 32
        design.verify()


class TestExtremes:
    @pytest.mark.parametrize("noise", [1e-12, 1e-8, 1e-6, 1e-3, 1.0, 1e5])
    @pytest.mark.parametrize("dt", [None, 0.02])
    def test_sensor_noise(self, mast, noise, dt):
        """From a picometre to a hundred kilometres: verified, or refused with what to change."""
        eyes = tc.sensors(mast[0].structure, lengths=noise)
        if noise >= 1e-6:
            tc.lqg(mast[2], eyes, dt=dt).verify(1e-9)
        else:
            with pytest.raises(tc.SynthesisError, match="raise the noise"):
                tc.lqg(mast[2], eyes, dt=dt)

    def test_masses(self):
        dynamics, _, linear = solved(shell_scene(pins=["P1_*_1"], rods={"mass": {"*": 1.0, "r2_*": 1e8}}))
        tc.lqg(linear, tc.sensors(dynamics.structure, lengths=1e-3)).verify(1e-9)
