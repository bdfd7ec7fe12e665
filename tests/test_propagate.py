"""Nodes over time without a run: the same motion as `simulate`, for less."""

import numpy as np
import pytest
from support import MIXED_PINS, mast_scene, pendulum_scene, random_motion, shell_scene, solved

import tensctl as tc
from tensctl.errors import SimulationError

TIMES = [0.0, 0.1, 0.25, 0.4]


def moving(scene, seed=1):
    dynamics = tc.build_dynamics(scene)
    return dynamics, random_motion(dynamics.potential, np.random.default_rng(seed))


SCENES = {
    "free": shell_scene(),
    "held": shell_scene(pins=MIXED_PINS, gravity={"g": [0.0, 0.0, -9.81]}),
    "strain": shell_scene(n=4, m=2, tendons={"EA": 100.0, "rest_ratio": 0.8}),
    "cables": mast_scene(),
    "damped": shell_scene(tendons={"damping": 1.0}),
    "pendulum": pendulum_scene(),
}


@pytest.mark.parametrize("name", SCENES)
def test_moves_as_a_run_does(name):
    """Slack-taut switches included: both agree to the tolerance, and rods and pins stay as they are."""
    dynamics, (nodes, velocities) = moving(SCENES[name])
    fly = tc.propagator(dynamics, tol=1e-10)
    found, rates = fly(nodes, velocities, TIMES)
    run = tc.simulate(dynamics, (nodes, velocities), timepts=TIMES, tol=1e-12)
    np.testing.assert_allclose(found, run.nodes, atol=2e-9)
    np.testing.assert_allclose(rates, run.velocities, atol=2e-7)
    np.testing.assert_array_equal(found[0][dynamics.structure.held], nodes[dynamics.structure.held])
    assert np.array_equal(found[:, dynamics.structure.pinned], run.nodes[:, dynamics.structure.pinned])


def test_is_the_same_from_call_to_call():
    """What is kept between calls has no memory of the motion."""
    dynamics, (nodes, velocities) = moving(SCENES["free"])
    fly = tc.propagator(dynamics)
    first = fly(nodes, velocities, TIMES)
    fly(*moving(SCENES["free"], seed=2)[1], [0.0, 1.0])
    again = fly(nodes, velocities, TIMES)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)


def test_stays_at_an_equilibrium():
    dynamics, rest, _ = solved(SCENES["free"])
    fly = tc.propagator(dynamics, rest_lengths=rest.rest_lengths, tol=1e-9)
    found, _ = fly(rest.nodes, np.zeros_like(rest.nodes), [0.0, 2.0])
    np.testing.assert_allclose(found[-1], rest.nodes, atol=1e-12)


def test_error_falls_with_the_tolerance():
    """A (3,1) shell that rests taut and is kicked: the error stays below the tolerance."""
    dynamics, rest, _ = solved(SCENES["free"])
    velocities = _shaken(rest)
    exact = _end(dynamics, rest, velocities, 1e-13)
    for tol in (1e-4, 1e-7, 1e-10):
        assert np.abs(_end(dynamics, rest, velocities, tol) - exact).max() < tol


def _shaken(rest):
    manifold = rest.potential.manifold
    push = np.random.default_rng(3).standard_normal(manifold.size)
    return (manifold.tangent(rest.nodes) @ (0.2 * push)).reshape(-1, 3)


def _end(dynamics, rest, velocities, tol):
    fly = tc.propagator(dynamics, rest_lengths=rest.rest_lengths, tol=tol)
    return fly(rest.nodes, velocities, [0.0, 0.5, 1.0])[0][-1]


def test_says_what_does_not_fit():
    dynamics, (nodes, velocities) = moving(SCENES["held"])
    fly = tc.propagator(dynamics)
    with pytest.raises(SimulationError, match="ascending"):
        fly(nodes, velocities, [0.0, 0.0])
    with pytest.raises(SimulationError, match="shape"):
        fly(nodes[1:], velocities[1:], TIMES)
    longer = nodes.copy()
    longer[dynamics.structure.rods[2, 1]] *= 1.1
    with pytest.raises(SimulationError, match="rod"):
        fly(longer, velocities, TIMES)
    with pytest.raises(SimulationError, match="rest_lengths"):
        tc.propagator(dynamics, rest_lengths=np.ones(3))
    with pytest.raises(SimulationError, match="tol"):
        tc.propagator(dynamics, tol=0)
    with pytest.raises(SimulationError, match="undamped"):
        tc.propagator(tc.build_dynamics(SCENES["damped"]), method="splitting6")
