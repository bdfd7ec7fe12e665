"""Tendon and rod obey mechanics: forces are the slopes of energies, rods keep length, momentum and energy balance."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support import order_of, taylor_order

from tensctl.elements import (
    Hold,
    rod_acceleration,
    rod_energy,
    tendon_energy,
    tendon_statics,
    tendon_tension,
)

LAWS = ["k", "EA"]
STEPS = np.array([3e-2, 1e-2, 3e-3, 1e-3])
D, L, K = np.array([0.7, -1.1, 0.4]), 0.9, 37.0
vector = st.lists(st.floats(-3, 3), min_size=3, max_size=3).map(np.array)


def arrays(function, *arguments):
    results = function(*arguments)
    results = results if isinstance(results, tuple | list) else [results]
    return [np.asarray(part).squeeze() for part in results]


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


@pytest.mark.parametrize("law", LAWS)
class TestTendon:
    def energy(self, law, d, rest=L):
        return float(tendon_energy(law)(d, rest, K))

    def test_energy_is_the_law(self, law):
        length = np.linalg.norm(D)
        wanted = K * (length - L) ** 2 / 2 / (1 if law == "k" else L)
        assert self.energy(law, D) == pytest.approx(wanted, rel=1e-15)

    def test_tension_is_the_law(self, law):
        length = np.linalg.norm(D)
        wanted = K * (length - L) if law == "k" else K * (length / L - 1)
        _, T, *_ = arrays(tendon_statics(law), D, L, K)
        assert wanted == pytest.approx(float(T), rel=1e-14)
        assert wanted == pytest.approx(float(tendon_tension(law, damped=False)(D, L, K)), rel=1e-14)

    def test_pull_is_tension_along_the_tendon(self, law):
        _, T, pull, *_ = arrays(tendon_statics(law), D, L, K)
        assert np.abs(pull - T * D / np.linalg.norm(D)).max() < 1e-13 * T

    def test_derivatives_by_taylor_remainder(self, law, rng):
        V, _, pull, stiffness, _ = arrays(tendon_statics(law), D, L, K)
        s = rng.standard_normal(3)
        first = taylor_order(lambda h: self.energy(law, D + h * s) - V - h * pull @ s, STEPS)
        second = taylor_order(
            lambda h: self.energy(law, D + h * s) - V - h * pull @ s - h**2 / 2 * s @ stiffness @ s, STEPS
        )
        assert 1.9 < first < 2.1
        assert 2.9 < second < 3.1

    def test_shortening_is_the_growth_of_the_pull(self, law):
        shortening = arrays(tendon_statics(law), D, L, K)[4]

        def pull(du):
            return arrays(tendon_statics(law), D, L - du, K)[2]

        central = (pull(1e-4) - pull(-1e-4)) / 2e-4
        assert np.abs(central - shortening).max() < 1e-6 * np.abs(shortening).max()

    def test_energy_falls_with_the_rest_length_as_tension_says(self, law):
        """dV/dL = -T for constant k; with constant EA the energy's own 1/L adds to it."""
        _, T, *_ = arrays(tendon_statics(law), D, L, K)
        slope = (self.energy(law, D, L + 1e-5) - self.energy(law, D, L - 1e-5)) / 2e-5
        wanted = -T if law == "k" else -T - self.energy(law, D) / L
        assert slope == pytest.approx(float(wanted), rel=1e-8)

    @pytest.mark.parametrize("d", [0.5 * D / np.linalg.norm(D), np.zeros(3), np.array([L, 0, 0])], ids=str)
    def test_slack_carries_nothing(self, law, d):
        parts = arrays(tendon_statics(law), d, L, K)
        assert all((part == 0).all() for part in parts)
        fast = 100 * np.ones(3)
        assert float(tendon_tension(law, damped=True)(d, fast, L, K, 5.0)) == 0

    @given(d=vector, v=vector, c=st.floats(0, 20))
    def test_damped_tension_is_clamped(self, law, d, v, c):
        length = np.linalg.norm(d)
        assume(abs(length - L) > 1e-9)
        elastic = K * (length - L) / (1 if law == "k" else L)
        wanted = max(0.0, elastic + c * (d @ v) / length) if length > L else 0.0
        T = float(tendon_tension(law, damped=True)(d, v, L, K, c))
        assert pytest.approx(wanted, rel=1e-11, abs=1e-11) == T
        assert T >= 0


def motion(seed):
    """A rod's q2, velocities with v2 across it, end forces and mass."""
    rng = np.random.default_rng(seed)
    q2, v1, v2, f1, f2 = rng.standard_normal((5, 3))
    v2 -= q2 * (q2 @ v2) / (q2 @ q2)
    return q2, v1, v2, f1, f2, rng.uniform(0.2, 5)


seeds = st.integers(0, 10**6).map(motion)


def saddle(q2, v2, forces, m, held=()):
    """Accelerations of both ends by Lagrange multipliers: uniform rod, length kept, some ends held."""
    mass = m * np.kron([[1 / 3, 1 / 6], [1 / 6, 1 / 3]], np.eye(3))
    rows = [np.concatenate([-q2, q2])[None]] + [np.eye(6)[3 * end : 3 * end + 3] for end in held]
    G, right = np.vstack(rows), np.zeros(1 + 3 * len(held))
    right[0] = -(v2 @ v2)
    matrix = np.block([[mass, G.T], [G, np.zeros((len(G), len(G)))]])
    return np.linalg.solve(matrix, np.concatenate([np.concatenate(forces), right]))[:6]


class TestFreeRod:
    @given(seeds)
    def test_equals_lagrange_multipliers(self, state):
        q2, _, v2, f1, f2, m = state
        a1, a2 = arrays(rod_acceleration(Hold.FREE), q2, v2, f1, f2, m)
        ends = saddle(q2, v2, (f1, f2), m)
        size = np.abs(ends).max()
        assert np.abs(a1 - ends[:3] - ends[3:]).max() < 1e-11 * size
        assert np.abs(a2 - ends[3:] + ends[:3]).max() < 1e-11 * size

    @given(seeds)
    def test_energy_grows_by_the_forces_power(self, state):
        q2, v1, v2, f1, f2, m = state
        a1, a2 = arrays(rod_acceleration(Hold.FREE), q2, v2, f1, f2, m)
        growth = m / 4 * v1 @ a1 + m / 12 * v2 @ a2
        power = f1 @ (v1 - v2) / 2 + f2 @ (v1 + v2) / 2
        assert growth == pytest.approx(power, abs=1e-12 * (1 + abs(power)) * max(1, m))

    @given(seeds)
    def test_momenta_grow_by_force_and_moment(self, state):
        q2, _, v2, f1, f2, m = state
        a1, a2 = arrays(rod_acceleration(Hold.FREE), q2, v2, f1, f2, m)
        assert np.abs(m / 2 * a1 - f1 - f2).max() < 1e-13 * (1 + np.abs(f1 + f2).max())
        moment = np.cross(q2, f2 - f1) / 2
        assert np.abs(m / 12 * np.cross(q2, a2) - moment).max() < 1e-12 * (1 + np.abs(moment).max())

    @given(seeds)
    def test_length_is_kept_to_second_order(self, state):
        q2, _, v2, f1, f2, m = state
        _, a2 = arrays(rod_acceleration(Hold.FREE), q2, v2, f1, f2, m)
        size = np.linalg.norm(q2) * np.linalg.norm(a2) + v2 @ v2
        assert abs(q2 @ a2 + v2 @ v2) < 1e-13 * size

    @given(seeds)
    def test_equals_theorem_3_1_at_the_nominal_length(self, state):
        """q'' + Omega q = H f with H = (2/m) [I I; (3/L^2) q2~^2, -(3/L^2) q2~^2], Omega = diag(0, |q2'|^2/L^2 I)."""
        q2, _, v2, f1, f2, m = state
        length = np.linalg.norm(q2)
        square = 3 / length**2 * skew(q2) @ skew(q2)
        H = 2 / m * np.block([[np.eye(3), np.eye(3)], [square, -square]])
        omega = np.kron(np.diag([0, v2 @ v2 / length**2]), np.eye(3))
        wanted = H @ np.concatenate([f1, f2]) - omega @ np.concatenate([np.zeros(3), q2])
        found = np.concatenate(arrays(rod_acceleration(Hold.FREE), q2, v2, f1, f2, m))
        assert np.abs(found - wanted).max() < 1e-12 * (1 + np.abs(wanted).max())

    @given(seeds)
    def test_kinetic_energy_is_the_integral_over_the_rod(self, state):
        _, v1, v2, *_, m = state
        places, weights = np.polynomial.legendre.leggauss(3)
        speeds = [v1 / 2 + s * v2 / 2 for s in places]
        integral = m / 4 * sum(w * v @ v for w, v in zip(weights, speeds, strict=True))
        assert float(rod_energy(Hold.FREE)(v1, v2, m)) == pytest.approx(integral, rel=1e-13)

    def test_a_wrong_length_does_not_grow(self):
        """With the actual |q2|^2 in the skew square a length error stays what it is: q2'' has no part from it."""
        q2, _, v2, f1, f2, m = motion(3)
        errors = []
        for stretch in (1.0, 1.0 + 1e-6):
            _, a2 = arrays(rod_acceleration(Hold.FREE), stretch * q2, v2, f1, f2, m)
            errors.append(stretch * q2 @ a2 + v2 @ v2)
        assert np.abs(errors).max() < 1e-12


@pytest.mark.parametrize(("hold", "held"), [(Hold.TAIL, 0), (Hold.HEAD, 1)])
class TestHeldRod:
    def acceleration(self, hold, state):
        q2, _, v2, f1, f2, m = state
        return arrays(rod_acceleration(hold), q2, v2, f2 if hold is Hold.TAIL else f1, m)[0]

    @given(state=seeds)
    def test_equals_a_free_rod_whose_end_is_held_by_multipliers(self, hold, held, state):
        q2, _, v2, f1, f2, m = state
        ends = saddle(q2, v2, (f1, f2), m, held=[held])
        wanted = ends[3:] - ends[:3]
        assert np.abs(self.acceleration(hold, state) - wanted).max() < 1e-11 * np.abs(wanted).max()

    @given(state=seeds)
    def test_is_the_free_rod_with_the_reaction_that_stops_its_end(self, hold, held, state):
        """Solve for the force on the held end that gives it no acceleration; the free element must then agree."""
        q2, _, v2, f1, f2, m = state
        sign = 1 if held == 0 else -1

        def held_end(reaction):
            forces = (reaction, f2) if held == 0 else (f1, reaction)
            a1, a2 = arrays(rod_acceleration(Hold.FREE), q2, v2, *forces, m)
            return (a1 - sign * a2) / 2, a2

        still, _ = held_end(np.zeros(3))
        slope = np.column_stack([held_end(axis)[0] - still for axis in np.eye(3)])
        end, a2 = held_end(np.linalg.solve(slope, -still))
        size = np.abs(a2).max()
        assert np.abs(end).max() < 1e-12 * size
        assert np.abs(self.acceleration(hold, state) - a2).max() < 1e-11 * size

    @given(state=seeds)
    def test_energy_grows_by_the_force_power(self, hold, held, state):
        _, _, v2, f1, f2, m = state
        speed = v2 if hold is Hold.TAIL else -v2
        power = (f2 if hold is Hold.TAIL else f1) @ speed
        growth = m / 3 * v2 @ self.acceleration(hold, state)
        assert growth == pytest.approx(power, abs=1e-12 * (1 + abs(power)) * max(1, m))
        free_twin = float(rod_energy(Hold.FREE)(speed, v2, m))
        assert float(rod_energy(hold)(v2, m)) == pytest.approx(free_twin, rel=1e-13)


def test_a_rod_between_two_pins_has_no_acceleration():
    with pytest.raises(ValueError, match="both ends on the ground"):
        rod_acceleration(Hold.FIXED)


def test_orders_are_measured():
    steps = np.array([0.1, 0.05, 0.02])
    assert order_of(steps, 7 * steps**3) == pytest.approx(3)
