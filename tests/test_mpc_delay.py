"""Time that computation takes, and modes that samples cannot follow: both are in the model as they are in the plant."""

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc
from tensctl.synthesis.sampling_limit import below_sampling_limit

DT = 0.02


class Watched(tc.MPC):
    """Keeps where each step expects to be when its command begins to act."""

    def reset(self):
        super().reset()
        self.expected = []

    def limits(self, t, measurement):
        found = super().limits(t, measurement)
        self.expected.append(found.start)
        return found


@pytest.mark.parametrize("share", [0.0, 0.35, 1.0])
def test_the_state_when_a_command_begins_to_act_is_predicted(mast, rng, share):
    """Against the nonlinear structure in a motion so small that its curvature is 1e-5 of it."""
    dynamics, rest, linear = mast
    delay = share * DT
    controller = Watched(linear, horizon=5, dt=DT, delay=delay)
    start = rest.potential.manifold.retract(rest.nodes, 1e-6 * rng.standard_normal(21))
    samples = DT * np.arange(10)
    times = np.unique(np.concatenate([samples, samples + delay, [10.5 * DT]]).round(12))
    run = tc.simulate(dynamics, start, controller=controller, timepts=times)
    for t, expected in zip(samples, controller.expected, strict=False):
        k = np.abs(run.time - t - delay).argmin()
        state = np.concatenate([linear.flexible.state_of(run.nodes[k], run.velocities[k]), run.inputs[k] - rest.inputs])
        assert np.linalg.norm(state - expected) < 1e-4 * np.linalg.norm(controller.expected[0])


def test_a_delay_that_the_model_does_not_know_is_worse(mast):
    """Delayed by a whole period, the controller that knows costs less energy than the one that does not."""
    dynamics, rest, linear = mast
    push = tc.Push("P4_1_1", [3.0, 0.0, 0.0], 0.0, 0.1)

    def left(knows):
        controller = tc.MPC(linear, horizon=10, dt=0.06, delay=0.06 if knows else 0.0)
        if not knows:
            vars(controller)["delay"] = 0.0
            controller = Late(controller, 0.06)
        run = tc.simulate(dynamics, rest, controller=controller, t_end=3.0, pushes=[push])
        states = [linear.flexible.state_of(run.nodes[k], run.velocities[k]) for k in range(len(run.time))]
        return np.square(states).sum()

    assert left(knows=True) < left(knows=False)


class Late:
    """A controller that takes time to compute and does not know it."""

    def __init__(self, controller, delay):
        self._controller, self.dt, self.delay = controller, controller.dt, delay

    def step(self, t, measurement):
        return self._controller.step(t, measurement)

    def reset(self):
        self._controller.reset()


def test_hard_limits_hold_when_commands_are_late(mast):
    dynamics, rest, linear = mast
    controller = tc.MPC(linear, horizon=5, dt=DT, delay=0.5 * DT, rate_max=0.2)
    push = tc.Push("P4_*", [15.0, 5.0, 0.0], 0.1, 0.2)
    run = tc.simulate(dynamics, rest, controller=controller, t_end=0.5, pushes=[push])
    rates = np.abs(np.diff(run.rest_lengths, axis=0)) / np.diff(run.time)[:, None]
    assert 0.19 < rates.max() <= 0.2 * (1 + 1e-9)


def test_late_commands_resume_to_the_last_bit(mast, tmp_path):
    dynamics, rest, linear = mast

    class Breaks(tc.MPC):
        def step(self, t, measurement):
            if t > 0.5:
                raise KeyboardInterrupt
            return super().step(t, measurement)

    asked = {"horizon": 3, "dt": DT, "delay": 0.3 * DT}
    push = tc.Push("P4_1_1", [3.0, 0.0, 0.0], 0.0, 0.1)
    options = {"t_end": 0.8, "pushes": [push], "chunk": 10}
    whole = tc.simulate(dynamics, rest, controller=tc.MPC(linear, **asked), store=tmp_path / "whole.nc", **options)
    with pytest.raises(KeyboardInterrupt):
        tc.simulate(dynamics, rest, controller=Breaks(linear, **asked), store=tmp_path / "cut.nc", **options)
    again = tc.resume(dynamics, tmp_path / "cut.nc", controller=tc.MPC(linear, **asked))
    assert (whole.nodes[-1] == again.nodes[-1]).all()


def test_refused_delay(mast):
    with pytest.raises(tc.SynthesisError, match=r"mpc\.delay is 0\.03 s; a time from 0 to dt = 0\.02 s"):
        tc.MPC(mast[2], horizon=3, delay=0.03)
    assert shell_scene(mpc={"delay": 0.01, "modes": "truncate"}).mpc.delay == 0.01


def static(linear):
    """Every output per unit of each input that is held."""
    return linear.D - linear.C @ np.linalg.solve(linear.A, linear.B)


def test_left_out_modes_keep_their_static_answer(mast):
    """Places and tensions at rest as the full model has them, to rounding; without it they are off."""
    linear = mast[2].flexible
    slow = below_sampling_limit(linear, 0.1, "truncate")
    assert [mode.index for mode in slow.condensed] == [m.index for m in linear.modes if m.frequency >= 5.0]
    assert len(slow.A) == len(linear.A) - 2 * len(slow.condensed) < len(linear.A)
    whole = static(linear)
    assert np.abs(static(slow) - whole).max() < 1e-12 * np.abs(whole).max()
    bare = static(tc.LinearModel(slow.dynamics, slow.equilibrium, slow.modes, slow.outputs_map))
    assert np.abs(bare - whole).max() > 1e-2 * np.abs(whole).max()


def test_mpc_leaves_out_modes_by_name(mast):
    controller = tc.MPC(mast[2], dt=0.1, horizon=5, modes="truncate")
    assert min(mode.frequency for mode in controller.linear.condensed) >= 5.0
    assert all(mode.frequency < 5.0 for mode in controller.linear.modes)
    push = tc.Push("P4_1_1", [2.0, 0.0, 0.0], 0.0, 0.2)
    run = tc.simulate(mast[0], mast[1], controller=controller, t_end=4.0, pushes=[push])
    error = run.distance_to(mast[1].nodes)
    assert error[-10:].max() < 0.5 * error.max()


def test_refused_modes(mast):
    with pytest.raises(tc.SynthesisError, match='or leave such modes out by modes = "truncate"'):
        tc.MPC(mast[2], dt=0.1)
    with pytest.raises(tc.SynthesisError, match="too long for every mode"):
        tc.MPC(mast[2], dt=2.0, modes="truncate")
