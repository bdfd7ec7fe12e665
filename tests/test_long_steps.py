"""Tables of the splittings, and the long steps that are taken while no tendon is near its slack-taut boundary."""

from __future__ import annotations

from collections import Counter
from functools import cache
from math import factorial, prod

import numpy as np
import pytest
from support import order_of, shell_scene, solved

import tensctl as tc
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators import Method
from tensctl.simulation.integrators.splitting import Splitting
from tensctl.simulation.integrators.tables import LONG, TABLES

ALL = [(order, table) for tables in (TABLES, LONG) for order, table in tables.items()]
NAMES = [f"{order}-{table.drifts.size}" for order, table in ALL]


@cache
def trees(order):
    """Nystrom trees of f in y'' = f(y): how many of its legs are y', and the trees of those that are y'' again."""
    smaller = [(tree, 1 + size) for size in range(1, order - 1) for tree in trees(size)]

    def grown(left, choices):
        yield left, ()
        for place, (tree, cost) in enumerate(choices):
            if cost <= left:
                for legs, more in grown(left - cost, choices[place:]):
                    yield legs, (tree, *more)

    return list(grown(order - 1, smaller))


def order_tree(tree):
    return 1 + tree[0] + sum(1 + order_tree(below) for below in tree[1])


def symmetry(tree):
    """In how many ways a tree can be laid on itself."""
    return factorial(tree[0]) * prod(factorial(n) * symmetry(below) ** n for below, n in Counter(tree[1]).items())


def exact(tree):
    """Of the motion: the coefficient of t^(order - 1) in its term of f."""
    return prod(exact(below) / (order_tree(below) * (order_tree(below) + 1)) for below in tree[1])


def weights(tree, c, A):
    """The same by a Nystrom method, at its stages."""
    return prod((A @ weights(below, c, A) for below in tree[1]), start=c ** tree[0])


def defects(table, order):
    """What each condition of an order is missed by, in the size that it has in the motion's error."""
    b, c = table.kicks, np.concatenate([[0], np.cumsum(table.drifts)])
    A = np.tril(b * (c[:, None] - c), -1)
    return np.array([(b @ weights(tree, c, A) - exact(tree) / order) / symmetry(tree) for tree in trees(order)])


def oscillation(table, x):
    """Matrix of one step of q'' = -omega^2 q in (q, q'/omega), x = omega h."""
    step = np.eye(2)[:, :, None] * np.ones_like(x)
    for stage, kick in enumerate(table.kicks):
        step[1] = step[1] - kick * x * step[0]
        if stage < table.drifts.size:
            step[0] = step[0] + table.drifts[stage] * x * step[1]
    return step


class TestTables:
    def test_trees_are_all_there(self):
        """As many as E. Hairer, S. P. Norsett and G. Wanner list for y'' = f(y), II.14."""
        assert [len(trees(order)) for order in range(1, 8)] == [1, 1, 2, 3, 6, 10, 20]

    @pytest.mark.parametrize(("order", "table"), ALL, ids=NAMES)
    def test_every_condition_up_to_the_order_holds_and_none_beyond(self, order, table):
        assert max(np.abs(defects(table, lower)).max() for lower in range(1, order + 1)) < 1e-15
        assert np.abs(defects(table, order + 1)).max() > 1e-8

    @pytest.mark.parametrize(("order", "table"), ALL, ids=NAMES)
    def test_tables_are_symmetric(self, order, table):
        for part in (table.kicks, table.drifts):
            assert part.sum() == pytest.approx(1, abs=1e-15)
            assert (part[::-1] == part).all()

    @pytest.mark.parametrize("order", [4, 6])
    def test_long_steps_leave_less_of_the_next_order(self, order):
        long, short = (np.linalg.norm(defects(tables[order], order + 1)) for tables in (LONG, TABLES))
        assert long * {4: 25, 6: 4.5}[order] < short

    @pytest.mark.parametrize(("order", "error"), [(4, 4e-5), (6, 1.3e-6)])
    def test_long_steps_follow_oscillations(self, order, error):
        x = np.linspace(0, 4.2, 2001)
        wanted = np.array([[np.cos(x), np.sin(x)], [-np.sin(x), np.cos(x)]])
        assert np.abs(oscillation(LONG[order], x) - wanted).max() < error

    @pytest.mark.parametrize("order", [4, 6])
    def test_long_steps_are_stable_through_pi(self, order):
        """Half the trace stays within one up to omega h = 6.2; the tables beside them leave it at pi."""
        x = np.linspace(0, 6.2, 200001)
        long, short = (0.5 * np.trace(oscillation(tables[order], x)) for tables in (LONG, TABLES))
        assert np.abs(long).max() < 1 + 1e-12
        assert np.abs(short[x < 3.5]).max() > 1 + 1e-8

    @pytest.mark.parametrize("part", [0.5, 0.8, 1.0])
    @pytest.mark.parametrize(("order", "table"), ALL, ids=NAMES)
    def test_stages_see_how_far_an_oscillation_falls(self, order, table, part):
        """They miss at most 1.5 times omega^2 time^2/8 of its amplitude, at the longest steps and at shorter ones."""
        longest = {2: 1.0, 4: 2.0, 6: 3.1} if table is TABLES[order] else {4: 5.2, 6: 5.2}
        x = part * longest[order]
        phases = np.linspace(0, 2 * np.pi, 181)
        q, p = np.cos(phases), np.sin(phases)
        seen = q
        for kick, drift in zip(table.kicks[:-1], table.drifts, strict=True):
            p = p - kick * x * q
            q = q + drift * x * p
            seen = np.minimum(seen, q)
        missed = (seen - np.cos(phases[:, None] - x * np.linspace(0, 1, 501)).min(axis=1)).max()
        assert 1e-4 < missed < 1.5 * (x * table.widest) ** 2 / 8


def kicked(speed, seed=5, **sections):
    """A shell at rest, and velocities of a given size, m/s."""
    dynamics, rest, _ = solved(shell_scene(**sections))
    rng = np.random.default_rng(seed)
    velocities = rest.point.tangent @ (speed * rng.standard_normal(rest.potential.manifold.size))
    return dynamics, rest.nodes, velocities.reshape(-1, 3)


TAUT = {"k": {}, "EA": {"tendons": {"EA": 100.0}}, "weight": {"pins": ["P1_*_1"], "gravity": {"g": 9.8}}}


class TestLongSteps:
    @pytest.mark.parametrize(("order", "counts"), [(4, [16, 22, 30, 40]), (6, [12, 16, 22])])
    @pytest.mark.parametrize("sections", TAUT.values(), ids=TAUT)
    def test_order(self, sections, order, counts):
        tendons = {"rest_ratio": 0.5} | sections.get("tendons", {})
        dynamics, nodes, velocities = kicked(0.3, **(sections | {"tendons": tendons}))
        drive = Drive.constant(dynamics.members.rest_lengths, dynamics.members.forces)

        def end(method, step, stride):
            q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
            plant = Splitting(dynamics, method, step, stride=stride)
            plant.march(q, v, np.array([0.0, 0.5]), drive, *(np.empty((2, *q.shape)) for _ in range(2)))
            return np.hstack([q, v]), plant.evaluations

        fine, _ = end(6, 0.5 / 400, 0.0)
        errors = []
        for count in counts:
            found, evaluations = end(order, 0.05 / count, 0.5 / count)
            assert evaluations == 2 + count * LONG[order].drifts.size
            errors.append(np.abs(found - fine).max())
        assert order - 0.3 < order_of(0.5 / np.array(counts), errors) < order + 0.3

    @pytest.mark.parametrize(("tol", "part"), [(1e-3, 0.8), (1e-6, 0.7), (1e-9, 0.7)])
    def test_fewer_forces_than_short_steps(self, tol, part):
        dynamics, nodes, velocities = kicked(0.05)
        drive = Drive.constant(dynamics.members.rest_lengths, dynamics.members.forces)
        long, short = (Splitting.fitted(dynamics, 6, tol, dynamics.fastest_rate) for _ in range(2))
        short.stride, ends = 0.0, []
        for plant in (long, short):
            q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
            plant.march(q, v, np.array([0.0, 2.0]), drive, *(np.empty((2, *q.shape)) for _ in range(2)))
            ends.append(q)
        assert np.abs(ends[0] - ends[1]).max() < 0.1 * tol
        assert long.evaluations < part * short.evaluations

    @pytest.mark.parametrize("speed", [0.3, 0.5, 0.8])
    @pytest.mark.parametrize("method", ["splitting4", "splitting6"])
    def test_no_switch_is_stepped_over(self, speed, method: Method):
        """Kicks that now and then let a tendon go slack for a moment, at the loosest tolerance."""
        for seed in range(6):
            dynamics, nodes, velocities = kicked(speed, seed)
            start, times = (nodes, velocities), [0.0, 1.0]
            runs = (
                tc.simulate(dynamics, start, timepts=times, tol=0.1, method=method),
                tc.simulate(dynamics, start, timepts=times, tol=1e-11, method="splitting6"),
            )
            assert np.abs(runs[0].nodes[-1] - runs[1].nodes[-1]).max() < 1e-3
            assert abs(runs[0].switches - runs[1].switches) <= 0.1 * runs[1].switches

    def test_one_step_to_a_goal_takes_the_fewest_forces(self):
        """Where a short step is long enough, as within a control period, its table is the cheaper one."""
        dynamics, nodes, velocities = kicked(0.05)
        plant = tc.propagator(dynamics, tol=1e-4, method="splitting6")
        plant(nodes, velocities, [0.0, 0.01])
        assert plant.integrator.evaluations == 2 + 3 * TABLES[6].drifts.size
