"""Controllability by harmonics says what the whole model says, and reaches sizes that it does not."""

import numpy as np
import pytest
from support import shell_scene, solved

import tensctl as tc

CASES = {
    "free (3,1)": lambda: shell_scene(3, 1),
    "free (4,2)": lambda: shell_scene(4, 2),
    "pinned, EA (4,1)": lambda: shell_scene(4, 1, pins=["P1_*_1"], tendons={"EA": 120.0, "rest_ratio": 0.8}),
    "two kinds of inputs only": lambda: shell_scene(5, 1, actuators={"tendons": ["t5_*", "t8_*"]}),
    "one kind of inputs only": lambda: shell_scene(4, 1, actuators={"tendons": ["t4_*"]}),
    "unequal tendons": lambda: shell_scene(
        3, 2, tendons={"stiffness": {"*": 100.0, "t5_*": 1e4, "t1_*": 10.0}, "rest_ratio": 0.8}
    ),
    "every second sector acts": lambda: shell_scene(6, 1, actuators={"tendons": [f"t*_{i}_*" for i in (1, 3, 5)]}),
}


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def both(request):
    dynamics, rest, linear = solved(request.param())
    return tc.controllability(linear.flexible), tc.harmonic_controllability(tc.harmonics(dynamics, rest))


def spread(report):
    """(frequency, gain) of every mode of the whole structure, in order of frequency, then gain."""
    copies = getattr(report.modes[0], "copies", None) is not None
    pairs = [(m.frequency, m.gain) for m in report.modes for _ in range(m.copies if copies else 1)]
    return np.array(sorted(pairs, key=lambda pair: (round(pair[0], 6), pair[1])))


def test_gains_are_those_of_the_whole_model(both):
    dense, harmonic = both
    wanted, found = spread(dense), spread(harmonic)
    assert found.shape == wanted.shape
    np.testing.assert_allclose(found[:, 0], wanted[:, 0], rtol=1e-7)
    np.testing.assert_allclose(found[:, 1], wanted[:, 1], atol=1e-7 * wanted[:, 1].max())


def test_answers_are_those_of_the_whole_model(both):
    dense, harmonic = both
    assert harmonic.count == len(dense.modes)
    assert harmonic.driven == len(dense.controllable_modes)
    assert all(mode.reason for mode in harmonic.modes if mode.verdict != "yes")


def test_shares_are_parts_of_one(both):
    _, harmonic = both
    for mode in harmonic.modes:
        assert sum(mode.shares) <= 1 + 1e-12
        assert (mode.verdict == "yes") == (len(mode.tendons) > 0)


def test_says_what_is_not_driven_and_why():
    """One kind of tendon on (4,1) pulls every second sector against the others in harmonic 2: five modes cancel."""
    dynamics, rest, _ = solved(shell_scene(4, 1, actuators={"tendons": ["t4_*"]}))
    report = tc.harmonic_controllability(tc.harmonics(dynamics, rest))
    missed = [mode for mode in report.modes if mode.verdict == "no"]
    assert (report.driven, report.count) == (29, 34)
    assert {mode.harmonic for mode in missed} == {2}
    assert all(mode.gain < 1e-12 and "cancel" in mode.reason for mode in missed)
    assert report.weakest in missed
    assert "29 of 34 modes are controllable" in str(report)
    assert "not driven: harmonic 2" in str(report)


def test_reaches_thousands_of_states():
    """The free (20,10) shell, 3988 states: every flexible mode is driven."""
    scene = shell_scene(20, 10, overlap=0.15)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    report = tc.harmonic_controllability(tc.harmonics(dynamics, rest))
    assert report.count == 1994
    assert report.driven == report.count
