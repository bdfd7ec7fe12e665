"""LQR is optimal: certificate, cost to go, agreement with python-control, and a loop that holds the real structure."""

import control
import numpy as np
import pytest
import scipy.integrate
from support import random_motion, replaced, shell_scene, solved

import tensctl as tc
from tensctl.simulation import Measurement


@pytest.fixture(scope="module", params=["free", "mast"])
def linear(request):
    return request.getfixturevalue(request.param)[2]


@pytest.fixture(scope="module")
def design(linear):
    return tc.lqr(linear)


def weights(nx, nu, rng):
    C, D = rng.standard_normal((nx, nx)), rng.standard_normal((nu, nu))
    return C @ C.T / nx, D @ D.T + 50 * np.eye(nu)


def test_certificate(design):
    A, B, P = design.A, design.B, design.P
    left = A.T @ P + P @ A - P @ B @ np.linalg.solve(design.R, B.T @ P) + design.Q
    assert np.linalg.norm(left) < 1e-13 * np.linalg.norm(A.T @ P) * 4
    assert design.residual < 1e-14
    assert design.poles.real.max() < -0.1
    assert np.linalg.eigvalsh(P).min() > 0
    design.verify(1e-13)


def test_takes_the_flexible_part(free):
    design = tc.lqr(free[2])
    assert design.A.shape == (48, 48)
    assert (design.A == free[2].flexible.A).all()


def test_default_weights_are_energies(design, linear):
    stiffness = linear.dynamics.members.stiffness[linear.dynamics.members.inputs]
    assert (np.eye(len(design.A)) == design.Q).all()
    assert (np.diag(stiffness) == design.R).all()


def test_cost_to_go_is_the_integral_of_the_closed_loop(design, rng):
    """int_0^T x'Qx + u'Ru dt + x(T)'P x(T) = x0'P x0 for every T."""
    loop = design.A - design.B @ design.K
    running = design.Q + design.K.T @ design.R @ design.K
    x0 = rng.standard_normal(len(loop))

    def rate(t, z):
        return np.append(loop @ z[:-1], z[:-1] @ running @ z[:-1])

    for T in (0.1, 1.0):
        z = scipy.integrate.solve_ivp(rate, (0, T), np.append(x0, 0), "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        assert z[-1] + z[:-1] @ design.P @ z[:-1] == pytest.approx(x0 @ design.P @ x0, rel=1e-9)


def test_no_other_gain_is_cheaper(design, rng):
    """A changed gain costs more, by the second order of the change: the gradient vanishes."""
    x0 = rng.standard_normal(len(design.A))
    change = rng.standard_normal(design.K.shape) * np.abs(design.K).max()

    def cost(h):
        K = design.K + h * change
        loop = design.A - design.B @ K
        grammian = scipy.linalg.solve_continuous_lyapunov(loop.T, -(design.Q + K.T @ design.R @ K))
        return x0 @ grammian @ x0

    best = x0 @ design.P @ x0
    steps = np.array([4e-3, 2e-3, 1e-3])
    more = np.array([cost(h) - best for h in steps])
    assert (more > 0).all()
    assert np.polyfit(np.log(steps), np.log(more), 1)[0] == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("default", [True, False], ids=["energy weights", "other weights"])
def test_agrees_with_python_control(linear, rng, default):
    flexible = linear.flexible
    nx, nu = flexible.B.shape
    Q, R = (np.eye(nx), 100 * np.eye(nu)) if default else weights(nx, nu, rng)
    ours = tc.lqr(linear, Q, R)
    K, P, poles = control.lqr(flexible.to_statespace(), Q, R)
    assert np.abs(ours.K - K).max() < 1e-8 * np.abs(K).max()
    assert np.abs(ours.P - P).max() < 1e-8 * np.abs(P).max()
    gaps = np.abs(ours.poles[:, None] - np.asarray(poles)[None])
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-5 * np.abs(poles).max()


class TestController:
    def shown(self, dynamics, nodes, velocities):
        nothing = np.zeros(len(dynamics.structure.tendons))
        return Measurement(nodes, velocities, nothing, nothing, np.zeros(dynamics.members.inputs.size))

    def test_input_is_the_total_from_L0(self, mast):
        """Whatever the point of linearisation, at its equilibrium the controller asks for its rest lengths."""
        dynamics, rest, _ = mast
        u = np.full(21, 0.03)
        other = tc.find_equilibrium(shell_scene(pins=["P1_*_1"]), start=rest.nodes, inputs=u)
        design = tc.lqr(tc.linearize(dynamics, other))
        asked = design.step(0.0, self.shown(dynamics, other.nodes, np.zeros_like(other.nodes)))
        assert np.abs(asked - u).max() < 1e-12

    def test_input_is_the_state_feedback(self, free, rng):
        dynamics, rest, linear = free
        nodes, velocities = random_motion(rest.potential, rng, reach=0.0)
        design = tc.lqr(linear)
        asked = design.step(0.0, self.shown(dynamics, nodes, 0.01 * velocities))
        wanted = -design.K @ linear.flexible.state_of(nodes, 0.01 * velocities)
        assert np.abs(asked - wanted).max() < 1e-15 * 10 + 1e-13 * np.abs(wanted).max()

    def test_never_asks_for_less_than_the_floor(self, mast, rng):
        dynamics, rest, linear = mast
        design, members = tc.lqr(linear), dynamics.members
        nodes, velocities = random_motion(rest.potential, rng, speed=1e3)
        asked = design.step(0.0, self.shown(dynamics, nodes, velocities))
        left = members.rest_lengths[members.inputs] - asked
        assert (left >= members.floors[members.inputs] * (1 - 1e-12)).all()
        assert (left < 1.01 * members.floors[members.inputs]).any(), "the floor was never reached, so nothing is proven"

    def test_brings_the_structure_to_rest(self, mast, rng):
        """From a small disturbance, on the full nonlinear structure, the energy above rest falls a hundredfold."""
        dynamics, rest, linear = mast
        start = rest.potential.manifold.retract(rest.nodes, 0.01 * rng.standard_normal(21))
        run = tc.simulate(dynamics, start, controller=tc.lqr(linear), t_end=3.0)
        distance = run.distance_to(rest.nodes)
        assert distance[-1] < 0.1 * distance[0]
        run.verify()

    def test_free_structure_comes_to_rest_in_its_own_frame(self, free, rng):
        """Turned and carried away by a rigid motion, the loop works just as well: the state is in its frame."""
        dynamics, rest, linear = free
        start = rest.potential.manifold.retract(rest.nodes, 0.01 * rng.standard_normal(30))
        drift = np.array([0.3, -0.2, 0.1]) + np.cross([0.2, 0.1, -0.3], start)
        run = tc.simulate(dynamics, (start, drift), controller=tc.lqr(linear), t_end=3.0)
        first, last = (linear.flexible.state_of(run.nodes[k], run.velocities[k]) for k in (0, -1))
        assert np.linalg.norm(last) < 0.2 * np.linalg.norm(first)
        assert np.abs(run.nodes[-1] - run.nodes[0]).max() > 0.3

    def test_sampled_loop_is_stable_at_its_sample_time(self, design):
        from tensctl.linear import sample_ramped

        A, B = sample_ramped(design.A, design.B, design.dt).with_input_state()
        loop = A - B @ np.hstack([design.K, np.zeros((len(design.K), len(design.K)))])
        assert np.abs(np.linalg.eigvals(loop)).max() < 1


class TestMistakes:
    def test_shapes(self, mast):
        with pytest.raises(tc.SynthesisError, match=r"Q has shape \(3, 3\); \(42, 42\) is expected"):
            tc.lqr(mast[2], Q=np.eye(3))
        with pytest.raises(tc.SynthesisError, match=r"R has shape \(2, 2\); \(21, 21\) is expected"):
            tc.lqr(mast[2], R=np.eye(2))

    def test_singular_input_weight(self, free):
        """B has a null direction, so without a cost there it would be free to wander."""
        R = np.eye(24)
        R[3, 3] = 0
        with pytest.raises(tc.SynthesisError, match="R is not positive definite"):
            tc.lqr(free[2], R=R)

    def test_mode_without_drive(self):
        _, _, linear = solved(shell_scene(actuators={"tendons": ["t5_1_1"]}))
        with pytest.raises(tc.SynthesisError, match="neither damped nor driven"):
            tc.lqr(linear)

    def test_nothing_to_control(self, free):
        _, _, linear = free
        rigid = replaced(linear, modes=linear.modes[:6])
        with pytest.raises(tc.SynthesisError, match="the model has 0 flexible states"):
            tc.lqr(rigid)

    def test_verify_tells_a_wrong_gain(self, mast):
        design = tc.lqr(mast[2])
        with pytest.raises(tc.SynthesisError, match="the Riccati residual is"):
            replaced(design, P=design.P * (1 + 1e-6)).verify()
        with pytest.raises(tc.SynthesisError, match="a closed-loop pole has real part"):
            replaced(design, K=-design.K).verify()
