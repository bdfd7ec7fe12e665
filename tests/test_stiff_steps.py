"""A stiff step: the formula's order conditions, its Jacobian against CasADi's, block factors, reduced stages."""

import itertools

import casadi as ca
import numpy as np
import pytest
from support import MIXED_PINS, order_of, random_motion, shell_scene

import tensctl as tc
from tensctl.simulation.drive import Drive, drive_at
from tensctl.simulation.integrators.block_lu import factor_blocks, plan, solve_blocks
from tensctl.simulation.integrators.blocks import add_damping, assemble
from tensctl.simulation.integrators.chart import accelerate, place_ends
from tensctl.simulation.integrators.frozen import frozen_forces
from tensctl.simulation.integrators.kept import Kept
from tensctl.simulation.integrators.rodas import RODAS5P
from tensctl.simulation.integrators.rosenbrock_step import linearise, stages
from tensctl.simulation.integrators.stiff_layout import Task, plan_steps, room_for

SCENES = {
    "undamped": {},
    "free": {"tendons": {"damping": 2.0}},
    "by strain": {"tendons": {"EA": 100.0, "damping": 2.0}, "gravity": {"g": 9.8}},
    "held": {"tendons": {"damping": 2.0}, "drag": {"coefficient": 0.3}, "pins": MIXED_PINS},
    "two stages": {"m": 2, "pins": ["P1_*_1"], "tendons": {"damping": 2.0}},
}


class TestFormula:
    """Order conditions of Rosenbrock methods, in the coefficients of k = h f + h J sum gamma k."""

    gammas = np.linalg.inv(np.eye(8) / RODAS5P.gamma - RODAS5P.C)
    alphas = RODAS5P.a @ gammas
    betas = alphas + gammas
    b = np.append(RODAS5P.a[-1, :-1], 1) @ gammas
    low = RODAS5P.a[-1] @ gammas

    def conditions(self, b, order):
        """The sums b_i Phi_i(tree) gamma(tree) - 1 of every tree up to an order: forks take alphas, chains betas."""
        found = []
        for tree in itertools.chain(*(trees(n) for n in range(1, order + 1))):
            found.append(density(tree) * b @ self.weight(tree) - 1)
        return np.array(found)

    def weight(self, tree):
        """A node with one child passes beta on, one with more children multiplies what alphas pass to each."""
        matrix = self.betas if len(tree) == 1 else self.alphas
        result = np.ones(8)
        for child in tree:
            result = result * (matrix @ self.weight(child))
        return result

    def test_order_five_with_an_embedded_four(self):
        assert np.abs(self.conditions(self.b, 5)).max() < 1e-11
        assert np.abs(self.conditions(self.low, 4)).max() < 1e-11
        assert np.abs(self.conditions(self.b, 6)).max() > 1e-3
        assert np.abs(self.conditions(self.low, 5)).max() > 1e-3

    def test_times_are_sums_of_rows(self):
        assert np.abs(self.alphas.sum(axis=1) - RODAS5P.times).max() < 1e-13
        assert np.abs(self.gammas.sum(axis=1) - RODAS5P.d).max() < 1e-13

    def test_stiffly_accurate_and_stable(self):
        """R(inf) = 0 and |R(iy)| <= 1: the new value is the last stage, so nothing of a stiff transient is left."""
        assert np.abs(self.betas[-1] - self.b).max() < 1e-13

        def R(z):
            return 1 + z * self.b @ np.linalg.solve(np.eye(8) - z * self.betas, np.ones(8))

        assert abs(R(-1e9)) < 1e-6
        assert max(abs(R(1j * y)) for y in np.logspace(-3, 6, 200)) <= 1 + 1e-12


def trees(n):
    """Rooted trees with n nodes as sorted nested tuples."""
    if n == 1:
        return {()}
    return {tree for smaller in trees(n - 1) for tree in grown(smaller)}


def grown(tree):
    """A tree with one leaf more, at every place."""
    yield tuple(sorted([*tree, ()]))
    for k, child in enumerate(tree):
        for larger in grown(child):
            yield tuple(sorted([*tree[:k], larger, *tree[k + 1 :]]))


def size(tree):
    return 1 + sum(size(child) for child in tree)


def density(tree):
    return size(tree) * int(np.prod([density(child) for child in tree], dtype=int))


def dense(steps, blocks):
    """The matrix of blocks, (5 nr, 5 nr)."""
    lu = steps.elimination
    count = lu.order.size
    found = {(k, k): k for k in range(count)}
    for n, k in enumerate(lu.order.tolist()):
        for e in range(lu.start[n], lu.start[n + 1]):
            found[int(lu.rows[e]), k], found[k, int(lu.rows[e])] = int(lu.lower[e]), int(lu.upper[e])
    matrix = np.zeros((5 * count, 5 * count))
    for (i, j), at in found.items():
        matrix[5 * i : 5 * i + 5, 5 * j : 5 * j + 5] = blocks[at]
    return matrix


def task(dynamics, steps, drive, room):
    return Kept(Task(dynamics.kernel, steps, Kept(drive), RODAS5P, room))


def linearised(dynamics, drive=None):
    """Plan and room after the Jacobian was taken in a state of motion."""
    nodes, velocities = random_motion(dynamics.potential, np.random.default_rng(3), reach=0.15, speed=0.5)
    steps = plan_steps(dynamics.kernel)
    room = room_for(dynamics.kernel, steps, 8)
    drive = Drive.constant(dynamics.members.rest_lengths, dynamics.members.forces) if drive is None else drive
    room.rest[:], room.load[:] = drive.rest, drive.force.ravel()
    q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
    linearise(task(dynamics, steps, drive, room), 0.0, q, v, 0.0)
    return steps, room, drive, (nodes, velocities)


def matrix_at(dynamics, steps, room, s):
    """s^2 M + s C + K in full."""
    assemble(dynamics.kernel, steps, room.frame, s, room.on, room.pull, room.turn, room.press, room.own, room.A)
    return dense(steps, room.A)


def matrices(dynamics, steps, room):
    """K and C."""
    at_0, at_1, M = (*(matrix_at(dynamics, steps, room, s) for s in (0.0, 1.0)), np.diag(steps.mass))
    return at_0, at_1 - at_0 - M


def evaluate(dynamics, room, drive, t, y):
    """Accelerations (5 nr,) at y, with the tendons frozen as they are."""
    data, found = dynamics.kernel, np.zeros(y.size // 2)
    drive_at(drive, t, room.rest, room.load)
    assert place_ends(data, room.frame, y, room.place, room.speed)
    frozen_forces(data, room.place, room.speed, room.rest, room.on, room.load, room.force)
    accelerate(data, room.frame, y, room.place, room.speed, room.force, found)
    return found


def changing(dynamics):
    """Rest lengths that ramp and lag, a load that ramps, and one that swings."""
    rest, force = dynamics.members.rest_lengths, dynamics.members.forces
    bend = np.linspace(-1, 1, rest.size) * rest
    rate = np.zeros_like(force)
    rate[4] = [1.0, -2.0, 0.5]
    return Drive(
        0.0, rest, 0.1 * bend, 0.02 * bend[::-1], 0.3, force, rate, np.array([7]), np.array([[0.5, 1.0, -1.0]]),
        np.array([9.0]), np.array([0.4]), True, True,
    )  # fmt: skip


class TestJacobian:
    @pytest.mark.parametrize("sections", SCENES.values(), ids=SCENES)
    def test_blocks_are_those_of_the_model(self, sections):
        """CasADi's exact Jacobian of f, taken to chart coordinates: dq = T dz, dv = T dw - n (tau'.dtau)/L."""
        dynamics = tc.build_dynamics(shell_scene(**sections))
        steps, room, _, state = linearised(dynamics)
        assert 0 < room.on.sum() < room.on.size
        x = ca.SX.sym("x", dynamics.f.size1_in("x"))
        still = ca.DM.zeros(dynamics.f.size1_in("u")), ca.DM.zeros(dynamics.f.size1_in("w"))
        whole = ca.Function("J", [x], [ca.jacobian(dynamics.f(x, *still), x)])
        J = np.asarray(whole(dynamics.pack(*state)))
        half = len(J) // 2
        T, N, kept = self.chart(dynamics, room, half)
        M, across = steps.mass[kept], T.T / (T.T @ T).diagonal()[:, None]
        K, C = (part[np.ix_(kept, kept)] for part in matrices(dynamics, steps, room))
        wanted_c = -M[:, None] * (across @ J[half:, half:] @ T)
        wanted_k = -M[:, None] * (across @ (J[half:, :half] @ T + J[half:, half:] @ N))
        assert np.abs(C - wanted_c).max() < 1e-11 * np.abs(K).max()
        assert np.abs(K - wanted_k).max() < 1e-11 * np.abs(K).max()

    @staticmethod
    def chart(dynamics, room, half):
        """Columns of dq/dz and dv/dz in the order of the model's q, and which of the 5 nr coordinates these are."""
        columns, falls, kept, at = [], [], [], 0
        lengths = dynamics.potential.manifold.lengths
        for r, how in enumerate(dynamics.potential.manifold.hold):
            if how == 3:
                continue
            turn = at + 3 if how == 0 else at
            for i in range(3 if how == 0 else 0):
                columns.append(np.eye(half)[at + i])
                falls.append(np.zeros(half))
                kept.append(5 * r + i)
            for j in range(2):
                column, fall = np.zeros(half), np.zeros(half)
                column[turn : turn + 3] = room.frame[r, 1 + j]
                fall[turn : turn + 3] = -room.frame[r, 0] * room.y[room.start.size + 5 * r + 3 + j] / lengths[r]
                columns.append(column)
                falls.append(fall)
                kept.append(5 * r + 3 + j)
            at = turn + 3
        return np.array(columns).T, np.array(falls).T, np.array(kept)

    def test_taylor_remainder(self, rng):
        """z''(y + e dy) less its linear part shrinks with e^2."""
        dynamics = tc.build_dynamics(shell_scene(**SCENES["held"]))
        steps, room, drive, _ = linearised(dynamics)
        K, C = matrices(dynamics, steps, room)
        dz, dw = (np.where(steps.mass != 1.0, rng.standard_normal(steps.mass.size), 0.0) for _ in range(2))
        linear, start = -(K @ dz + C @ dw) / steps.mass, room.start.copy()
        parts, errors = 10.0 ** -np.arange(2, 5), []
        for e in parts:
            there = evaluate(dynamics, room, drive, 0.0, room.y + e * np.concatenate([dz, dw]))
            errors.append(np.abs(there - start - e * linear).max())
        assert 1.9 < order_of(parts, errors) < 2.1

    @pytest.mark.parametrize("law", [{"stiffness": 100.0}, {"EA": 100.0}], ids=["k", "EA"])
    def test_derivative_by_time(self, law):
        """Ramps, lags and waves: the difference quotient of accelerations over time converges with order 2."""
        dynamics = tc.build_dynamics(shell_scene(tendons={**law, "damping": 2.0}))
        drive = changing(dynamics)
        _, room, _, _ = linearised(dynamics, drive)
        lengths, errors = 10.0 ** -np.arange(1, 4), []
        for h in lengths:
            forward, backward = (evaluate(dynamics, room, drive, t, room.y) for t in (h, -h))
            errors.append(np.abs((forward - backward) / (2 * h) - room.by_time).max())
        assert 1.9 < order_of(lengths, errors) < 2.1


class TestLinearAlgebra:
    def test_block_factors_solve_what_numpy_solves(self, rng):
        """On a random pattern, matrix without symmetry."""
        count = 9
        edges = [(i, j) for i in range(count) for j in range(i) if rng.random() < 0.35]
        pairs = [(k, k) for k in range(count)] + edges + [(j, i) for i, j in edges]
        p = plan(*np.array(pairs).T, count)
        matrix, blocks = np.zeros((5 * count, 5 * count)), np.zeros((p.size, 5, 5))
        for k, (i, j) in enumerate(pairs):
            block = rng.standard_normal((5, 5)) + 8 * np.eye(5) * (i == j)
            matrix[5 * i : 5 * i + 5, 5 * j : 5 * j + 5] = blocks[p.place[k]] = block
        right = rng.standard_normal((count, 5))
        found = right.copy()
        assert factor_blocks(p.order, p.start, p.lower, p.upper, p.target_start, p.targets, blocks)
        solve_blocks(p.order, p.start, p.rows, p.lower, p.upper, blocks, found)
        assert np.abs(found.ravel() - np.linalg.solve(matrix, right.ravel())).max() < 1e-12

    def test_a_singular_block_is_told(self):
        p = plan(np.array([0, 1]), np.array([0, 1]), 2)
        blocks = np.stack([np.eye(5), np.diag([1.0, 1.0, 0.0, 1.0, 1.0])])
        assert not factor_blocks(p.order, p.start, p.lower, p.upper, p.target_start, p.targets, blocks)

    def test_damping_times_a_vector(self, rng):
        dynamics = tc.build_dynamics(shell_scene(**SCENES["held"]))
        steps, room, _, _ = linearised(dynamics)
        z, found = rng.standard_normal(steps.mass.size), np.zeros(steps.mass.size)
        add_damping(dynamics.kernel, steps, room.on, room.pull, z, found)
        wanted = matrices(dynamics, steps, room)[1] @ z
        assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()

    def test_reduced_stages_are_the_full_ones(self):
        """Every stage solves (1/(h g) - J) u = right-hand side with J = [[0, 1], [-K/M, -C/M]] of twice the size."""
        dynamics = tc.build_dynamics(shell_scene(**SCENES["held"]))
        steps, room, drive, _ = linearised(dynamics, changing(dynamics))
        h, T, n = 0.01, RODAS5P, steps.mass.size
        K, C = matrices(dynamics, steps, room)
        assert stages(task(dynamics, steps, drive, room), 0.0, h)[0]
        U = room.U.copy()
        J = np.block([[np.zeros((n, n)), np.eye(n)], [-K / steps.mass[:, None], -C / steps.mass[:, None]]])
        full = np.eye(2 * n) / (h * T.gamma) - J
        for i in range(8):
            y = room.y + T.a[i, :i] @ U[:i]
            rate = evaluate(dynamics, room, drive, T.times[i] * h, y) + T.d[i] * h * room.by_time
            u = np.linalg.solve(full, np.concatenate([y[n:], rate]) + T.C[i, :i] @ U[:i] / h)
            assert np.abs(u[:n] - U[i, :n]).max() < 1e-12 * max(1, np.abs(u[:n]).max())
            assert np.abs(u[n:] - U[i, n:]).max() < 1e-11 * max(1, np.abs(u[n:]).max())
