"""LQR along a path: at rest it is the LQR of that shape; on the way it follows where the target's alone runs wild."""

from types import SimpleNamespace

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc

SCENE = shell_scene(pins=["P1_*_1"], target={"height_scale": 1.2, "start": 0.2, "duration": 1.5})


@pytest.fixture(scope="module")
def planned():
    """Path and dynamics."""
    return tc.plan_shape(SCENE, tension_min=0.1), tc.build_dynamics(SCENE)


def sampled(linear):
    return tc.lqr(linear, dt=0.02)


@pytest.mark.parametrize("design", [tc.lqr, sampled], ids=["continuous", "sampled"])
def test_at_both_ends_it_is_the_lqr_of_the_shape(planned, design):
    """Before and after the motion the command is that of the design about the shape held then."""
    path, dynamics = planned
    along, rng = tc.scheduled_lqr(path, dynamics, design), np.random.default_rng(0)
    along.verify()
    for t, equilibrium in ((0.0, path.equilibria[0]), (5.0, path.target)):
        alone = design(tc.linearize(dynamics, equilibrium, outputs=()))
        nodes = equilibrium.potential.manifold.retract(equilibrium.nodes, 0.01 * rng.standard_normal(21))
        seen = SimpleNamespace(
            nodes=nodes, velocities=np.zeros_like(nodes), inputs=equilibrium.inputs + 0.01 * rng.standard_normal(21)
        )
        assert np.abs(along.step(t, seen) - alone.step(t, seen)).max() < 1e-9


def test_every_second_shape_has_a_design(planned):
    path, dynamics = planned
    along = tc.scheduled_lqr(path, dynamics)
    assert along.knots.tolist() == [0, 2, 4, 6, 8]
    assert along.at(0.0) is along.designs[0]
    assert along.at(path.time[4]) is along.designs[2]
    assert along.at(9.0) is along.designs[-1]
    assert along.dt == min(design.dt for design in along.designs)
    assert along.slowest < 0
    assert tc.scheduled_lqr(path, dynamics, every=3).knots.tolist() == [2, 5, 8]


def test_follows_where_the_target_alone_does_not(planned):
    path, dynamics = planned
    kept, worst = ~path.target.structure.grounded_tendons, []
    along = tc.scheduled_lqr(path, dynamics, sampled)
    alone = sampled(tc.linearize(dynamics, path.target, outputs=()))
    for controller, t_end in ((along, 3.0), (alone, 0.6)):
        run = tc.simulate(dynamics, path.equilibria[0], controller=controller, t_end=t_end)
        off = run.nodes - np.stack([path.nodes_at(t) for t in run.time])
        worst.append((np.linalg.norm(off, axis=2).max(), run.tensions[:, kept].min()))
    assert worst[0][0] < 0.01
    assert worst[0][1] > 1.0
    assert worst[1][0] > 0.1
    assert worst[1][1] == 0.0


def test_scenes_run_it(tmp_path):
    scene = SCENE.replaced(lqr={"dt": 0.02}, linearize={}, simulation={"t_end": 2.5, "controller": "lqr"})
    results = tc.run(scene, out=tmp_path)
    assert isinstance(results.scheduled, tc.ScheduledLQR)
    assert results.shape_error[0] > 0.2
    assert results.shape_error[-1] < 2e-3
    held = tc.run(scene.replaced(target=None, simulation={"t_end": 0.1, "controller": "lqr"}), out=tmp_path)
    assert held.scheduled is None


def test_refusal(planned):
    with pytest.raises(tc.SynthesisError, match="every is 0; expected a whole number >= 1"):
        tc.scheduled_lqr(*planned, every=0)
