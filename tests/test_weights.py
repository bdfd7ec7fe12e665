"""Weights mean what they say, sampled costs are integrals of continuous ones, what cannot be steered is named."""

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from support import network_scene, replaced, shell_scene, solved

import tensctl as tc
from tensctl.synthesis.crossed import optimal, residual
from tensctl.synthesis.over_period import integral, ramped_cost
from tensctl.synthesis.stabilisable import stabilisable, unreached
from tensctl.synthesis.weights import Cost


def cost_of(rng, nx, nu, cross=True):
    whole = rng.standard_normal((nx + nu, nx + nu))
    whole = whole @ whole.T / nx + np.diag(np.repeat([0.0, 1.0], [nx, nu]))
    return Cost(whole[:nx, :nx], whole[nx:, nx:], whole[:nx, nx:] if cross else np.zeros((nx, nu)))


class TestPhysicalTerms:
    def test_cost_is_the_sum_of_its_terms(self, mast, rng):
        """Displacements, tensions and rest lengths of a random x and u, from another linear model's outputs."""
        dynamics, rest, linear = mast
        sizes = {"P4_*": 0.01, "P4_2_1": 0.02}
        cost = tc.weights(linear, energy=3.0, nodes=sizes, tensions={"t5_*": 2.0}, rest_lengths=0.05)
        shown = tc.linearize(dynamics, rest, outputs=("nodes", "tensions"))
        x, u = rng.standard_normal(42), rng.standard_normal(21)
        y = dict(zip(shown.outputs, shown.C @ x + shown.D @ u, strict=True))
        wanted = 0.5 * x @ x / 3.0 + (u @ u) / 0.05**2
        wanted += sum((value / 0.01) ** 2 for name, value in y.items() if name.startswith(("P4_1", "P4_3")))
        wanted += sum((value / 0.02) ** 2 for name, value in y.items() if name.startswith("P4_2"))
        wanted += sum((value / 2.0) ** 2 for name, value in y.items() if name.startswith("T_t5"))
        z = np.concatenate([x, u])
        assert z @ cost.matrix @ z == pytest.approx(wanted, rel=1e-12)
        assert np.abs(cost.N).max() > 0

    def test_energy_alone_is_the_default(self, free):
        _, _, linear = free
        cost, default = tc.weights(linear, energy=0.5), tc.lqr(linear)
        assert np.abs(cost.Q - default.Q).max() == 0
        assert np.abs(cost.R - default.R).max() < 1e-12
        assert (cost.N == 0).all()

    @pytest.mark.parametrize(
        ("given", "sentence"),
        [
            ({"energy": -1.0}, "energy is -1.0; expected a finite number > 0 .J"),
            ({"nodes": {"P4_*": 0.0}, "energy": 1.0}, 'nodes."P4_\\*" is 0.0; expected a finite number > 0'),
            ({"nodes": 0.01}, "some rest length costs nothing; give rest_lengths"),
            ({"energy": 1.0, "tensions": {"t99": 1.0}}, "t99"),
        ],
    )
    def test_refused(self, mast, given, sentence):
        with pytest.raises(tc.TensctlError, match=sentence):
            tc.weights(mast[2], **given)

    def test_allowed_sizes_are_about_what_comes(self, mast):
        """A tenth of the allowed displacement holds the shape more tightly, at the price of larger inputs."""
        _, _, linear = mast
        moved, asked = [], []
        for size in (0.02, 0.002):
            design = tc.lqr(linear, cost=tc.weights(linear, nodes=size, rest_lengths=0.05))
            loop = design.A - design.B @ design.K
            X = scipy.linalg.solve_continuous_lyapunov(loop, -np.eye(42))
            moved.append(np.trace(linear.C[:27] @ X @ linear.C[:27].T))
            asked.append(np.trace(design.K @ X @ design.K.T))
        assert moved[1] < 0.6 * moved[0]
        assert asked[1] > 2 * asked[0]


class TestCrossTerm:
    @pytest.mark.parametrize("sampled", [False, True])
    def test_agrees_with_scipy(self, rng, sampled):
        A, B = rng.standard_normal((6, 6)) / 2, rng.standard_normal((6, 3))
        cost = cost_of(rng, 6, 3)
        ours = optimal(A, B, cost, sampled=sampled)
        solve = scipy.linalg.solve_discrete_are if sampled else scipy.linalg.solve_continuous_are
        wanted = solve(A, B, cost.Q, cost.R, s=cost.N)
        assert np.abs(ours.P - wanted).max() < 1e-9 * np.abs(wanted).max()
        assert ours.residual < 1e-13
        assert residual(A, B, cost, ours.P * (1 + 1e-6), sampled=sampled) > 1e-8

    def test_of_a_shell(self, mast):
        cost = tc.weights(mast[2], energy=1.0, tensions=0.5, rest_lengths=0.05)
        design = tc.lqr(mast[2], cost=cost)
        design.verify(1e-13)
        coupling = design.P @ design.B + cost.N
        left = design.A.T @ design.P + design.P @ design.A - coupling @ np.linalg.solve(cost.R, coupling.T) + cost.Q
        assert np.linalg.norm(left) < 1e-12 * np.linalg.norm(cost.Q)

    def test_indefinite_together(self, mast):
        with pytest.raises(tc.SynthesisError, match=r"\[Q N; N' R\] has the eigenvalue"):
            tc.lqr(mast[2], N=np.full((42, 21), 50.0))

    def test_given_twice(self, mast):
        cost = tc.weights(mast[2], energy=1.0)
        with pytest.raises(tc.SynthesisError, match="given twice"):
            tc.lqr(mast[2], np.eye(42), cost=cost)


class TestSampled:
    def test_integral_against_quadrature(self, rng):
        A, W = 3 * rng.standard_normal((5, 5)), np.diag(rng.uniform(0, 1, 5))
        F, S = integral(A, W, 0.7)
        nodes, share = np.polynomial.legendre.leggauss(40)
        times = 0.35 * (nodes + 1)
        wanted = sum(w * 0.35 * scipy.linalg.expm(A * t).T @ W @ scipy.linalg.expm(A * t)
                     for t, w in zip(times, share, strict=True))  # fmt: skip
        assert np.abs(F - scipy.linalg.expm(0.7 * A)).max() < 1e-12 * np.abs(F).max()
        assert np.abs(S - wanted).max() < 1e-11 * np.abs(wanted).max()

    def test_integral_survives_stiff_damping(self):
        """|A| t = 1e6: a single block exponential overflows; S is known in closed form."""
        rates = np.array([1e8, 1.0])
        _, S = integral(-np.diag(rates), np.eye(2), 0.01)
        assert np.diag(S) == pytest.approx(-np.expm1(-0.02 * rates) / (2 * rates), rel=1e-9)

    def test_cost_of_a_ramped_period(self, rng):
        A, B, dt = rng.standard_normal((4, 4)), rng.standard_normal((4, 2)), 0.3
        cost = cost_of(rng, 4, 2)
        sampled = ramped_cost(A, B, cost, dt)
        x, before, after = rng.standard_normal(4), rng.standard_normal(2), rng.standard_normal(2)

        def rate(t, z):
            both = np.concatenate([z[:4], before + (after - before) * t / dt])
            return np.append(A @ both[:4] + B @ both[4:], both @ cost.matrix @ both)

        z = scipy.integrate.solve_ivp(rate, (0, dt), np.append(x, 0), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        whole = np.concatenate([x, before, after])
        assert whole @ sampled.matrix @ whole == pytest.approx(z[-1], rel=1e-10)

    @pytest.mark.parametrize("dt", [0.002, 0.02, 0.1])
    def test_cost_to_go_is_what_the_loop_costs(self, mast, rng, dt):
        """The sampled, ramped loop marched with the continuous model costs z'Pz, and every other gain more."""
        _, _, linear = mast
        design = tc.lqr(linear, dt=dt)
        design.verify(1e-11)
        A, B = design.sampled.with_input_state()
        z = np.concatenate([rng.standard_normal(42), 0.1 * rng.standard_normal(21)])

        def spent(K):
            loop, stage = A - B @ K, design.period_cost
            per_step = stage.Q - stage.N @ K - K.T @ stage.N.T + K.T @ stage.R @ K
            return z @ scipy.linalg.solve_discrete_lyapunov(loop.T, per_step) @ z

        best = z @ design.P @ z
        assert spent(design.K) == pytest.approx(best, rel=1e-8)
        change = 1e-3 * np.abs(design.K).max() * rng.standard_normal(design.K.shape)
        assert spent(design.K + change) > best

    def test_short_periods_come_to_the_continuous_gain(self, mast):
        """First order in dt: the ramp delays the command by about half a period."""
        _, _, linear = mast
        wanted = tc.lqr(linear)
        gaps = [abs(tc.lqr(linear, dt=dt).slowest - wanted.slowest) for dt in (0.08, 0.04, 0.02)]
        assert gaps[0] > 1.5 * gaps[1] > 1.5**2 * gaps[2]
        assert gaps[2] < 1e-3 * abs(wanted.slowest)

    def test_holds_the_structure_where_the_continuous_gain_fails(self, mast, rng):
        """At a period of 0.1 s the sampled loop of the continuous gain is unstable; the sampled design is not."""
        dynamics, rest, linear = mast
        dt, continuous = 0.1, tc.lqr(linear)
        design = tc.lqr(linear, dt=dt)
        A, B = design.sampled.with_input_state()
        late = A - B @ np.hstack([continuous.K, np.zeros((21, 21))])
        assert np.abs(np.linalg.eigvals(late)).max() > 1
        start = rest.potential.manifold.retract(rest.nodes, 0.01 * rng.standard_normal(21))
        run = tc.simulate(dynamics, start, controller=design, t_end=6.0)
        assert run.distance_to(rest.nodes)[-1] < 0.1 * run.distance_to(rest.nodes)[0]

    def test_too_slow_for_the_fastest_mode(self):
        stiff = {"stiffness": {"*": 100.0, "t5_*": 1e10}, "rest_ratio": {"*": 0.8, "t5_*": 1 - 2e-9}}
        _, _, linear = solved(shell_scene(pins=["P1_*_1"], tendons=stiff))
        with pytest.raises(tc.SynthesisError, match="ramps hardly drive it; shorten dt"):
            tc.lqr(linear, dt=0.1)

    def test_period(self, mast):
        with pytest.raises(tc.SynthesisError, match="dt is 0; expected a finite number > 0"):
            tc.lqr(mast[2], dt=0)

    def test_verify_tells_a_wrong_gain(self, mast):
        design = tc.lqr(mast[2], dt=0.02)
        with pytest.raises(tc.SynthesisError, match="the Riccati residual is"):
            replaced(design, P=design.P * (1 + 1e-6)).verify()
        with pytest.raises(tc.SynthesisError, match="a pole of the sampled loop has size"):
            replaced(design, K=-design.K).verify()


def test_return_difference(mast):
    """Kalman: (I + L)* R (I + L) >= R for the loop L = K (jw - A)^-1 B broken at the inputs."""
    design = tc.lqr(mast[2])
    root = np.sqrt(np.diag(design.R))
    least = np.inf
    for w in np.concatenate([np.logspace(-2, 3, 60), np.abs(design.poles.imag)]):
        L = design.K @ np.linalg.solve(1j * w * np.eye(42) - design.A, design.B)
        difference = root[:, None] * (np.eye(21) + L) / root
        least = min(least, np.linalg.svd(difference, compute_uv=False).min())
    assert 1 - 1e-9 <= least < 1.5


@pytest.fixture(scope="module")
def one_tendon():
    return solved(shell_scene(actuators={"tendons": ["t5_1_1"]}))[2]


class TestWhatCannotBeSteered:
    def test_is_refused_by_name(self, one_tendon):
        with pytest.raises(tc.SynthesisError, match=r"mode 8 at 1\.76\d* Hz .* neither damped nor driven: symmetry"):
            tc.lqr(one_tendon)

    @pytest.mark.parametrize("dt", [None, 0.02])
    def test_is_left_by_name(self, one_tendon, dt):
        """Eight modes of the free (3,1) shell: one of each repeated pair; the loop on the rest is stable."""
        design = tc.lqr(one_tendon, dt=dt, stabilisable_only=True)
        silent = tc.controllability(one_tendon)
        wanted = [m for m in silent.modes if m.kind == "flexible" and m.verdict != "yes"]
        assert [(m.index, m.frequency, m.reason) for m in design.left] == [
            (m.index, m.frequency, m.reason) for m in wanted
        ]
        assert len(design.left) == 8
        assert design.slowest < 0
        design.verify(1e-12)

    def test_basis_splits_the_model(self, one_tendon):
        """A maps the kept states into themselves, they hold the range of B, and what is left keeps its energy."""
        flexible = one_tendon.flexible
        T = stabilisable(flexible, only=True).basis
        W = scipy.linalg.null_space(T.T)
        assert T.shape == (48, 32)
        assert np.abs(W.T @ flexible.A @ T).max() < 1e-12 * np.abs(flexible.A).max()
        assert np.abs(W.T @ flexible.B).max() < 1e-12 * np.abs(flexible.B).max()
        assert np.abs(np.linalg.eigvals(W.T @ flexible.A @ W).real).max() < 1e-10

    def test_damping_makes_it_a_mode_like_any_other(self):
        scene = shell_scene(actuators={"tendons": ["t5_1_1"]}, drag={"coefficient": 0.1})
        design = tc.lqr(solved(scene)[2])
        assert design.left == ()
        assert design.slowest < 0

    def test_a_mechanism_without_drive_loses_both_states(self):
        A = np.array([[0.0, 2.0, 0], [0, 0, 0], [0, 0, -1.0]])
        lost = unreached(A, np.array([[0.0], [0.0], [1.0]]))
        assert lost.shape == (3, 2)
        assert np.abs(lost[2]).max() < 1e-12

    def test_unstable_and_unreached(self):
        lost = unreached(np.diag([1.0, -1.0, 0.5]), np.array([[1.0], [0.0], [0.0]]))
        assert np.abs(lost).ravel() == pytest.approx([0, 0, 1])

    def test_unactuated_post(self):
        """A mode that stretches only tendons without actuator, beside one that is driven."""
        nodes = {"o": [0, 0, 0], "a": [0, 0, 1.0], "p": [5, 0, 0], "b": [5, 0, 1.0]}
        ties, anchors = {}, []
        for rod, x in (("a", 0.0), ("b", 5.0)):
            for k, (dx, dy) in enumerate([(1, 0), (-0.6, 0.9), (-0.7, -0.8)]):
                nodes[f"{rod}{k}"] = [x + dx, float(dy), 1.0]
                ties[f"{rod}_tie{k}"] = [rod, f"{rod}{k}"]
                anchors.append(f"{rod}{k}")
        scene = network_scene(
            nodes, {"left": ["o", "a"], "right": ["p", "b"]}, ties, ["o", "p", *anchors],
            actuators={"tendons": ["a_tie*"]}, tendons={"stiffness": {"*": 100.0, "b_*": 150.0}},
        )  # fmt: skip
        linear = solved(scene)[2]
        design = tc.lqr(linear, stabilisable_only=True)
        assert len(design.left) == 2
        assert all("unactuated" in mode.reason for mode in design.left)
        assert design.slowest < 0
        moved = {mode.index for mode in design.left}
        assert all(np.abs(linear.modes[k].shape[3]).max() > 0.1 for k in moved)

    def test_rigid_body_rates_are_named_as_what_they_are(self):
        """Under next to no drag the six rates of a free shell are states that nothing drives or damps."""
        flexible = solved(shell_scene(drag={"coefficient": 1e-15}))[2].flexible
        part = stabilisable(flexible, only=True)
        assert part.basis.shape[1] == 2 * len(flexible.modes)
        assert {mode.index for mode in part.left} == {mode.index for mode in flexible.drifting} == set(range(6))
        assert all("rigid-body" in mode.reason for mode in part.left)
        with pytest.raises(tc.SynthesisError, match=r"mode 0 at 0 Hz \(and 5 more\).*rigid-body"):
            stabilisable(flexible, only=False)


class TestExtremes:
    @pytest.mark.parametrize("share", [1e-16, 1e-12, 1e-8, 1e-4, 1.0, 1e4, 1e8, 1e12])
    @pytest.mark.parametrize("dt", [None, 0.02])
    def test_input_weights(self, mast, share, dt):
        """Over 28 decades of R the residual keeps its bound, or the answer is a sentence that says what to change."""
        R = 100 * share * np.eye(21)
        if share > (1e-8 if dt is None else 1e-9):
            tc.lqr(mast[2], R=R, dt=dt).verify(1e-9)
        else:
            with pytest.raises(tc.SynthesisError, match="raise R"):
                tc.lqr(mast[2], R=R, dt=dt)

    @pytest.mark.parametrize("ratio", [1e4, 1e8])
    def test_masses(self, ratio):
        _, _, linear = solved(shell_scene(pins=["P1_*_1"], rods={"mass": {"*": 1.0, "r2_*": ratio}}))
        for dt in (None, 0.02):
            tc.lqr(linear, dt=dt).verify(1e-14)

    def test_stiffness(self):
        """Tendons 1e8 times stiffer than the others, stretched by 2e-9 of their length."""
        stiff = {"stiffness": {"*": 100.0, "t5_*": 1e10}, "rest_ratio": {"*": 0.8, "t5_*": 1 - 2e-9}}
        _, _, linear = solved(shell_scene(pins=["P1_*_1"], tendons=stiff))
        tc.lqr(linear).verify(1e-14)
        for energy in (1.0, None):
            tc.lqr(linear, cost=tc.weights(linear, energy=energy, nodes=0.01, rest_lengths=0.05)).verify(1e-12)
        for dt in (0.02, 0.001):
            tc.lqr(linear, cost=tc.weights(linear, energy=1.0, nodes=0.01, rest_lengths=0.05), dt=dt).verify(1e-10)

    def test_frequencies_over_six_decades(self, rng):
        """Undamped oscillators with stiffness ratio 1e12, weighed by energy."""
        omega = np.logspace(0, 6, 10)
        A = np.block([[np.zeros((10, 10)), np.diag(omega)], [-np.diag(omega), np.zeros((10, 10))]])
        B = np.vstack([np.zeros((10, 2)), rng.uniform(0.5, 1, (10, 2))])
        assert not unreached(A, B).size
        found = optimal(A, B, Cost(np.eye(20), np.eye(2), np.zeros((20, 2))))
        assert found.residual < 1e-12
        assert np.linalg.eigvals(A - B @ found.K).real.max() < 0
