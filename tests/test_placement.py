"""Choices of actuators against trying them all, and bounds that hold."""

from itertools import combinations

import numpy as np
import pytest
from support import prism_scene, shell_scene, solved

import tensctl as tc
from tensctl.analysis import place
from tensctl.analysis.gramian import controllability_gramian, single_gramians
from tensctl.analysis.measures import MEASURES, measure_of
from tensctl.analysis.placement import slowest_period
from tensctl.analysis.reach import Reach


@pytest.fixture(scope="module")
def prism():
    return solved(prism_scene(pins=["a*"]), outputs=("nodes",))[2]


@pytest.fixture(scope="module")
def mast():
    return solved(shell_scene(pins=["P1_*_1"]), outputs=("nodes",))[2]


def taken(chosen, count):
    return np.isin(np.arange(count), chosen).astype(float)


@pytest.mark.parametrize("name", MEASURES)
class TestMeasures:
    def test_slope_is_a_plane_above(self, mast, name, rng):
        """Concave: the tangent plane at z lies above f everywhere, and touches it at z."""
        f = measure_of(mast, name, 0.8)
        for _ in range(5):
            z, y = rng.uniform(0, 1, f.count), rng.uniform(0, 1, f.count)
            assert f(y) <= f(z) + f.slope(z) @ (y - z) + 1e-9 * abs(f(y))
            h = 1e-6
            along = (f(z + h * (y - z)) - f(z - h * (y - z))) / (2 * h)
            assert along == pytest.approx(f.slope(z) @ (y - z), rel=1e-3)

    def test_more_tendons_are_never_worse(self, mast, name, rng):
        f = measure_of(mast, name, 0.8)
        for _ in range(10):
            few = taken(rng.choice(f.count, 5, replace=False), f.count)
            more = np.maximum(few, taken(rng.choice(f.count, 3, replace=False), f.count))
            assert f(more) >= f(few) - 1e-12 * abs(f(few))

    @pytest.mark.parametrize("count", [1, 2, 3])
    def test_by_trying_all(self, prism, mast, name, count):
        for linear in (prism, mast) if count < 3 else (prism,):
            found = place(linear, count, name)
            found.verify()
            every = (taken(chosen, found.measure.count) for chosen in combinations(range(found.measure.count), count))
            best = max(found.measure(z) for z in every)
            assert found.exact
            assert found.value == pytest.approx(best, rel=1e-8, abs=1e-12)
            assert found.bound == pytest.approx(best, rel=1e-8, abs=1e-12)

    def test_all_of_them(self, prism, name):
        found = place(prism, 6, name)
        assert found.exact
        assert found.value == found.measure(np.ones(6))


@pytest.mark.parametrize("name", ["log det", "static reach"])
class TestSubmodular:
    def test_what_a_tendon_adds_shrinks(self, mast, name, rng):
        f = measure_of(mast, name, 0.8)
        assert f(np.zeros(f.count)) == pytest.approx(0, abs=1e-12)
        for _ in range(20):
            order = rng.permutation(f.count)
            few, more, one = taken(order[:3], f.count), taken(order[:6], f.count), taken(order[6:7], f.count)
            assert f(more + one) - f(more) <= f(few + one) - f(few) + 1e-9

    def test_greedy_keeps_its_promise(self, mast, name):
        for count in (2, 4):
            found = place(mast, count, name)
            assert found.greedy >= (1 - 1 / np.e) * found.bound


class TestBounds:
    def test_hold_where_the_search_ends_early(self, free, monkeypatch):
        """None of the 10 626 choices of four on the free shell measures more than the bound of a cut-off search."""
        import tensctl.analysis.placement as module

        monkeypatch.setattr(module, "_BRANCHES", 10)
        found = place(free[2], 4, "least gain")
        found.verify()
        assert not found.exact
        best = max(found.measure(taken(chosen, 24)) for chosen in combinations(range(24), 4))
        assert found.value <= best <= found.bound * (1 + 1e-9)

    def test_words(self, prism):
        assert "nothing is better" in str(place(prism, 2, "least gain"))


def test_gramians_of_single_tendons_add_up(mast):
    """In the square root of the energy, as the Gramian of all has them."""
    each, whole = single_gramians(mast, 0.7), controllability_gramian(mast, 0.7).matrix
    assert np.abs(each.sum(axis=0) - whole).max() < 1e-13 * np.abs(whole).max()


def test_least_gain_is_that_of_the_report(mast):
    """With all tendons, the square root of the measure is the least gain of the report, k being the same everywhere."""
    f = measure_of(mast, "least gain", 1.0)
    gains = [mode.gain for mode in tc.controllability(mast).modes]
    assert np.sqrt(f(np.ones(f.count))) == pytest.approx(min(gains) / 10, rel=1e-12)


def test_static_reach_is_static_influence(mast):
    """Outputs at rest by modes are those by the factored Hessian."""
    from tensctl.analysis import static_influence
    from tensctl.analysis.measures import static_outputs

    rest = mast.equilibrium
    moved = rest.point.tangent @ static_influence(rest)
    wanted = moved[mast.dynamics.structure.free.ravel()] / 10  # sqrt(k) of every tendon
    found = static_outputs(mast)
    kept = np.abs(wanted).max(axis=1) > 0
    assert np.abs(found - wanted[kept]).max() < 1e-11 * np.abs(wanted).max()
    assert Reach(mast).rank == np.linalg.matrix_rank(found, tol=1e-9 * np.abs(found).max())


def test_slowest_period(mast):
    assert slowest_period(mast) == pytest.approx(1 / mast.modes[0].frequency)


@pytest.mark.parametrize(("count", "words"), [(0, "0 actuators"), (7, "7 actuators")])
def test_refusals(prism, count, words):
    with pytest.raises(tc.LinearizationError, match=words):
        place(prism, count)


def test_from_a_scene(tmp_path):
    scene = prism_scene(pins=["a*"], controllability={"place": 2}, linearize={"outputs": ["nodes"]}, report={})
    results = tc.run(scene, tmp_path / "out")
    assert results.study is not None
    results.study.verify()
    assert len(results.study.placements) == 4
    assert "Where to put 2 actuators" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "place = 2" in scene.to_toml()
