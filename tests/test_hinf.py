"""H-infinity norms: known peaks, narrow ones, dense sweeps, and the margins that follow."""

import control
import mpmath
import numpy as np
import pytest
import scipy.linalg as sla

import tensctl as tc
from tensctl.synthesis.hinf import System, hinf
from tensctl.synthesis.margins import Sensitivity


def oscillators(zeta, rng):
    """Five modes, two of them equal and one close to them."""
    w = np.array([1, 1, 1.0001, 30.0, 400.0])
    A = np.block([[np.zeros((5, 5)), np.diag(w)], [-np.diag(w), -np.diag(2 * zeta * w)]])
    return A, rng.standard_normal((10, 2)), rng.standard_normal((2, 10))


@pytest.mark.parametrize("zeta", ["0.3", "1e-3", "1e-6"])
def test_one_oscillator_in_mpmath(zeta):
    """|1/(s^2 + 2 zeta s + 1)| peaks at 1/(2 zeta sqrt(1 - zeta^2))."""
    z = mpmath.mpf(zeta)
    exact = float(1 / (2 * z * mpmath.sqrt(1 - z**2)))
    found = hinf(System(np.array([[0.0, 1], [-1, -2 * float(z)]]), np.eye(2)[:, 1:], np.eye(2)[:1], np.zeros((1, 1))))
    assert found.low <= exact * (1 + 1e-9)
    assert exact <= found.high * (1 + 1e-9)
    assert found.high < found.low * (1 + 1e-5)


@pytest.mark.parametrize("dt", [None, 0.001, 0.1])
@pytest.mark.parametrize("zeta", [1e-2, 1e-5])
def test_no_sweep_finds_more(zeta, dt, rng):
    A, B, C = oscillators(zeta, rng)
    system = System(A if dt is None else sla.expm(A * dt), B, C, 0.1 * np.eye(2), dt)
    found = hinf(system)
    offsets = np.concatenate([-np.geomspace(1e-9, 0.5, 200), np.geomspace(1e-9, 0.5, 200)])
    sweep = np.concatenate([w * (1 + offsets) for w in (1.0, 1.0001, 30.0)])
    largest = max(system.gain(w) for w in sweep if dt is None or w * dt < np.pi)
    assert largest <= found.high
    assert found.low == pytest.approx(system.gain(found.omega), rel=1e-12)
    assert found.high < found.low * (1 + 1e-4)


@pytest.mark.parametrize("dt", [None, 0.1])
def test_a_complex_system_is_the_real_one_of_twice_the_size(dt, rng):
    """M -> [Re M, -Im M; Im M, Re M] has the gains of both sides, w and -w; turned round, the peak is on the other."""
    A, B, C = oscillators(1e-3, rng)
    rates = 1j * np.array([1.0, 3.0, -7.0, 12.0, 25.0]) - 0.01
    A = np.diag(rates if dt is None else np.exp(rates * dt))
    B, C = B[:5] + 1j * B[5:], C[:, :5] - 1j * C[:, 5:]
    D = 0.1 * np.eye(2)
    found, turned = hinf(System(A, B, C, D, dt)), hinf(System(A.conj(), B.conj(), C.conj(), D, dt))
    pair = [np.block([[M.real, -M.imag], [M.imag, M.real]]) for M in (A, B, C, D + 0j)]
    wanted = hinf(System(*pair, dt))
    assert max(found.low, wanted.low) <= min(found.high, wanted.high)
    assert found.high < found.low * (1 + 1e-4)
    assert turned.low == pytest.approx(found.low, rel=1e-6)
    assert turned.omega == pytest.approx(-found.omega, rel=1e-4)
    assert abs(found.omega) == pytest.approx(wanted.omega, rel=1e-4)


def test_a_bad_start_is_left():
    """Crossings of the level, not the start, decide: a peak of width 1e-5 far from it is found."""
    A = np.array([[0.0, 1], [-1, -2e-5]])
    found = hinf(System(A, np.eye(2)[:, 1:], np.eye(2)[:1], np.zeros((1, 1))), start=0.1)
    assert found.low == pytest.approx(5e4, rel=1e-5)


def test_margin_agrees_with_python_control():
    plant = control.ss(control.tf([2.0], [1, 3, 3, 1]))
    low, high = Sensitivity(plant.A - plant.B @ plant.C, plant.B, -plant.C, None).enclosure()
    swept = float(np.asarray(control.disk_margins(plant, np.geomspace(1e-2, 1e2, 20000))[0]).ravel()[0])
    assert low * (1 - 1e-6) <= swept <= high * (1 + 1e-4)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_encloses_the_margin_of_lqg(mast, dt):
    design = tc.lqg(mast[2], tc.sensors(mast[0].structure, lengths=1e-3), dt=dt)
    low, high = design.loop.sensitivity.enclosure()
    sweep = [np.linalg.norm(design.sensitivity.at(w) - 0.5 * np.eye(21), 2) for w in np.geomspace(0.1, 150, 600)]
    assert low <= 1 / max(sweep) <= high * (1 + 1e-3)
    assert high == pytest.approx(low, rel=1e-4)


def test_lqr_keeps_its_guarantee(mast):
    """Return difference: R^1/2 S R^-1/2 is at most 1 at every frequency."""
    design = tc.lqr(mast[2])
    root = np.sqrt(np.diag(design.R))
    for w in np.geomspace(1e-1, 1e4, 200):
        assert np.linalg.norm(root[:, None] * design.sensitivity.at(w) / root, 2) <= 1 + 1e-9


@pytest.mark.parametrize("dt", [None, 0.1])
def test_a_peak_at_rest_is_found(dt):
    """|1/(s^2 + 1.8 s + 1)| falls from 1 at rest, where no pole stands: each level is crossed once."""
    A = np.array([[0.0, 1], [-1, -1.8]])
    B = np.eye(2)[:, 1:]
    if dt is not None:
        A, B = sla.expm(dt * A), np.linalg.solve(A, (sla.expm(dt * A) - np.eye(2)) @ B)
    found = hinf(System(A, B, np.eye(2)[:1], np.zeros((1, 1)), dt))
    assert found.low == pytest.approx(1.0, rel=1e-9)
    assert found.high < 1 + 1e-5
