"""Discrete models are the continuous one between samples: held and ramping inputs, delays, stiff modes."""

import inspect
from itertools import pairwise

import mpmath
import numpy as np
import pytest
import scipy.integrate
from support import replaced, shell_scene, solved

import tensctl as tc
from tensctl.linear.propagate import responses, stretch

DELAYS = (0.0, 0.05, 0.13, 0.1, 0.02)


@pytest.fixture(scope="module", params=["undamped", "damped", "free, dragged"])
def linear(request):
    scene = {
        "undamped": shell_scene(pins=["P1_*_1"]),
        "damped": shell_scene(pins=["P1_*_1"], tendons={"damping": 1.5}),
        "free, dragged": shell_scene(drag={"coefficient": 0.3}),
    }[request.param]
    model = solved(scene)[2]
    return model if request.param != "free, dragged" else model.flexible


def applied(commands, dt, method, delay, t):
    """The input at time t, from commands made at k dt and none before 0."""
    late = (t - delay) / dt
    k = int(np.floor(late + 1e-9))
    before = commands[k - 1] if 1 <= k <= len(commands) else 0 * commands[0]
    now = commands[k] if 0 <= k < len(commands) else 0 * commands[0]
    return now if method == "zoh" else before + (late - k) * (now - before)


class TestAgainstTheContinuousModel:
    @pytest.mark.parametrize("method", ["zoh", "ramp"])
    @pytest.mark.parametrize("delay", DELAYS)
    def test_delayed_inputs(self, linear, rng, method, delay):
        """Nine periods against a fine integration of the delayed input, stopped at each of its corners."""
        dt, count = 0.05, 9
        nx, nu = linear.B.shape
        found = linear.sample(dt, method=method, delay=delay)
        commands, x = 0.01 * rng.standard_normal((count, nu)), rng.standard_normal(nx)
        z, y = np.concatenate([x, np.zeros(len(found.A) - nx)]), []
        corners = sorted({0.0, *(k * dt for k in range(count + 1)), *((k * dt + delay) for k in range(count))})
        corners = [t for t in corners if t <= count * dt + 1e-12]
        trace = {0.0: x}
        for a, b in pairwise(corners):
            if b - a > 1e-12:

                def rate(t, x, middle=0.5 * (a + b)):
                    when = middle if method == "zoh" else t
                    return linear.A @ x + linear.B @ applied(commands, dt, method, delay, when)

                x = scipy.integrate.solve_ivp(rate, (a, b), x, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
            trace[b] = x
        for k in range(count):
            y.append(found.C @ z + found.D @ commands[k])
            z = found.A @ z + found.B @ commands[k]
            exact = trace[min(trace, key=lambda t, k=k: abs(t - (k + 1) * dt))]
            assert np.abs(z[:nx] - exact).max() < 1e-9
        last = trace[min(trace, key=lambda t: abs(t - (count - 1) * dt))]
        here = applied(commands, dt, method, delay, (count - 1) * dt)
        assert y[-1] == pytest.approx(linear.C @ last + linear.D @ here, abs=1e-8)

    def test_whole_delays_are_shifts(self, linear):
        """y/u at z with d periods of delay is z^-d times that without."""
        dt, z = 0.05, 0.9 + 0.7j

        def transfer(m):
            return m.C @ np.linalg.solve(z * np.eye(len(m.A)) - m.A, m.B) + m.D

        for method in ("zoh", "ramp"):
            plain = transfer(linear.sample(dt, method=method))
            for d in (1, 3):
                late = transfer(linear.sample(dt, method=method, delay=d * dt))
                assert np.abs(late - plain / z**d).max() < 1e-10 * np.abs(plain).max()

    def test_ramp_is_that_of_the_controllers(self, linear):
        """The form that MPC and sampled LQR use, with the input as a state, has the same poles and response."""
        from tensctl.linear import sample_ramped

        found = linear.sample(0.05, method="ramp")
        A, B = sample_ramped(linear.A, linear.B, 0.05).with_input_state()
        assert np.abs(found.A - A).max() < 1e-11 * np.abs(A).max()
        assert np.abs(found.B - B).max() < 1e-11 * np.abs(B).max()

    def test_continuous_in_the_delay(self, linear):
        """A delay a little longer than whole periods has one more state and almost the same response."""
        z = 0.9 + 0.7j

        def transfer(delay):
            m = linear.sample(0.05, method="ramp", delay=delay)
            return m.C @ np.linalg.solve(z * np.eye(len(m.A)) - m.A, m.B) + m.D

        at, past, before = transfer(0.1), transfer(0.1 + 1e-7), transfer(0.1 - 1e-7)
        assert np.abs(past - at).max() < 1e-4 * np.abs(at).max()
        assert np.abs(before - at).max() < 1e-4 * np.abs(at).max()

    def test_verify_and_labels(self, linear):
        found = linear.sample(0.05, delay=0.08)
        found.verify()
        system = found.to_statespace()
        assert system.dt == 0.05
        assert system.input_labels == list(linear.inputs)
        assert system.output_labels == list(linear.outputs)
        assert len(set(system.state_labels)) == system.nstates == len(found.A)
        wrong = replaced(found, A=found.A * (1 + 1e-6))
        with pytest.raises(tc.LinearizationError, match="two half periods"):
            wrong.verify()


class TestStiff:
    """Five decades of frequency, 1 to 1e5 rad/s, in one model and one period."""

    @pytest.fixture
    def stiff(self):
        model = solved(shell_scene(pins=["P1_*_1"]))[2]
        omega2 = np.geomspace(1.0, 1e10, len(model.modes))
        return replaced(
            model, modes=tuple(replaced(m, omega2=float(w)) for m, w in zip(model.modes, omega2, strict=True))
        )

    def exact(self, z, t):
        """c0 ... c3 at 60 digits."""
        with mpmath.workdps(60):
            z, t = mpmath.mpf(z), mpmath.mpf(t)
            w = mpmath.sqrt(z)
            return [float(v) for v in (
                mpmath.cos(w * t), mpmath.sin(w * t) / w, (1 - mpmath.cos(w * t)) / z,
                (t - mpmath.sin(w * t) / w) / z)]  # fmt: skip

    @pytest.mark.parametrize("t", [1e-6, 1e-3, 0.02, 1.0])
    def test_closed_form(self, t):
        """Against 60 digits, for z of both signs and near 0: rounding, and rounding of the phase w t."""
        for z in (1e-12, 1e-4, 0.3, 1.0, 70.0, 1e4, 1e8, 1e10):
            for sign in (1, -1):
                if sign < 0 and np.sqrt(z) * t > 300:
                    continue
                wanted = self.exact(sign * z, t) if sign > 0 else self.grown(z, t)
                found = responses(np.array([sign * z]), t)
                phase = 1 + np.sqrt(z) * t
                bounds = [1.0, min(t, 1 / np.sqrt(z)), min(t**2, 1 / z), min(t**3, t / z)]
                for a, b, size in zip(found, wanted, bounds, strict=True):
                    assert abs(a[0] - b) < 8e-16 * phase * max(size, abs(b))

    def grown(self, z, t):
        with mpmath.workdps(60):
            z, t = mpmath.mpf(z), mpmath.mpf(t)
            w = mpmath.sqrt(z)
            return [float(v) for v in (
                mpmath.cosh(w * t), mpmath.sinh(w * t) / w, (mpmath.cosh(w * t) - 1) / z,
                (mpmath.sinh(w * t) / w - t) / z)]  # fmt: skip

    def test_slow_modes_keep_their_digits(self, stiff):
        """F, G0, G1 of a whole model, mode by mode: no mode knows how fast others are."""
        t, count = 0.5, len(stiff.modes)
        found = stretch(stiff, t)
        for k, mode in enumerate(stiff.modes):
            c0, c1, _, c3 = self.exact(mode.omega2, t)
            s, b = stiff.scales[k], stiff.B[count + k]
            phase = 1 + s * t
            exact = np.array([[c0, s * c1], [-mode.omega2 / s * c1, c0]])
            pair = np.ix_([k, count + k], [k, count + k])
            assert np.abs(found.F[pair] - exact).max() < 4e-16 * phase
            assert np.abs(found.G1[k] - b * s * c3 / t).max() < 1e-15 * phase * np.abs(b * s * c3 / t).max()
            held = (found.G0 + found.G1)[count + k]
            assert np.abs(held - b * c1).max() < 1e-15 * phase * np.abs(b).max() / s
        assert np.abs(found.F - found.F * np.kron(np.ones((2, 2)), np.eye(count))).max() == 0

    def test_nothing_overflows(self, stiff):
        for dt in (1e-9, 1e-3, 10.0, 1e4):
            found = stiff.sample(dt, method="ramp", delay=0.37 * dt)
            assert np.isfinite(found.A).all()
            assert np.abs(np.linalg.eigvals(found.A)).max() < 1 + 1e-9

    def test_stiff_dampers(self):
        """Poles from -0.5 to -1e5 1/s: against 40 digits, errors are rounding of the norm, and nothing overflows."""
        model = solved(shell_scene(pins=["P1_*_1"], tendons={"damping": {"*": 0.1, "t5_*": 2e4}}))[2]
        A, dt = model.A, 0.05
        assert -np.linalg.eigvals(A).real.min() > 5e4
        with mpmath.workdps(40):
            exact = mpmath.expm(mpmath.matrix(A.tolist()) * dt, method="taylor")
            wanted = np.array(exact.tolist(), float)
        found = model.sample(dt).A
        assert np.abs(found - wanted).max() < 1e-15 * np.linalg.norm(A * dt, 2)
        assert np.abs(np.linalg.eigvals(model.sample(100.0).A)).max() < 1


@pytest.mark.parametrize(
    ("given", "words"),
    [({"dt": 0.0}, "dt is 0"), ({"dt": 0.1, "delay": -1.0}, "delay -1"), ({"dt": 0.1, "method": "foh"}, 'is "foh"')],
)
def test_refusals(given, words):
    from tensctl.linear import sample

    model = solved(shell_scene(pins=["P1_*_1"]))[2]
    with pytest.raises(tc.LinearizationError, match=words):
        inspect.unwrap(sample)(model, **given)
