"""A free shell under control: its shape comes back in its own frame while it drifts and turns."""

from pathlib import Path

import numpy as np
import pytest

import tensctl as tc
from tensctl.linear import best_fit
from tensctl.simulation import momenta

SCENE = Path(__file__).parents[1] / "examples" / "shell_3_1_free.toml"


@pytest.fixture(scope="module")
def tumbling():
    """Dynamics, equilibrium, run under LQR and the same run without control."""
    scene = tc.load_scene(SCENE)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    push = scene.simulation.push[0]
    pushes = [tc.Push(push.node, push.force, push.start, push.stop)]
    gain = tc.lqr(tc.linearize(dynamics, rest))
    runs = [tc.simulate(dynamics, rest, controller=c, t_end=10.0, pushes=pushes) for c in (gain, None)]
    return dynamics, rest, *runs


def frames(rest, run):
    return [best_fit(rest.potential, rest.nodes, p, v) for p, v in zip(run.nodes, run.velocities, strict=True)]


def shape_error(rest, run):
    seen = np.stack([frame.nodes(nodes) for frame, nodes in zip(frames(rest, run), run.nodes, strict=True)])
    return np.linalg.norm(seen - rest.nodes, axis=2).max(axis=1)


def test_shape_is_back_within_a_millimetre(tumbling):
    _, rest, run, loose = tumbling
    error = shape_error(rest, run)
    assert error.max() > 5e-3
    assert error[run.time >= 5.0].max() < 1e-3
    free = shape_error(rest, loose)
    assert free[loose.time >= 5.0].max() > 5e-3


def test_it_drifts_and_turns_meanwhile(tumbling):
    _, rest, run, _ = tumbling
    last = frames(rest, run)[-1]
    assert np.linalg.norm(last.centre - last.reference_centre) > 1.5
    assert last.angle > 2.0


def test_control_leaves_momenta_as_the_push_left_them(tumbling):
    dynamics, _, run, loose = tumbling
    for controlled, alone in zip(momenta(dynamics, run), momenta(dynamics, loose), strict=True):
        after = controlled[run.time > 0.75]
        assert np.abs(after - after[0]).max() < 1e-11 * np.abs(after).max()
        assert np.abs(alone[-1]).max() > 0.1


def test_angle_of_a_frame():
    """The angle of turns about an axis, up to half a turn."""
    rest = tc.find_equilibrium(tc.load_scene(SCENE))
    still = np.zeros_like(rest.nodes)
    for angle in (0.0, 1e-8, 0.7, 3.1):
        c, s = np.cos(angle), np.sin(angle)
        turned = rest.nodes @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        assert best_fit(rest.potential, rest.nodes, turned, still).angle == pytest.approx(angle, abs=1e-12)
