"""Nonlinear MPC at the edge of what floors allow, found by a linear programme: kept below it, given way above."""

import numpy as np
import pytest
from edge_support import Asked

from tensctl.synthesis import qp_anew
from tensctl.synthesis.qp import Solution
from tensctl.synthesis.qp_anew import PATIENCE, answer
from tensctl.synthesis.qp_daqp import QUICK, DaqpSolver
from tensctl.synthesis.qp_lazy import solve_lazily
from tensctl.synthesis.qp_primal import PrimalSolver, bounds
from tensctl.synthesis.relaxed import Relaxed


@pytest.fixture(scope="module", params=[(1, 0.5), (4, 1.0), (5, 1.0), (2, 1.5)])
def asked(request):
    return Asked(*request.param)


def answered(asked, part):
    """Controller, QP and record of a step with a floor that is so much of the edge above it."""
    controller = asked.controller((1 + part) * asked.edge)
    qp = controller.linearised(0.0, asked.look).qp()
    controller.step(0.0, asked.look)
    return controller, qp, controller.records[-1]


def first_price(qp, horizon):
    """The optimum at the first price."""
    work = PATIENCE * bounds(qp.f.size, horizon)[0]
    searching = PrimalSolver(qp.H, qp.A, horizon, soft=True, work=work)
    return searching.solve(Relaxed.of(qp.H, qp.A, horizon).problem(qp))


@pytest.mark.parametrize("inside", [1e-2, 1e-3, 1e-4, 1e-5])
def test_kept_whenever_they_can_be(asked, inside):
    """The optimum of the hard problem, where rates are at their limits by the hundred."""
    controller, qp, record = answered(asked, -inside)
    assert record.relaxed == 0.0
    assert record.kkt < 1e-9
    assert record.status in ("primal", "daqp")
    reference = DaqpSolver(qp, tol=1e-12).solve(qp)
    assert reference.status == "solved"
    plan = (controller.state()["plan"] - controller._ahead(0.0)).ravel()
    assert qp.violation(plan) < 1e-9
    assert qp.objective(plan) == pytest.approx(qp.objective(reference.z), rel=1e-4)
    assert np.abs(plan - reference.z).max() < 3e-5


def test_the_first_price_would_not_do(asked):
    """A hundred thousandth of the edge below it floors give way at the first price, and the quick search finds none."""
    qp = asked.controller((1 - 1e-5) * asked.edge).linearised(0.0, asked.look).qp()
    first = first_price(qp, asked.horizon)
    assert first.status == "solved"
    assert first.z[qp.f.size :].max() > 1e-7
    assert solve_lazily(qp, QUICK).usable is None


@pytest.mark.parametrize("outside", [1e-5, 1e-3, 1e-1])
def test_given_way_beyond(asked, outside):
    """What gives way is told, it is the optimum at the first price, and rates stay within their limits."""
    controller, qp, record = answered(asked, outside)
    assert record.status == "primal relaxed"
    assert record.kkt < 1e-9
    assert record.relaxed > 1e-6
    plan = (controller.state()["plan"] - controller._ahead(0.0)).ravel()
    held, rates = qp.values(plan), slice(-qp.f.size, None)
    assert (held[rates] >= qp.lower[rates] - 1e-12).all()
    assert (held[rates] <= qp.upper[rates] + 1e-12).all()


def test_many_steps_end_at_their_optimum(asked):
    """From floors that nobody notices to ones half as high again as can be kept."""
    for part in (-1.0, -0.5, -0.1, 0.5):
        record = answered(asked, part)[2]
        assert record.kkt < 1e-9
        assert (record.relaxed == 0.0) == (part < 0)


def test_a_search_that_ends_early_is_not_the_last_word(asked, monkeypatch):
    """With hardly any work the interior point answers; what the search came to is the answer where nobody else is."""
    qp = asked.controller(0.999 * asked.edge).linearised(0.0, asked.look).qp()
    monkeypatch.setattr(qp_anew, "solve_lazily", lambda *_, **__: Solution(None, None, "failed", np.inf))
    monkeypatch.setattr(qp_anew, "PATIENCE", 1e-3)
    wanted, (z, status, kkt) = DaqpSolver(qp, tol=1e-12).solve(qp).z, answer(qp, asked.horizon)
    assert status == "piqp relaxed"
    assert kkt < 1e-9
    assert np.abs(z - wanted).max() < 3e-5
    monkeypatch.setattr(qp_anew, "FEW", 0)
    z, status, kkt = answer(qp, asked.horizon)
    assert status == "primal bounded"
    assert kkt > 1e-9
    assert np.abs(z - wanted).max() > 1e-3
