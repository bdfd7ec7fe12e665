"""Gramians, energies, static reach, observability, dampers, drag and motors by harmonics: those of the whole model."""

import numpy as np
import pytest
from harmonic_support import DAMPED, relative
from support import shell_scene, solved

import tensctl as tc
from tensctl.analysis import (
    HarmonicReach,
    Reach,
    controllability_gramian,
    harmonic_controllability_gramian,
    harmonic_observability,
    harmonic_observability_gramian,
    observability_gramian,
)
from tensctl.linear import harmonic_outputs

EVERY = ("nodes", "lengths", "tensions")
OWN = {f"g{i}": {f"t5_{i}_1": 1.0, f"t6_{i % 5 + 1}_1": 0.5} for i in range(1, 6)}
CASES = {
    "free (3,1)": lambda: shell_scene(3, 1),
    "free (4,2)": lambda: shell_scene(4, 2),
    "free (6,3)": lambda: shell_scene(6, 3),
    "pinned, damped, dragged (4,1)": lambda: shell_scene(4, 1, pins=["P1_*_1"], **DAMPED),
    "free, damped, dragged (3,1)": lambda: shell_scene(3, 1, **DAMPED),
    "a motor for a ring (4,1)": lambda: shell_scene(4, 1, actuators={"gangs": {"top": {"t6_*": 1.0}}}),
    "motors over two sectors (5,1)": lambda: shell_scene(5, 1, pins=["P1_*_1"], actuators={"gangs": OWN}),
}


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def both(request):
    dynamics, rest, linear = solved(request.param(), EVERY)
    return linear, tc.harmonics(dynamics, rest)


def spread(report):
    """(frequency, gain) of every flexible mode, in order of frequency, then gain."""
    own = [mode for mode in report.modes if mode.kind != "rigid-body"]
    pairs = [(m.frequency, m.gain) for m in own for _ in range(getattr(m, "copies", 1))]
    return np.array(sorted(pairs, key=lambda pair: (round(pair[0], 6), pair[1])))


def test_the_change_of_basis_carries_A_and_B(both):
    linear, model = both
    flexible, bases, inputs = linear.flexible, model.changed_basis(linear), model.map.waves(np.eye(model.nu))
    parts = list(zip(model.blocks, bases, inputs, strict=True))
    assert relative(sum(b.copies * (T.conj().T @ b.A @ T).real for b, T, _ in parts), flexible.A) < 1e-12
    assert relative(sum(b.copies * (T.conj().T @ b.B @ W).real for b, T, W in parts), flexible.B) < 1e-12
    u = np.random.default_rng(0).standard_normal((model.nu, 2))
    assert np.abs(model.map.shortening(model.map.waves(u)) - u).max() < 1e-14


def test_outputs_are_those_of_the_whole_model(both):
    linear, model = both
    outputs, flexible = harmonic_outputs(model, EVERY), linear.flexible
    assert outputs.labels == linear.outputs
    waves, bases = outputs.waves(np.eye(len(outputs.labels))), model.changed_basis(linear)
    parts = list(zip(model.blocks, bases, waves, model.map.waves(np.eye(model.nu)), strict=True))
    assert relative(sum(b.copies * (Y.conj().T @ outputs.C(b) @ T).real for b, T, Y, _ in parts), flexible.C) < 1e-12
    assert relative(sum(b.copies * (Y.conj().T @ outputs.D(b) @ U).real for b, _, Y, U in parts), flexible.D) < 1e-12
    y = np.random.default_rng(1).standard_normal(len(outputs.labels))
    assert np.abs(outputs.values(outputs.waves(y)) - y).max() < 1e-14


@pytest.mark.parametrize("T", [0.05, 2.0])
def test_gramians(both, T):
    linear, model = both
    outputs = harmonic_outputs(model, EVERY)
    reach, sight = harmonic_controllability_gramian(model, T), harmonic_observability_gramian(outputs, T)
    wanted = controllability_gramian(linear, T)
    assert relative(reach.dense(linear), wanted.matrix) < 1e-11
    assert relative(sight.dense(linear), observability_gramian(linear, T).matrix) < 1e-11
    for gramian in (reach, sight):
        gramian.verify(1e-12)
    moved = np.abs(linear.flexible.C).max(axis=1) > 1e-9
    dense = wanted.energies(linear.flexible.C)
    assert relative(1 / reach.outputs(outputs)[moved], 1 / dense[moved]) < 1e-10
    directions = np.random.default_rng(2).standard_normal((3, len(outputs.labels)))
    assert relative(reach.energies(outputs, directions), wanted.energies(directions @ linear.flexible.C)) < 1e-10


def test_a_state_is_seen_and_reached_as_in_the_whole_model(both):
    linear, model = both
    x = np.random.default_rng(3).standard_normal(model.nx)
    states = [T @ x for T in model.changed_basis(linear)]
    sight = harmonic_observability_gramian(harmonic_outputs(model, EVERY), 1.0)
    wanted = np.linalg.norm(observability_gramian(linear, 1.0).factor.T @ x) ** 2
    assert sight.shown(states) == pytest.approx(wanted, rel=1e-10)
    reach, dense = harmonic_controllability_gramian(model, 2.0), controllability_gramian(linear, 2.0)
    if dense.spread < 1e8:
        assert reach.spread == pytest.approx(dense.spread, rel=1e-6)
        assert reach.state_energy(states) == pytest.approx(dense.state_energies(x[None])[0], rel=1e-6)


def test_static_reach(both):
    linear, model = both
    found, wanted = HarmonicReach(model), Reach(linear)
    assert (found.rank, found.undecided, found.freedoms, found.inputs) == (
        wanted.rank, wanted.undecided, wanted.freedoms, wanted.inputs,
    )  # fmt: skip
    own = [np.tile(np.linalg.svd(b.drive, compute_uv=False), b.copies) for b in model.blocks]
    dense = np.sort(np.linalg.svd(wanted.drive, compute_uv=False))[-wanted.rank :]
    assert np.abs(np.sort(np.concatenate(own))[-wanted.rank :] - dense).max() < 1e-10 * dense.max()
    found.verify()
    assert f"rank {wanted.rank} of {wanted.freedoms}" in str(found)


@pytest.mark.parametrize("question", ["controllable", "lengths", "tensions", "nodes"])
def test_gains_are_those_of_the_whole_model(both, question):
    linear, model = both
    if question == "controllable":
        dense, found = tc.controllability(linear.flexible), tc.harmonic_controllability(model)
    else:
        dense = tc.observability(linear.flexible.showing([question]))
        found = harmonic_observability(harmonic_outputs(model, [question]))
    wanted, own = spread(dense), spread(found)
    assert own.shape == wanted.shape
    np.testing.assert_allclose(own[:, 0], wanted[:, 0], rtol=1e-7)
    np.testing.assert_allclose(own[:, 1], wanted[:, 1], atol=1e-6 * wanted[:, 1].max())
    assert found.driven == sum(mode.verdict == "yes" for mode in dense.modes)


def test_an_endless_horizon_of_a_damped_structure():
    dynamics, rest, linear = solved(shell_scene(4, 1, pins=["P1_*_1"], **DAMPED))
    model = tc.harmonics(dynamics, rest)
    found = harmonic_controllability_gramian(model, np.inf)
    assert relative(found.dense(linear), controllability_gramian(linear, np.inf).matrix) < 1e-11
    found.verify(1e-12)


class TestRefusals:
    def test_outputs_without_their_images(self):
        dynamics, rest, _ = solved(shell_scene(3, 1))
        model = tc.harmonics(dynamics, rest)
        for asked in ("lengths:t5_1_1", "tensions:t1_2_1", "nodes:P4_1_1"):
            with pytest.raises(tc.LinearizationError, match="leave out images"):
                harmonic_outputs(model, [asked])
        with pytest.raises(tc.LinearizationError, match='output "force" is unknown'):
            harmonic_outputs(model, ["force"])

    def test_weights_that_break_the_symmetry(self):
        dynamics, rest, _ = solved(shell_scene(3, 1))
        model = tc.harmonics(dynamics, rest)
        weights = np.full(model.nu, 2.0)
        weights[4] = 2.1
        with pytest.raises(tc.LinearizationError, match="differ between images"):
            harmonic_controllability_gramian(model, 1.0, weights=weights)
        with pytest.raises(tc.LinearizationError, match="an infinite horizon needs damping"):
            harmonic_controllability_gramian(model, np.inf)

    def test_a_motor_without_images(self):
        dynamics, rest, _ = solved(shell_scene(4, 1, actuators={"gangs": {"tilt": {"t5_1_1": 1.0, "t5_2_1": -0.7}}}))
        with pytest.raises(tc.LinearizationError, match="motors are not carried onto motors"):
            tc.harmonics(dynamics, rest)
