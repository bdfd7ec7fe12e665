"""Balanced truncation by harmonics is the dense one, with a sharper bound that holds."""

import numpy as np
import pytest
from harmonic_support import DAMPED, relative
from support import shell_scene, solved

import tensctl as tc

SHOWN = ("lengths:t5_*", "tensions:t6_*")
CASES = {
    "free (3,1), damping stated": ((3, 1), {}, {"damping": 0.02}),
    "free (4,2), two seconds": ((4, 2), {}, {"horizon": 2.0}),
    "free (4,1), damping and a time": ((4, 1), {}, {"damping": 0.05, "horizon": 1.0}),
    "pinned, damped, dragged (4,1)": ((4, 1), {"pins": ["P1_*_1"], **DAMPED}, {}),
    "free, damped, dragged (3,1)": ((3, 1), DAMPED, {}),
}


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def both(request):
    """Reduced by harmonics and densely, to the same order."""
    size, given, how = request.param
    dynamics, rest, linear = solved(shell_scene(*size, **given), outputs=SHOWN)
    found = tc.harmonic_truncate(tc.harmonic_outputs(tc.harmonics(dynamics, rest), SHOWN), 20, **how)
    return found, tc.truncate(linear, found.order, **how), np.sqrt(linear.flexible.modes[0].omega2)


def test_is_the_dense_truncation(both):
    """The same Hankel values, transfer functions and errors: balancing is unique but for the choice of coordinates."""
    found, wanted, slowest = both
    assert found.order in (19, 20)
    assert relative(found.values, wanted.truncated.values) < 1e-12
    ours, theirs = found.to_statespace(), wanted.to_statespace()
    assert ours.nstates == found.order
    assert (ours.input_labels, ours.output_labels) == (theirs.input_labels, theirs.output_labels)
    for omega in slowest * np.array([0.0, 0.7, 1.1, 3.0]):
        assert relative(ours(1j * omega), theirs(1j * omega)) < 1e-9
        assert found.error_at(omega) == pytest.approx(wanted.error_at(omega), rel=1e-8)
    assert found.impulse_error(1.5) == pytest.approx(wanted.impulse_error(1.5), rel=1e-9)


def test_bound_holds_and_is_sharper(both):
    found, wanted, slowest = both
    if wanted.bound is None:
        assert found.bound is None
        return
    worst = max(found.error_at(omega) for omega in slowest * np.geomspace(1e-2, 1e2, 200))
    assert 0 < worst <= found.bound * (1 + 1e-9)
    assert found.bound < 0.7 * wanted.bound


@pytest.fixture(scope="module")
def outputs():
    """All lengths of the free (4,1) shell."""
    dynamics, rest, _ = solved(shell_scene(4, 1))
    return tc.harmonic_outputs(tc.harmonics(dynamics, rest), ["lengths"])


class TestRefusals:
    @pytest.mark.parametrize(
        ("given", "sentence"),
        [
            ({"order": 10}, "^harmonic 0: a mode is not damped: it rings for ever"),
            ({"order": 0, "damping": 0.02}, "order is 0; a whole number from 1 to 68"),
            ({"order": 10, "damping": -1.0}, "damping is -1.0; expected a finite number > 0 .a damping ratio"),
            ({"order": 10, "horizon": 0.0}, "horizon is 0.0; expected a finite number > 0 .s"),
        ],
    )
    def test_refused(self, outputs, given, sentence):
        with pytest.raises(tc.SynthesisError, match=sentence):
            tc.harmonic_truncate(outputs, **given)

    def test_states_that_nobody_sees(self, outputs):
        fewer = tc.harmonic_outputs(outputs.model, "lengths:t4_*")
        with pytest.raises(tc.SynthesisError, match=r"order is 68, but only 58 states are both driven and seen"):
            tc.harmonic_truncate(fewer, 68, damping=0.02)
