"""Which floors of tension give way, and by which part, is the same whatever forces are counted in."""

import numpy as np
import pytest
from compiled import Compiled, flat
from edge_support import Thrown, forced
from support import random_motion
from test_export_c import RELAXED, Both

import tensctl as tc
from tensctl.synthesis.step_record import missing

FORCES = (1e6, 1e-6)


def loop(forces, folder):
    """The mast thrown about for 51 steps, held by its MPC in C and in Python."""
    dynamics, rest, linear = forced(forces, pins=["P1_*_1"])
    mpc = tc.MPC(linear, horizon=5, tension_min=forces, rate_max=1.0)
    tc.export_c(mpc, folder)
    both = Both(mpc, Compiled(folder / "controller.c", 21))
    start = random_motion(rest.potential, np.random.default_rng(1), 0.02, 0.5)
    tc.simulate(dynamics, start, controller=both, t_end=1.0, rate_max=1.0)
    return both


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    return loop(1.0, tmp_path_factory.mktemp("usual"))


@pytest.mark.parametrize("forces", FORCES)
def test_relaxed_steps(usual, forces, tmp_path):
    """As many, the same ones, and as far."""
    both, records = loop(forces, tmp_path), usual.python.records
    assert [record.status for record in both.python.records] == [record.status for record in records]
    assert both.outcomes == usual.outcomes
    assert {"dual", "primal relaxed"} <= {record.status for record in records}
    assert max(both.differences) < 1e-9
    for relaxed in ([record.relaxed for record in both.python.records], [report.relaxed for report in both.reports]):
        assert np.array(relaxed) / forces == pytest.approx([record.relaxed for record in records], rel=1e-3)
        assert [value > 0 for value in relaxed] == [outcome == RELAXED for outcome in usual.outcomes]


@pytest.mark.parametrize("forces", [1.0, *FORCES])
def test_rounding_gives_way_to_nothing(forces):
    """Elongations of rounding in any stiffness; a hundred times that counts, and the worst tension of all is told."""
    stiffness = forces * np.array([100.0, 300.0])
    assert missing(np.array([[1e-12, 9e-12], [-1.0, 0.0]]), stiffness) == 0.0
    assert missing(np.array([[1e-12, 9e-10], [1e-9, -1.0]]), stiffness) == pytest.approx(2.7e-7 * forces)


@pytest.mark.parametrize("forces", FORCES)
def test_at_the_edge_of_what_floors_allow(forces, tmp_path):
    """A millionth beyond the edge floors of 2 N give way by 8e-4 N, and say so."""
    usual, thrown = Thrown(0, horizon=3), Thrown(0, horizon=3, forces=forces)
    assert thrown.edge == pytest.approx(usual.edge, rel=1e-8)
    tc.export_c(thrown.mpc, tmp_path)
    c = Compiled(tmp_path / "controller.c", len(thrown.mpc.linear.inputs))
    for part in (-1e-4, 1e-6, 1e-4):
        for case in (usual, thrown):
            case.mpc.reset()
            case.mpc.step(0.0, case.look(part))
        c.reset()
        c.step(flat(thrown.look(part)))
        wanted, found = usual.mpc.records[-1], thrown.mpc.records[-1]
        assert (wanted.relaxed > 0, found.relaxed > 0, c.last.relaxed > 0) == 3 * (part > 0,)
        relaxed = np.array([found.relaxed, c.last.relaxed]) / forces
        assert relaxed == pytest.approx([wanted.relaxed] * 2, rel=1e-4)
