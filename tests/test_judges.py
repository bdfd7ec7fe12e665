"""SUNDIALS on two statements of the physics agrees with the compiled methods, whatever the scene contains."""

import numpy as np
import pytest
from support import MIXED_PINS, random_motion, replaced, shell_scene

import tensctl as tc
from tensctl.simulation import momenta
from tensctl.simulation.integrators.choose import fitting

SCENES = {
    "taut and free": shell_scene(tendons={"rest_ratio": 0.5}),
    "switching, pinned, heavy": shell_scene(pins=MIXED_PINS, gravity={"g": 9.8}),
    "EA, dampers and drag": shell_scene(
        pins=["P1_*_1"], tendons={"EA": 100.0, "damping": 2.0}, drag={"coefficient": 0.3}
    ),
    "class 2": shell_scene(3, 2, cls=2, pins=["P1_*_1"]),
    "guides": shell_scene(pins={"P1_1_1": "z", "P1_2_1": "xy"}),
}
TIMES = [0.0, 0.1, 0.25]


@pytest.mark.parametrize("judge", ["cvodes", "idas"])
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_judges_agree(scene, judge):
    dynamics = tc.build_dynamics(scene)
    ours = tc.simulate(dynamics, dynamics.structure.nodes, timepts=TIMES, tol=1e-11)
    theirs = tc.simulate(dynamics, dynamics.structure.nodes, timepts=TIMES, tol=1e-8, method=judge)
    assert theirs.method == judge
    assert np.abs(ours.nodes - theirs.nodes).max() < 1e-7
    assert np.abs(ours.nodes[-1] - ours.nodes[0]).max() > 0.01
    assert theirs.rod_drift < 1e-14


@pytest.mark.parametrize("judge", ["cvodes", "idas"])
def test_damped_switching_with_a_push(judge):
    """Forces jump where damped tendons become taut: judges pass over that in hundreds of steps, not millions."""
    dynamics = tc.build_dynamics(shell_scene(tendons={"damping": 2.0}))
    given = {"timepts": [0.0, 0.15, 0.3], "pushes": [tc.Push("P4_1_1", [5.0, 0.0, 0.0], 0.1, 0.2)]}
    ours = tc.simulate(dynamics, dynamics.structure.nodes, tol=1e-11, **given)
    theirs = tc.simulate(dynamics, dynamics.structure.nodes, tol=1e-8, method=judge, **given)
    assert (ours.lengths <= ours.rest_lengths).any() or (ours.tensions == 0).any()
    assert np.abs(ours.nodes - theirs.nodes).max() < 1e-7


@pytest.mark.parametrize("judge", ["cvodes", "idas"])
@pytest.mark.parametrize("clamped", [True, False])
def test_dampers_that_may_push(judge, clamped):
    """Tendons that shorten fast: unclamped their dampers push with hundreds of newtons, in every method alike."""
    dynamics = replaced(tc.build_dynamics(shell_scene(tendons={"damping": 20.0})), clamped=clamped)
    start = random_motion(dynamics.potential, np.random.default_rng(2), reach=0.0, speed=5.0)
    ours, theirs = (
        tc.simulate(dynamics, start, timepts=[0.0, 0.02], tol=1e-9, method=method) for method in ("dopri5", judge)
    )
    assert bool(ours.tensions.min() < -100) is not clamped
    assert np.abs(ours.nodes - theirs.nodes).max() < 1e-8


@pytest.mark.parametrize("judge", ["cvodes", "idas"])
def test_inputs_over_time(judge):
    """Ramps with lag, pushes, waves and tables, from a moving start."""
    scene = shell_scene(actuators={"lag": 0.1})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    given = {
        "timepts": [0.0, 0.2, 0.5],
        "schedule": [tc.Schedule("t5_*", [0.0, 0.3], [0.0, 0.05])],
        "pushes": [
            tc.Push("P4_1_1", [3, 0, 0], 0.05, 0.15),
            tc.Wave("P4_2_1", [0, 2, 0], frequency=3.0),
            tc.History("P1_*", [0.0, 0.4], [[0, 0, 1], [1, 0, 0]]),
        ],
    }
    ours = tc.simulate(dynamics, rest, **given)
    theirs = tc.simulate(dynamics, rest, method=judge, **given)
    assert np.abs(ours.nodes - theirs.nodes).max() < 1e-8
    assert np.abs(momenta(dynamics, ours)[0] - momenta(dynamics, theirs)[0]).max() < 1e-8


@pytest.mark.parametrize("judge", ["cvodes", "idas"])
def test_large_structures_are_refused(judge):
    dynamics = tc.build_dynamics(shell_scene(12, 6))
    with pytest.raises(tc.SimulationError, match=f"{judge} is for up to 400 tendons, not 696"):
        tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.1, method=judge)


def test_auto_takes_no_judge_of_large_structures():
    """Stiff dampers on joints: CVODES up to its 400 tendons, beyond them what can move the structure."""
    taken = [
        fitting(tc.build_dynamics(shell_scene(n, 6, cls=2, tendons={"damping": {"ratio": 100.0}})), 1e-10)[0]
        for n in (3, 11)
    ]
    assert taken == ["cvodes", "dopri5"]


def test_a_solver_that_gives_up_is_quoted_without_its_sources():
    from tensctl.simulation.integrators.judge import _cause

    said = '.../sundials/idas_interface.cpp:620: IDACalcIC returned "IDA_LINESEARCH_FAIL". Consult IDAS documentation.'
    assert _cause("first line\n" + said) == "IDACalcIC returned IDA_LINESEARCH_FAIL"
    assert _cause("first line\nlast line") == "last line"


@pytest.mark.parametrize("pins", [{}, {"a": "xy", "b": "y"}], ids=["free", "one end pinned, one guided"])
@pytest.mark.parametrize("tol", [1e-4, 1e-6, 1e-8, 1e-10])
def test_idas_starts_from_rest_at_every_tolerance(pins, tol):
    """Out of equilibrium, where accelerations jump from nothing: the error follows the tolerance down."""
    structure = {
        "kind": "planar",
        "nodes": {"a": [0, 0], "b": [2, 0], "c": [2, 1.5], "d": [0, 1.4]},
        "rods": {"r1": ["a", "c"], "r2": ["d", "b"]},
        "tendons": {"t1": ["a", "b"], "t2": ["b", "c"], "t3": ["c", "d"], "t4": ["d", "a"]},
        "pins": pins,
    }
    dynamics = tc.build_dynamics(tc.Scene(structure=structure, tendons={"damping": 1.0}))
    exact = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.5, method="dopri5", tol=1e-12)
    run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.5, method="idas", tol=tol)
    assert np.abs(run.nodes[-1] - exact.nodes[-1]).max() < 2 * tol
