"""Error against run time of solvers, on the problems of a predictive controller's own closed loop."""

import json

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc
from tensctl.accuracy import SolverPrecision
from tensctl.accuracy.overheard import overhear
from tensctl.accuracy.solver_result import SolverAttempt
from tensctl.accuracy.solvers import Known, _attempt, compared
from tensctl.cli import main
from tensctl.pipeline import measure_solvers
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_solvers import SOLVERS

PUSH = {"node": "P4_1_1", "force": [25.0, 0.0, 0.0], "from": 0.04, "to": 0.14}
SCENE = {
    "pins": ["P1_*_1"],
    "mpc": {"horizon": 5},
    "simulation": {"t_end": 0.4, "controller": "mpc", "push": [PUSH]},
    "accuracy": {"methods": ["splitting4"], "tolerances": [1e-4], "budget": 2.0},
}
EXACT = ("dual", "primal", "daqp", "piqp", "clarabel", "cvxpy")


@pytest.fixture(scope="module")
def heard(mast):
    _, rest, linear = mast
    mpc = tc.MPC(linear, horizon=5)
    push = tc.Push(PUSH["node"], PUSH["force"], PUSH["from"], PUSH["to"])
    return mpc, overhear(mpc, rest, t_end=0.4, pushes=[push])


@pytest.fixture(scope="module")
def measured(heard):
    return compared(*heard, solvers=EXACT, most=2)


def attempt(solver, seconds=1e-3, **given):
    numbers = {"asked": 5, "accepted": 5, "kkt": 1e-12, "worst_kkt": 1e-9, "error": 1e-8, "worst_error": 1e-6} | given
    return SolverAttempt(
        solver, 1e-6, given.pop("floors", "kept"), numbers["asked"], numbers["accepted"], seconds, 2 * seconds,
        *(numbers[name] for name in ("kkt", "worst_kkt", "error", "worst_error")),
    )  # fmt: skip


def result(*attempts):
    return SolverPrecision(attempts, 0.02, 5, 105, 225, 21, 3, 0.4, 1e-15)


class TestProblems:
    def test_are_those_of_the_steps(self, mast, heard):
        """Without what is at rest before the push; both kinds are there, each as the controller solved it."""
        _, found = heard
        assert found.steps == 21
        assert 0 < sum(p.relaxed for p in found.posed) == found.relaxed < len(found.posed) < 21
        for posed in found.posed:
            hard = posed.limits.assemble(posed.condensed)
            assert (DaqpSolver(hard).solve(hard).status == "infeasible") == posed.relaxed
            assert posed.qp.f.size == hard.f.size + posed.relaxed * 5
        assert all(np.abs(p.limits.start).max() > 1e-6 for p in found.posed)

    def test_some_are_spread(self, heard):
        _, found = heard
        kept = [p for p in found.posed if not p.relaxed]
        places = [kept.index(p) for p in found.some(4, relaxed=False)]
        assert len(set(places)) == 4
        assert max(np.diff(sorted(places))) <= len(kept) / 2
        assert abs(places[0] - places[1]) > 1
        assert len(found.some(1000, relaxed=False)) == len(kept)

    def test_a_loop_that_takes_too_long_is_cut(self, mast):
        found = overhear(tc.MPC(mast[2], horizon=5), mast[1], t_end=60.0, seconds=0.0)
        assert found.steps == 1
        assert found.t_end == 0


class TestMeasured:
    def test_tight_answers_agree_and_loose_ones_show(self, measured):
        by = {(a.solver, a.tol, a.floors): a for a in measured.attempts}
        assert set(by) == {
            (name, tol, floors)
            for floors in ("kept", "relaxed")
            for name in EXACT
            for tol in (1e-3, 1e-6, 1e-9)
            if floors == "kept" or name not in ("cvxpy", "dual")
        }
        for (name, tol, _), a in by.items():
            assert a.asked == 2
            if tol == 1e-9:
                assert a.worst_error < 1e-3
                assert a.failures == 0
            assert 0 < a.seconds <= a.worst_seconds
            assert np.isnan(a.kkt) == (name == "cvxpy")
        for name in ("clarabel", "cvxpy"):
            assert by[name, 1e-3, "kept"].worst_error > 10 * by[name, 1e-9, "kept"].worst_error
        assert by["daqp", 1e-3, "kept"].failures > 0
        assert measured.reference_kkt < 1e-12

    def test_errors_are_of_the_first_input_over_its_reach(self, mast, heard):
        """A solver that answers with every first input off by a tenth of what it may change in a period."""
        mpc, found = heard
        posed = found.some(2, relaxed=False)
        known = [Known(p, DaqpSolver(p.qp).solve(p.qp).z[:21] + 0.1 * mpc.rate_max * mpc.dt) for p in posed]
        off = _attempt(known, "daqp", 1e-9, "kept", 10.0)
        assert (off.error, off.worst_error) == pytest.approx((0.1, 0.1), rel=1e-6)
        assert (off.asked, off.failures) == (2, 0)


class TestAdvice:
    def test_is_the_quickest_that_is_right(self):
        found = result(
            attempt("osqp", 1e-4, accepted=4), attempt("piqp", 1e-4, worst_error=0.1), attempt("cvxpy", 1e-5),
            attempt("daqp", 2e-3), attempt("clarabel", 3e-3),
        )  # fmt: skip
        assert found.advised().solver == "daqp"
        assert found.advice() == ('floors kept: solver = "daqp", 2 ms in the median, 4 at worst of 20 ms',)
        assert found.to_dict()["recommended"] == {"solver": "daqp"}

    def test_says_when_nothing_is_right_or_in_time(self):
        late = result(attempt("osqp", accepted=0), attempt("piqp", 0.03, floors="relaxed"))
        kept, relaxed = late.advice()
        assert kept == "floors kept: no solver answers every problem within 1e-03"
        assert relaxed.endswith("60 at worst of 20 ms; too long: take a shorter horizon or a longer dt")
        assert late.to_dict()["recommended"] is None

    def test_nothing_to_do(self, mast):
        """A loop that stays at rest poses no problem worth a solver."""
        still = tc.solver_precision(tc.MPC(mast[2], horizon=3), mast[1], t_end=0.1)
        assert (still.attempts, still.steps) == ((), 6)
        assert "nothing to choose" in still.table()


@pytest.fixture
def asked(monkeypatch):
    """Calls to `solver_precision`, which answers at once."""
    calls = []

    def answered(mpc, start, **given):
        calls.append((mpc, start, given))
        return result(attempt("daqp"), attempt("piqp", 0.003, floors="relaxed"))

    monkeypatch.setattr("tensctl.accuracy.solver_precision", answered)
    return calls


class TestScene:
    def test_command_line(self, asked, tmp_path, capsys):
        scene = tmp_path / "scene.toml"
        scene.write_text(shell_scene(**SCENE).to_toml())
        assert main(["accuracy", str(scene), "-o", str(tmp_path / "out")]) == 0
        said = capsys.readouterr().out
        assert "\nsolvers of [mpc]\nsolver " in said
        assert 'floors kept: solver = "daqp"' in said
        read = json.loads((tmp_path / "out" / "solvers.json").read_text())
        assert read["recommended"] == {"solver": "daqp"}
        assert (read["steps"], read["horizon"], len(read["attempts"])) == (21, 5, 2)
        assert "piqp, relaxed" in (tmp_path / "out" / "solvers.svg").read_text()

    def test_summary_and_report(self, asked, tmp_path):
        results = tc.run(shell_scene(**SCENE, report={}), tmp_path / "out")
        told = json.loads((tmp_path / "out" / "summary.json").read_text())["solvers"]
        assert told == results.solvers.to_dict()
        page = (tmp_path / "out" / "report.html").read_text()
        section = page[page.index('<section id="solvers"') :]
        section = section[: section.index("</section>")]
        assert section.count("<tr") == 1 + len(results.solvers.attempts)
        assert "Floors kept: solver = " in section

    def test_all_of_it(self):
        """Within a budget that leaves each solver hardly any problem."""
        found = measure_solvers(shell_scene(**SCENE))
        assert (found.horizon, found.variables) == (5, 105)
        assert found.steps > 0
        assert {a.solver for a in found.attempts} == {*SOLVERS, "cvxpy"}

    def test_without_mpc_it_is_left_out(self, asked, tmp_path, capsys):
        given = {name: SCENE[name] for name in ("pins", "accuracy")}
        scene = shell_scene(**given, simulation={"t_end": 0.05}, report={})
        assert tc.run(scene, tmp_path / "out").solvers is None
        assert 'id="solvers"' not in (tmp_path / "out" / "report.html").read_text()
        (tmp_path / "scene.toml").write_text(scene.to_toml())
        assert main(["accuracy", str(tmp_path / "scene.toml")]) == 0
        assert "solvers of" not in capsys.readouterr().out
        with pytest.raises(tc.SceneError, match=r"no \[mpc\]"):
            measure_solvers(scene)
        assert not asked

    def test_another_controller_or_no_simulation(self, asked):
        """The section [mpc] is measured, whatever controls the run of the scene, or a release from its nodes."""
        other = {**SCENE, "lqr": {}, "simulation": {**SCENE["simulation"], "controller": "lqr"}}
        released = {name: SCENE[name] for name in ("pins", "mpc")}
        for given in (SCENE, other, released):
            measure_solvers(shell_scene(**given))
        (mpc, start, given), (_, same, also), (_, nodes, free) = asked
        assert mpc.horizon == 5
        assert (start.nodes == same.nodes).all()
        assert given == also
        assert [(p.start, p.stop) for p in given["pushes"]] == [(0.04, 0.14)]
        assert (given["t_end"], given["budget"]) == (0.4, 2.0)
        assert (nodes == mpc.linear.dynamics.structure.nodes).all()
        assert (free["t_end"], free["pushes"]) == (2.0, [])
