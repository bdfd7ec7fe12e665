"""On the slack boundary the structure has one linear model on each side."""

import inspect

import numpy as np
import pytest
from linear_support import STEPS, Neighbour
from support import replaced, shell_scene, solved, taylor_order

import tensctl as tc
from tensctl.linear.boundary import _on_edge, one_sided
from tensctl.statics.stability import unknown_force

LABEL = "t5_1_1"


@pytest.fixture(scope="module", params=["k", "EA, damped"])
def edge(request):
    """The pinned mast at rest with one tendon exactly as long as its rest length: it carries nothing."""
    tendons = {"k": {}, "EA, damped": {"EA": 150.0, "damping": 1.5}}[request.param]
    scene = shell_scene(pins=["P1_*_1"], tendons=tendons | {"rest_ratio": {"*": 0.8, LABEL: 2.5}})
    dynamics, rest, slack = solved(scene)
    k = rest.structure.tendon_labels.index(LABEL)
    at = rest.rest_lengths.copy()
    at[k] = rest.lengths[k]
    return dynamics, replaced(rest, rest_lengths=at), slack, k


def shortened(edge, part):
    dynamics, rest, _, k = edge
    at = rest.rest_lengths.copy()
    at[k] *= 1 - part
    return tc.linearize(dynamics, replaced(rest, rest_lengths=at)).sparse


class TestOneSided:
    def test_is_refused_unless_a_side_is_chosen(self, edge):
        with pytest.raises(tc.LinearizationError, match=f'tendon {LABEL}.*two linear models.*on_boundary="taut"'):
            tc.linearize(edge[0], edge[1])

    def test_slack_is_the_model_without_the_tendon(self, edge):
        dynamics, rest, slack, k = edge
        linear = tc.linearize(dynamics, rest, on_boundary="slack")
        for part in ("M", "C", "K", "G", "P", "V"):
            assert abs(getattr(linear.sparse, part) - getattr(slack.sparse, part)).max() == 0
        assert linear.equilibrium.tensions[k] == 0

    def test_taut_is_the_limit_of_taut(self, edge):
        """Everything of the model, at a distance h from the boundary, goes to it linearly."""
        taut = tc.linearize(edge[0], edge[1], on_boundary="taut").sparse
        for part in ("C", "K", "G", "P", "V", "F"):
            wanted = getattr(taut, part).toarray()
            steps = np.array([1e-3, 1e-4, 1e-5])
            gaps = [np.abs(getattr(shortened(edge, h), part).toarray() - wanted).max() for h in steps]
            assert gaps[2] <= 0.011 * gaps[0] + 1e-12 * np.abs(wanted).max()

    @pytest.mark.parametrize("side", ["taut", "slack"])
    def test_taylor_on_its_own_side(self, edge, side):
        """Along a motion that stretches the tendon the taut model is the derivative, along the other one the slack."""
        dynamics, rest, _, k = edge
        linear = tc.linearize(dynamics, rest, outputs=("tensions",), on_boundary=side)
        near = Neighbour((dynamics, linear.equilibrium, linear))
        way = linear.stretch[k] / linear.scales
        x = np.concatenate([way / np.linalg.norm(way) * (1 if side == "taut" else -1), 0 * way])[linear.order]
        u = rest.inputs

        def left(h):
            return near.rate(h * x, u) - near.rate(0 * x, u) - h * (linear.A @ x)

        assert 1.9 < taylor_order(left, STEPS) < 2.2

    def test_by_label(self, edge):
        dynamics, rest = edge[:2]
        wanted = tc.linearize(dynamics, rest, on_boundary="taut")
        found = tc.linearize(dynamics, rest, on_boundary={"*": "slack", "t5_*": "taut"})
        assert abs(found.sparse.K - wanted.sparse.K).max() == 0
        with pytest.raises(tc.LinearizationError, match=LABEL):
            tc.linearize(dynamics, rest, on_boundary={"t6_*": "taut"})

    def test_both_sides_differ_by_the_tendon_alone(self, edge):
        """K(taut) - K(slack) = k g g', g = dl/dxi."""
        dynamics, rest, _, k = edge
        taut, slack = (tc.linearize(dynamics, rest, on_boundary=side) for side in ("taut", "slack"))
        g = taut.showing((f"lengths:{LABEL}",)).sparse.P.toarray()[0]
        members = dynamics.members
        stiffness = members.stiffness[k] if members.law == "k" else members.stiffness[k] / rest.rest_lengths[k]
        gap = (taut.sparse.K - slack.sparse.K).toarray()
        assert np.abs(gap - stiffness * np.outer(g, g)).max() < 1e-12 * np.abs(gap).max()


def test_away_from_the_boundary_no_side_matters():
    dynamics, rest, linear = solved(shell_scene())
    assert tc.linearize(dynamics, rest, on_boundary="taut").equilibrium is rest
    assert (tc.linearize(dynamics, rest, on_boundary="slack").A == linear.A).all()


def test_no_prestress_has_a_taut_model():
    """All tendons exactly on the boundary: refused as slack, or taken as taut with mechanisms that nothing stiffens."""
    scene = shell_scene(tendons={"rest_ratio": 1.0})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    with pytest.raises(tc.LinearizationError, match="every tendon is slack"):
        tc.linearize(dynamics, rest)
    linear = tc.linearize(dynamics, rest, on_boundary="taut")
    stretched = np.linalg.matrix_rank(linear.stretch, 1e-9)
    kinds = [mode.kind for mode in linear.modes]
    assert kinds.count("flexible") == stretched
    assert kinds.count("rigid-body") == 6
    assert kinds.count("mechanism") == len(kinds) - 6 - stretched


def test_unknown_side(edge):
    with pytest.raises(tc.LinearizationError, match='on_boundary is "tight"; expected one of refuse, taut, slack'):
        inspect.unwrap(one_sided)(edge[1], "tight")


class TestWhatDoublePrecisionTells:
    def stiff(self, ratio):
        """The (4,1) shell with one kind of tendon stiffer at the same tension."""
        tendons = {"stiffness": {"*": 100.0, "t5_*": 100.0 * ratio}, "rest_ratio": {"*": 0.8, "t5_*": 1 - 0.2 / ratio}}
        scene = shell_scene(4, 1, tendons=tendons)
        return tc.build_dynamics(scene), tc.find_equilibrium(scene)

    def test_a_stiff_tendon_is_as_taut_as_its_tension(self):
        """Stretches of 1e-10 to 1e-13 of the length; the softest frequency goes to its limit with 1/ratio."""
        limit = tc.linearize(*self.stiff(1e6)).flexible.modes[0].omega2
        for ratio in (1e9, 1e12):
            dynamics, rest = self.stiff(ratio)
            stretch = (rest.lengths - rest.rest_lengths) / rest.lengths
            assert 0 < stretch.min() < 1 / ratio
            linear = tc.linearize(dynamics, rest)
            assert linear.equilibrium is rest
            modes = linear.flexible.modes
            rounding = np.finfo(float).eps * modes[-1].omega2 / modes[0].omega2
            assert modes[0].omega2 == pytest.approx(limit, rel=1e-5 + rounding)

    @pytest.mark.parametrize("side", [-1, 1])
    def test_a_tension_below_what_is_unknown_decides_nothing(self, side):
        dynamics, rest = self.stiff(1e9)
        k = rest.structure.tendon_labels.index("t5_1_1")
        assert not _on_edge(rest, rest.lengths - rest.rest_lengths)[k]
        at = rest.rest_lengths.copy()
        at[k] = rest.lengths[k]
        force = unknown_force(replaced(rest, rest_lengths=at).point)
        at[k] -= side * 1e-3 * force / dynamics.members.stiffness[k]
        assert _on_edge(replaced(rest, rest_lengths=at), np.abs(rest.lengths - at))[k]
