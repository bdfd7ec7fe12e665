"""What a reduced controller's difference to the full one proves, against the closed loops themselves."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla

import tensctl as tc
from tensctl.synthesis.hinf import System, hinf
from tensctl.synthesis.loop import close
from tensctl.synthesis.small_gain import difference, small_gain

PERIODS = pytest.mark.parametrize("dt", [0.02, None], ids=["sampled", "continuous"])


@pytest.fixture(scope="module")
def eyes(mast):
    return tc.sensors(mast[0].structure, lengths=1e-3)


def of_order(mast, eyes, dt, order=None):
    seen = eyes if dt else replace(eyes, noise=eyes.noise * np.sqrt(0.02))
    return tc.lqg(mast[2], seen, dt=dt, order=order)


def known_command(plant, e):
    """The loop from e, added to the command and known to the estimator, to (z, u): written out from its equations."""
    n, nu = plant.B.shape
    r, eye = e.order, np.eye(nu)
    if plant.sampled is None:
        A = np.block([[plant.A, -plant.B @ e.C], [e.seen @ plant.C, e.Phi - e.now @ e.C]])
        show = np.block([[np.eye(n), np.zeros((n, r))], [np.zeros((nu, n)), -e.C]])
        return System(A, np.vstack([plant.B, e.now]), show, np.vstack([np.zeros((n, nu)), eye]))
    s, none = plant.sampled, np.zeros
    ask = np.hstack([none((nu, n)), -e.direct, -e.C])
    moved = np.hstack([s.F, s.G0, none((n, r))]) + s.G1 @ ask
    believed = np.hstack([none((r, n)), e.before, e.Phi]) + e.now @ ask + e.seen @ plant.C @ moved
    drive = np.vstack([s.G1, eye, e.now + e.seen @ plant.C @ s.G1])
    show = np.eye(n + nu, n + nu + r)
    return System(np.vstack([moved, ask, believed]), drive, show, np.zeros((n + nu, nu)), s.dt)


def answer(e, plant, omega):
    """What the estimator makes of (z, u) at a frequency: its command, sign turned."""
    dt = None if plant.sampled is None else plant.sampled.dt
    point = 1j * omega if dt is None else np.exp(1j * omega * dt)
    if dt is None:
        drive, direct = np.hstack([e.seen @ plant.C, e.now]), np.hstack([0 * plant.B.T, 0 * e.direct])
    else:
        drive = np.hstack([point * e.seen @ plant.C, point * e.now + e.before])
        direct = np.hstack([0 * plant.B.T, e.direct])
    return e.C @ np.linalg.solve(point * np.eye(e.order) - e.Phi, drive) + direct


@PERIODS
def test_difference_is_that_of_the_two_estimators_on_the_full_loop(mast, eyes, dt):
    """Frequency by frequency, without knowing that the full estimate follows the state."""
    full, less = of_order(mast, eyes, dt), of_order(mast, eyes, dt, 36)
    plant, R = full.plant, full.cost.R
    loop, root = known_command(plant, full.estimator), np.linalg.cholesky(R).T
    found = difference(plant, full.regulator.K, R, less.estimator)
    for omega in (0.3, 2.0, 7.7, 9.2, 40.0, 120.0):
        gap = answer(full.estimator, plant, omega) - answer(less.estimator, plant, omega)
        wanted = root @ gap @ loop.at(omega) @ np.linalg.inv(root)
        assert found.at(omega) == pytest.approx(wanted, abs=1e-8 * np.abs(wanted).max())


@PERIODS
def test_bound_holds_on_the_loop(mast, eyes, dt):
    """The change of the loop's answers, enclosed itself, is not beyond the bound; and the loop is stable."""
    full, less = of_order(mast, eyes, dt), of_order(mast, eyes, dt, 40)
    said = less.small_gain
    assert said.proven
    assert less.loop.stability < 0
    unscale = np.linalg.inv(np.linalg.cholesky(full.cost.R).T)
    one, other = (known_command(full.plant, design.estimator) for design in (full, less))
    apart = System(
        sla.block_diag(one.A, other.A), np.vstack([one.B, other.B]) @ unscale, np.hstack([one.C, -other.C]),
        0 * one.D, dt,
    )  # fmt: skip
    changed = hinf(apart).low / hinf(System(one.A, one.B @ unscale, one.C, one.D @ unscale, dt)).high
    assert 1e-3 < changed <= said.change
    assert said.change == pytest.approx(said.peak.high / (1 - said.peak.high))


def test_it_says_what_it_proves_and_what_not(mast, eyes):
    design = of_order(mast, eyes, 0.02, 40)
    assert f"small gain {design.small_gain.peak.high:.3g} < 1 proves the loop stable" in str(design)
    blunt = of_order(mast, eyes, 0.02, 20)
    assert not blunt.small_gain.proven
    assert np.isinf(blunt.small_gain.change)
    assert blunt.loop.stability < 0
    assert "proves nothing" in str(blunt)
    full = of_order(mast, eyes, 0.02)
    assert full.small_gain is None
    assert "small gain" not in str(full)


@PERIODS
def test_nothing_is_left_of_it_at_full_order(mast, eyes, dt):
    assert of_order(mast, eyes, dt, 42).small_gain.peak.high < 1.01e-3


@PERIODS
def test_no_unstable_loop_is_called_stable(mast, eyes, dt):
    """Estimators spoilt at random, more and more: some proven, some lost, none both."""
    design = of_order(mast, eyes, dt)
    plant, R, e = design.plant, design.cost.R, design.estimator
    rng, seen = np.random.default_rng(2), []
    for part in np.geomspace(1e-3, 3.0, 12):
        C = e.C * (1 + part * rng.standard_normal(e.C.shape))
        spoilt = replace(e, C=C)
        said, stable = small_gain(plant, design.regulator.K, R, spoilt), close(plant, spoilt).stability < 0
        assert stable or not said.proven
        seen.append((said.proven, stable))
    assert (True, True) in seen
    assert (False, False) in seen


def test_an_estimator_that_is_not_stable_by_itself_proves_nothing(mast, eyes):
    design = of_order(mast, eyes, None)
    shaken = replace(design.estimator, Phi=design.estimator.Phi + 100 * np.eye(42))
    said = small_gain(design.plant, design.regulator.K, design.cost.R, shaken)
    assert not said.proven
    assert said.peak.low == np.inf
