"""Predictive controllers refuse a path that is faster than motors are, and tell a duration that does."""

import re

import numpy as np
import pytest
from support import shell_scene, solved

import tensctl as tc

LIMITS = {"force_max": 20.0, "power_max": 0.6}
SLOW = LIMITS["power_max"] / LIMITS["force_max"]
MAKE = {
    "MPC": lambda models, path, **given: tc.MPC(models[2], horizon=2, path=path, **given),
    "OutputMPC": lambda models, path, **given: tc.OutputMPC(
        models[2], tc.sensors(models[0].structure, lengths=1e-3), horizon=2, path=path, **given
    ),
    "NonlinearMPC": lambda models, path, **given: tc.NonlinearMPC(models[0], path, horizon=2, **given),
}


def mast(**actuators):
    return shell_scene(pins=["P1_*_1"], actuators=actuators)


def planned(duration, **actuators):
    return tc.plan_shape(mast(**actuators), {"height_scale": 1.05, "duration": duration})


def fastest(path):
    """Largest speed of each input on a path, m/s, by differences."""
    t = np.linspace(0, path.duration, 4001)
    return np.abs(np.diff(path.inputs_at(t), axis=0)).max(axis=0) / (t[1] - t[0])


@pytest.fixture(scope="module")
def quick():
    return planned(1.0, **LIMITS)


@pytest.fixture(scope="module")
def models():
    return solved(mast(**LIMITS))


def refused(make, *given, **limits):
    with pytest.raises(tc.SynthesisError, match="would stay behind") as told:
        make(*given, **limits)
    return str(told.value)


def test_beyond_power(models, quick):
    (sentence,) = {refused(make, models, quick) for make in MAKE.values()}
    told = re.fullmatch(
        r"target\.duration = 1 s asks (\S+) m/s of actuator (\S+), whose limit is 0\.03 m/s \(actuators\.power_max = "
        r"0\.6 W over its 20 N with every tendon at force_max\), so the controller would stay behind; allow (\S+) s or "
        r"more, or raise that limit\.",
        sentence,
    )
    assert told is not None
    speeds, labels = fastest(quick), models[0].members.gearing.labels
    assert float(told[1]) == pytest.approx(speeds.max(), rel=5e-3)
    assert told[2] == labels[speeds.argmax()]
    enough, short = (planned(share * float(told[3]), **LIMITS) for share in (1.0, 0.98))
    assert fastest(enough).max() == pytest.approx(SLOW, rel=0.02)
    assert MAKE["MPC"](models, enough).reference is enough
    refused(MAKE["MPC"], models, short)


def test_a_smaller_rate_max_is_the_callers_choice(quick):
    models = solved(mast(force_max=20.0))
    for make in MAKE.values():
        make(models, quick, rate_max=0.5 * quick.fastest)
