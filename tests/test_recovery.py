"""Recovery: brackets against runs made apart, an energy barrier, exact scaling, symmetry, and a linear case."""

import numpy as np
import pytest
from support import prism_scene, replaced, shell_scene, solved

import tensctl as tc
from tensctl.simulation.recover import _hold
from tensctl.simulation.trial import Experiment

DAMPED = {"stiffness": 100.0, "rest_ratio": 0.8, "damping": {"ratio": 0.05}}


def prism(**tendons):
    scene = prism_scene(3, pins=["a*"], tendons=DAMPED | tendons)
    return tc.build_dynamics(scene), tc.find_equilibrium(scene)


@pytest.fixture(scope="module")
def pushed():
    """The pinned prism under LQG, pushed at a top node."""
    dynamics, rest = prism()
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, seed=3)
    design = tc.lqg(tc.linearize(dynamics, rest), eyes, dt=0.02)
    push = tc.Push("b1", (2.0, 0.0, 0.0), 0.0, 0.1)
    return tc.recovery(dynamics, rest, design, disturbances=[push], cap=320.0, t_end=10.0, rate_max=0.5, below=2)


class TestBracket:
    def test_lies_between_trials_and_holds_strictly(self, pushed):
        (low, high), (kept,), (lost,) = pushed.bracket[0], pushed.kept, pushed.lost
        assert low < high <= 1.05 * low
        assert kept.recovered
        assert kept.amplitude == low
        assert lost.reason == "rods meet"
        assert lost.amplitude == high
        amplitudes = [trial.amplitude for trial in pushed.trials[0]]
        assert amplitudes == sorted(amplitudes)
        assert all(trial.recovered == (trial.amplitude < high) for trial in pushed.trials[0])
        pushed.verify()

    def test_runs_made_apart_say_the_same(self, pushed):
        """Whole runs without a watcher: shape, slack and peak of the kept one, rods of both."""
        asked, rest = pushed.experiment, pushed.experiment.equilibrium
        runs = {}
        for trial in (pushed.kept[0], pushed.lost[0]):
            push = tc.Push("b1", (trial.amplitude, 0.0, 0.0), 0.0, 0.1)
            runs[trial] = run = tc.simulate(
                asked.dynamics, rest, controller=asked.controller, t_end=10.0, rate_max=0.5, pushes=[push], tol=1e-9
            )
            seen = run.time <= trial.time + 1e-9
            assert run.distance_to(rest.nodes)[seen].max() == pytest.approx(trial.peak, rel=1e-3)
            slack = (run.tensions[seen] == 0).any(axis=0) & ~run.structure.grounded_tendons
            assert {run.structure.tendon_labels[k] for k in np.flatnonzero(slack)} == set(trial.slack)
            passings = tc.inspect_run(asked.dynamics, run, pushes=[push]).rods.passings
            assert bool(passings) == (not trial.recovered)
        kept = runs[pushed.kept[0]]
        assert kept.distance_to(rest.nodes)[kept.time >= pushed.kept[0].time - asked.hold].max() <= asked.within
        moves = np.abs(np.diff(kept.inputs, axis=0)).max(axis=1)[: round(pushed.kept[0].time / 0.02)]
        assert (moves >= 0.5 * 0.02 * (1 - 1e-9)).mean() == pytest.approx(pushed.kept[0].rate_share, abs=0.01)
        assert 0 < pushed.kept[0].rate_share < 1

    def test_a_bracket_that_is_none_is_refused(self, pushed):
        wrong = np.array([[pushed.bracket[0, 0], pushed.trials[0][0].amplitude]])
        swapped = tuple(replaced(trial, reason="lost") for trial in pushed.trials[0])
        with pytest.raises(tc.SimulationError, match="it came back with 1e-08"):
            replaced(pushed, bracket=wrong, trials=(swapped,)).verify()

    def test_it_says_what_it_found(self, pushed):
        text = str(pushed)
        assert text.startswith(f"b1 (1, 0, 0) 0.1 s: from {pushed.largest[0]:.4g} N; not from")
        assert "rods meet" in text
        assert pushed.units == ("N",)


class TestBarrier:
    """A rod that stands between two ties may be thrown over, and rests upside down as well."""

    STIFFNESS, LENGTH = 100.0, 0.9

    def arch(self):
        nodes = {"o": [0, 0], "head": [0, 1], "left": [-2, 0], "right": [2, 0]}
        scene = tc.Scene(
            structure={
                "kind": "planar", "nodes": nodes, "rods": {"rod": ["o", "head"]},
                "tendons": {"a": ["left", "head"], "b": ["head", "right"]}, "pins": ["o", "left", "right"],
            },
            tendons={"stiffness": self.STIFFNESS, "rest_length": self.LENGTH, "damping": {"ratio": 0.1}},
        )  # fmt: skip
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        return dynamics, rest, tc.Kick("turn", tc.linearize(dynamics, rest).modes[0].shape)

    def barrier(self, dynamics):
        """Speed of the head whose energy just lifts the rod to where it lies, without damping."""
        stretched = [(np.sqrt(5) - self.LENGTH,) * 2, (1 - self.LENGTH, 3 - self.LENGTH)]
        standing, lying = (0.5 * self.STIFFNESS * sum(s**2 for s in pair) for pair in stretched)
        return np.sqrt(2 * (lying - standing) * 3 / dynamics.members.mass[0])

    def test_the_first_loss_is_beyond_the_barrier(self):
        """No smaller kick has the energy; the damper takes less than a third of it on the way up."""
        dynamics, rest, kick = self.arch()
        found = tc.recovery(dynamics, rest, disturbances=[kick], cap=40.0, t_end=10.0, dt=0.05, below=1)
        least = self.barrier(dynamics)
        assert least < found.bracket[0, 1]
        assert found.largest[0] < np.sqrt(1.5) * least
        assert found.reasons == ("another equilibrium",)
        assert found.units == ("m/s",)

    def test_larger_kicks_that_come_back_do_not_hide_the_loss(self):
        """The climb steps over the band from which it is caught; the samples below see it."""
        dynamics, rest, kick = self.arch()
        found = tc.recovery(dynamics, rest, disturbances=[kick], cap=100.0, t_end=10.0, dt=0.05)
        assert found.recovered_above[0] > 0
        assert "larger ones too" in str(found)
        assert self.barrier(dynamics) < found.bracket[0, 1] < np.sqrt(1.5) * self.barrier(dynamics)


def slider(stiffness):
    """A rod along x that slides on a rail between two ties: linear as long as both are taut."""
    nodes = {"left": [-2, 0, 0], "tail": [0, 0, 0], "head": [1, 0, 0], "right": [3, 0, 0]}
    pins = {"left": "xyz", "right": "xyz", "tail": "yz", "head": "yz"}
    structure = tc.network(nodes, {"rod": ["tail", "head"]}, {"l": ["left", "tail"], "r": ["head", "right"]}, pins=pins)
    tendons = {"stiffness": stiffness, "rest_length": 1.0, "damping": {"ratio": 0.2}}
    scene = tc.Scene(structure=structure, tendons=tendons)
    return tc.build_dynamics(scene), tc.find_equilibrium(scene)


def test_a_linear_case_comes_back_from_all_that_is_tried():
    dynamics, rest = slider(100.0)
    push = tc.Push("head", (1.0, 0.0, 0.0), 0.0, 0.2)
    found = tc.recovery(dynamics, rest, disturbances=[push], cap=50.0, t_end=10.0)
    assert found.capped == (True,)
    assert found.largest[0] == 50.0
    assert np.isinf(found.bracket[0, 1])
    assert found.kept[0].slack == ()
    assert found.lost == (None,)
    assert "from all tried, up to the cap of 50 N" in str(found)
    amplitudes, peaks = np.array([(t.amplitude, t.peak) for t in found.trials[0]]).T
    assert peaks[-1] > 0.1
    assert peaks == pytest.approx(peaks[-1] / 50.0 * amplitudes, rel=1e-4)


def test_where_nothing_comes_back_in_time():
    dynamics, rest = slider(100.0)
    push = tc.Push("head", (1.0, 0.0, 0.0), 0.0, 0.2)
    found = tc.recovery(dynamics, rest, disturbances=[push], cap=50.0, t_end=0.7, hold=0.4, within=1e-8, below=1)
    assert found.largest[0] == 0.0
    assert found.kept == (None,)
    assert found.reasons == ("did not settle",)


def test_units_decide_nothing():
    """Lengths twice, stiffness four times as large: times halve, forces grow eightfold, brackets too."""
    results = []
    for size, k in ((1.0, 1.0), (2.0, 4.0)):
        tendons = {**DAMPED, "stiffness": 100.0 * k, "damping": {"ratio": 0.3}}
        scene = prism_scene(3, pins=["a*"], radius=size, height=size, tendons=tendons)
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        time = 1 / np.sqrt(k)
        push = tc.Push("b1", (0.0, 1.0, 0.0), 0.0, 0.1 * time)
        found = tc.recovery(
            dynamics,
            rest,
            disturbances=[push],
            cap=128.0 * k * size,
            t_end=12 * time,
            dt=0.02 * time,
            width=0.2,
            below=0,
        )
        results.append(found)
    one, other = results
    assert not one.capped[0]
    assert other.reasons == one.reasons
    assert other.bracket / 8 == pytest.approx(one.bracket, rel=1e-12)
    assert other.experiment.hold == pytest.approx(one.experiment.hold / 2, rel=1e-9)
    assert other.kept[0].peak == pytest.approx(2 * one.kept[0].peak, rel=1e-4)


def test_turned_pushes_on_a_symmetric_prism():
    dynamics, rest = prism()
    controller = tc.lqr(tc.linearize(dynamics, rest), dt=0.02)
    pushes = []
    for k in range(3):
        c, s = np.cos(2 * np.pi * k / 3), np.sin(2 * np.pi * k / 3)
        pushes.append(tc.Push(f"b{k + 1}", (c, s, 0.3), 0.0, 0.1))
    found = tc.recovery(
        dynamics, rest, controller, disturbances=pushes, cap=256.0, t_end=6.0, rate_max=0.5, below=0, width=0.2
    )
    assert not any(found.capped)
    assert found.largest == pytest.approx(found.largest[0], rel=0.21)


def test_a_start_brings_the_rest_lengths_of_its_equilibrium_and_velocities():
    scene = tc.load_scene("examples/shell_3_1.toml")
    dynamics = tc.build_dynamics(scene)
    target = tc.plan_shape(scene).target
    speed = 0.1 * tc.linearize(dynamics, target).modes[0].shape
    run = tc.simulate(dynamics, (target, speed), t_end=1e-6, timepts=[0.0, 1e-6])
    assert np.array_equal(run.rest_lengths[0], target.rest_lengths)
    assert np.abs(target.rest_lengths - dynamics.members.rest_lengths).max() > 1e-3
    assert run.velocities[0] == pytest.approx(speed, abs=1e-12)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"cap": 0.0}, "cap is 0.0"),
        ({"within": np.inf}, "within is inf"),
        ({"t_end": 0.3}, "give a later one"),
        ({"disturbances": []}, "no disturbance"),
        ({"disturbances": [tc.Push("b1", (0.0, 0.0, 0.0), 0.0, 0.1)]}, "has no direction"),
        ({"dt": -1.0}, "control period"),
    ],
)
def test_bad_input_is_told(changed, said):
    dynamics, rest = prism()
    given = {"disturbances": [tc.Push("b1", (1.0, 0.0, 0.0), 0.0, 0.1)], "cap": 1.0, "t_end": 5.0}
    with pytest.raises(tc.SimulationError, match=said):
        tc.recovery(dynamics, rest, **given | changed)


def test_kicks_without_motion_are_refused():
    with pytest.raises(tc.SimulationError, match="not all zero"):
        tc.Kick("still", np.zeros((4, 3)))


def test_hold_is_two_periods_of_the_lowest_mode():
    dynamics, rest = prism()
    lowest = tc.linearize(dynamics, rest).modes[0].frequency
    assert _hold(rest) == pytest.approx(2 / lowest)


@pytest.fixture(scope="module")
def free():
    """What all trials of the free (3,1) shell under LQR have in common."""
    dynamics, rest, linear = solved(shell_scene(3, 1, tendons=DAMPED), outputs=())
    controller = tc.lqr(linear, dt=0.02)
    return Experiment(
        dynamics, rest, controller, t_end=8.0, within=1e-3, hold=1.0, dt=0.02, rate_max=np.inf, collide=True, tol=1e-6
    )


def test_a_drift_is_no_loss(free):
    drift = tc.Kick("drift", np.tile([1.0, 2.0, -0.5], (12, 1)))
    trial = free.at(drift, 5.0)
    assert trial.recovered
    assert trial.peak < 1e-6


def test_a_spin_that_stays_deforms(free):
    """By what balances the centrifugal forces: twice as fast, four times as far."""
    nodes = free.equilibrium.nodes
    spin = tc.Kick("spin", np.cross([0.0, 0.0, 1.0], nodes - nodes.mean(axis=0)))
    slow, fast = free.at(spin, 0.5), free.at(spin, 1.0)
    assert slow.reason == "deformed by its spin"
    assert not fast.recovered
    assert fast.peak / slow.peak == pytest.approx(4.0, rel=0.05)
