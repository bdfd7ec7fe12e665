"""Moving a node: least changes by their optimality, fewest by trying all, and the full structure's answer."""

from itertools import combinations

import numpy as np
import pytest
from support import order_of, shell_scene, solved

import tensctl as tc
from tensctl.analysis.least_change import Wanted, fewest, least_norm, optimality

STEPS = np.array([4e-3, 2e-3, 1e-3])


@pytest.mark.parametrize("fixture", ["free", "mast"])
def test_the_full_structure_follows(request, fixture):
    """The settled node misses the promised place by the square of the move."""
    rest = request.getfixturevalue(fixture)[1]
    off = [tc.move(rest, "P4_1_1", (h, -h, 0.5 * h)).bend for h in STEPS]
    assert order_of(STEPS, off) == pytest.approx(2, abs=0.1)


def test_least_change_is_the_pseudo_inverse(mast):
    _, rest, linear = mast
    found = tc.move(linear, "P4_1_1", (1e-3, 0, 0))
    found.verify()
    assert found.arrives
    step = np.random.default_rng(0).standard_normal(21)
    step -= np.linalg.pinv(found.program.S) @ (found.program.S @ step)  # moves other things, not the node
    other = found.inputs + 1e-4 * step
    assert np.abs(found.program.S @ other - found.by).max() < 1e-12
    assert np.linalg.norm(other) > np.linalg.norm(found.inputs)
    assert found.equilibrium is rest


def test_weights_keep_a_tendon_still(mast):
    weights = np.ones(21)
    weights[3] = 1e12
    label = mast[0].input_labels[3]
    found = tc.move(mast[2], "P4_1_1", (1e-3, 0, 0), weights=weights)
    assert abs(dict(found.tendons).get(label, 0.0)) < 1e-9 * abs(found.tendons[0][1])
    found.verify()


class TestFloors:
    def test_a_floor_that_acts(self, mast):
        _, rest, linear = mast
        plain = tc.move(linear, "P4_1_1", (0.05, 0, 0))
        kept = ~rest.structure.grounded_tendons
        floor = float((rest.tensions + plain.tension_changes)[kept].min()) + 0.2
        bound = tc.move(linear, "P4_1_1", (0.05, 0, 0), tension_min=floor)
        bound.verify()
        assert bound.arrives
        assert (rest.tensions + bound.tension_changes)[kept].min() == pytest.approx(floor, abs=1e-9)
        assert np.linalg.norm(bound.inputs) > np.linalg.norm(plain.inputs)

    def test_against_cvxpy(self, mast):
        import cvxpy as cp

        found = tc.move(mast[2], "P4_1_1", (0.05, 0.02, 0), tension_min=3.5)
        program, u = found.program, cp.Variable(21)
        limits = [program.S @ u == program.effect, program.A @ u <= program.b]
        problem = cp.Problem(cp.Minimize(cp.sum_squares(100 * u)), limits)
        problem.solve(solver="CLARABEL", tol_gap_abs=1e-11, tol_feas=1e-11)
        assert problem.value == pytest.approx(1e4 * float(found.inputs @ found.inputs), rel=1e-6)

    def test_out_of_reach_it_goes_as_far_as_it_can(self, mast):
        found = tc.move(mast[2], "P4_1_1", (41.0, 0, 0), tension_min=3.0)
        assert not found.arrives
        found_less = tc.move(mast[2], "P4_1_1", (40.0, 0, 0), tension_min=3.0)
        assert np.abs(found.residual).sum() == pytest.approx(np.abs(found_less.residual).sum() + 1.0, rel=1e-6)
        assert "not reached" in str(found)

    def test_floors_out_of_reach(self, mast):
        with pytest.raises(tc.EquilibriumError, match="keeps the bounds"):
            tc.move(mast[2], "P4_1_1", (0.01, 0, 0), tension_min=1e6)


class TestFewest:
    def test_by_trying_all(self):
        """Random programs: no smaller set of inputs has the effect within bounds, and none as small is shorter."""
        rng = np.random.default_rng(11)
        for _ in range(5):
            S, bound = rng.standard_normal((2, 7)), 0.6
            A, b = np.vstack([np.eye(7), -np.eye(7)]), np.full(14, bound)
            wanted = Wanted(S, S @ (rng.uniform(-1, 1, 7) * bound), A, b, np.ones(7))
            u, how = fewest(wanted)
            assert how == "mixed-integer program"
            count = int((u != 0).sum())
            lengths = {}
            for size in range(1, count + 1):
                for chosen in combinations(range(7), size):
                    part = wanted.only(np.array(chosen))
                    try:
                        few = least_norm(part)
                    except tc.EquilibriumError:
                        continue
                    if np.abs(part.S @ few - wanted.effect).max() < 1e-7:
                        lengths.setdefault(size, []).append(float(few @ few))
            assert min(lengths) == count
            assert float(u @ u) == pytest.approx(min(lengths[count]), rel=1e-6)

    def test_three_directions_take_three_tendons(self, mast):
        found = tc.move(mast[2], "P4_1_1", (0.01, 0, 0), goal="fewest tendons")
        found.verify()
        assert found.arrives
        assert len(found.tendons) == 3

    def test_the_one_norm_of_a_large_shell(self):
        rest = tc.find_equilibrium(shell_scene(4, 2))
        found = tc.move(rest, "P4_1_2", (0.01, 0, 0), goal="fewest tendons")
        assert found.how == "1-norm"
        assert len(found.tendons) == 3
        found.verify()


class TestReach:
    def test_few_actuators(self):
        """Two tendons reach a plane: the rest is named, and square to it."""
        _, _, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": ["t5_1_1", "t3_2_1"]}))
        found = tc.move(linear, "P4_1_1", (0.01, 0, 0))
        assert not found.arrives
        assert np.abs(found.program.S.T @ found.residual).max() < 1e-12
        assert np.allclose(found.reached + found.residual, found.by)

    def test_optimality_sees_what_is_not_least(self, mast):
        found = tc.move(mast[2], "P4_1_1", (0.01, 0, 0))
        assert optimality(found.program, found.inputs) < 1e-12
        assert optimality(found.program, found.inputs + 1e-4) > 1e-3

    @pytest.mark.parametrize(
        ("node", "by", "words"),
        [
            ("P1_1_1", (0.01, 0, 0), "the ground holds node P1_1_1"),
            ("P4_*", (0.01, 0, 0), "names 3 nodes; name one"),
            ("P9_1_1", (0.01, 0, 0), "P9_1_1"),
            ("P4_1_1", (np.nan, 0, 0), "three finite numbers"),
        ],
    )
    def test_refusals(self, mast, node, by, words):
        with pytest.raises(tc.TensctlError, match=words):
            tc.move(mast[2], node, by)


def test_from_a_scene(tmp_path):
    asked = {"move": [{"node": "P4_1_1", "by": [0.01, 0, 0], "goal": "fewest tendons"}], "horizon": 1.0}
    scene = shell_scene(pins=["P1_*_1"], controllability=asked, linearize={"outputs": ["nodes"]}, report={})
    results = tc.run(scene, tmp_path / "out")
    assert results.study is not None
    results.study.verify()
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Move P4_1_1 by (10, 0, 0) mm" in page
    assert "What it costs within 1 s" in page
    assert tc.Scene(**dict(scene.entries())).to_toml() == scene.to_toml()
    assert 'goal = "fewest tendons"' in scene.to_toml()
