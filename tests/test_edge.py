"""At the edge of what floors allow: kept on one side of it, given way on the other, by a linear programme's edge."""

import numpy as np
import pytest
from compiled import Compiled, flat
from edge_support import Thrown

import tensctl as tc
from tensctl.synthesis.qp_solvers import new_solver

_RELAXED = 1  # `TENSCTL_RELAXED` of the header


DISPLACED = {"reach": 4e-3, "u_max": 0.01}


@pytest.fixture(
    scope="module",
    params=[*((seed, {}) for seed in (0, 1, 5, 7, 8)), (3, {"horizon": 10}), (1, DISPLACED), (9, DISPLACED)],
    ids=lambda given: f"{given[0]}, {given[1]}",
)
def thrown(request):
    seed, options = request.param
    return Thrown(seed, **options)


def answered(thrown, part):
    problem, limits, hard = thrown.mpc.statement(0.0, thrown.look(part))
    plan, status, kkt = thrown.mpc.piece_at(0.0).answer(limits)
    return plan, status, kkt, limits.shortfall(problem, plan), hard


@pytest.mark.parametrize("inside", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6])
def test_kept_whenever_they_can_be(thrown, inside):
    """The optimum of the hard problem, whose multipliers grow to 1e6 where the first price is 600."""
    plan, status, kkt, shortfall, hard = answered(thrown, -inside)
    assert status == "dual"
    assert shortfall < 1e-9
    assert kkt < max(1e-9, 1e-14 / inside)  # rounding of multipliers of 1 / inside
    reference = new_solver("daqp", thrown.mpc.problem, soft=False, tol=1e-12).solve(hard)
    assert reference.status == "solved"
    # One metre of a floor costs 1e5 there: tolerances of 1e-12 m move the optimum by the square root of their cost.
    assert hard.objective(plan.ravel()) == pytest.approx(hard.objective(reference.z), rel=1e-4)
    assert np.abs(plan.ravel() - reference.z).max() < 3e-5


def test_kept_a_tenth_below_with_480_variables():
    """More limits act there than the work of the primal search reaches from nothing; the dual one has room for them."""
    plan, status, kkt, shortfall, hard = answered(Thrown(0, horizon=20), -0.1)
    assert status == "dual"
    assert shortfall < 1e-9
    assert kkt < 1e-9
    held = hard.values(plan.ravel())
    at_limit = (held < hard.lower + 1e-9) | (held > hard.upper - 1e-9)
    assert 110 < np.count_nonzero(at_limit) < 250


@pytest.mark.parametrize("outside", [1e-5, 1e-3, 1e-1])
def test_given_way_beyond(thrown, outside):
    """What gives way is told, and no answer claims floors that no plan keeps."""
    plan, status, kkt, shortfall, hard = answered(thrown, outside)
    assert status in ("primal relaxed", "primal bounded")
    assert kkt < 1e-9 or status == "primal bounded"
    assert shortfall > 1e-6
    held = hard.values(plan.ravel())
    rates = slice(-hard.f.size, None)
    assert (held[rates] >= hard.lower[rates] - 1e-12).all()
    assert (held[rates] <= hard.upper[rates] + 1e-12).all()


def test_a_step_says_so(thrown):
    """The record of a step near the edge: no floor gave way, and nobody relaxed."""
    thrown.mpc.reset()
    thrown.mpc.step(0.0, thrown.look(-1e-4))
    record = thrown.mpc.records[-1]
    assert record.relaxed == 0.0
    assert record.status in ("dual", "primal")


@pytest.mark.parametrize(("seed", "options"), [(0, {}), (9, DISPLACED), (8, {"horizon": 10})])
def test_c_source_keeps_them_too(seed, options, tmp_path):
    """Floors kept up to a millionth of the edge, given way beyond it, by the same commands as Python's."""
    thrown = Thrown(seed, **options)
    tc.export_c(thrown.mpc, tmp_path)
    compiled = Compiled(tmp_path / "controller.c", len(thrown.mpc.linear.inputs))
    for part in (-1e-3, -1e-4, -1e-6, 1e-3):
        look = thrown.look(part)
        thrown.mpc.reset()
        compiled.reset()
        wanted = thrown.mpc.step(0.0, look)
        outcome, command = compiled.step(flat(look))
        record = thrown.mpc.records[-1]
        if record.status.endswith("bounded"):
            continue
        assert (outcome == _RELAXED) == (record.relaxed > 0.0) == (part > 0)
        assert compiled.last.kkt < 1e-9
        assert np.abs(command - wanted).max() < (1e-6 if part < 0 else 1e-8)
