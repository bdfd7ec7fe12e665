"""A batch is its members' single runs, whatever the number of workers, and one that fails stops no other."""

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc

TIMES = np.linspace(0, 0.3, 4)


@pytest.fixture(scope="module")
def shell():
    return tc.build_dynamics(shell_scene())


def drawn(dynamics, count=5, seed=0):
    rng, members = np.random.default_rng(seed), dynamics.members
    return tc.Variations(
        stiffness=members.stiffness * rng.uniform(0.5, 2.0, (count, 24)),
        rest_lengths=members.rest_lengths * rng.uniform(0.95, 1.05, (count, 24)),
        mass=members.mass * rng.uniform(0.5, 2.0, (count, 6)),
        velocities=np.cross(rng.standard_normal((count, 1, 3)), dynamics.structure.nodes),
    )


def test_members_are_single_runs(shell):
    """To rounding those of scenes with the members' numbers: only the bound on frequencies, so the step, differs."""
    variations = drawn(shell)
    batch = tc.simulate_many(shell, variations, timepts=TIMES)
    labels, rods = shell.structure.tendon_labels, shell.structure.rod_labels
    for k in range(5):
        scene = shell_scene(
            tendons={
                "stiffness": dict(zip(labels, variations.stiffness[k].tolist(), strict=True)),
                "rest_length": dict(zip(labels, variations.rest_lengths[k].tolist(), strict=True)),
            },
            rods={"mass": dict(zip(rods, variations.mass[k].tolist(), strict=True))},
        )
        start = shell.structure.nodes, variations.velocities[k]
        single = tc.simulate(tc.build_dynamics(scene), start, timepts=TIMES)
        for name in ("nodes", "velocities", "lengths", "tensions"):
            wanted = getattr(single, name)
            assert np.abs(getattr(batch, name)[k] - wanted).max() < 1e-9 * np.abs(wanted).max()
        assert batch.runs[k].switches == single.switches
    assert np.abs(batch.nodes[0] - batch.nodes[1]).max() > 0.01


def test_workers_change_nothing(shell):
    variations = drawn(shell, 8)
    one, three = (tc.simulate_many(shell, variations, timepts=TIMES, workers=n) for n in (1, 3))
    assert (one.nodes == three.nodes).all()
    assert (one.tensions == three.tensions).all()


@pytest.mark.parametrize(
    "sections", [{"tendons": {"damping": 2.0}}, {"cls": 2, "m": 2}, {"gravity": {"g": 9.8}}], ids=str
)
def test_other_structures(sections):
    """Damped, jointed and heavy ones: what is shared is shared rightly."""
    n, m = 3, sections.pop("m", 1)
    dynamics = tc.build_dynamics(shell_scene(n, m, pins=["P1_*_1"], **sections))
    rng = np.random.default_rng(1)
    stiffness = dynamics.members.stiffness * rng.uniform(0.5, 2.0, (2, dynamics.members.stiffness.size))
    damping = dynamics.damping * np.array([[1.0], [2.0]])
    batch = tc.simulate_many(dynamics, tc.Variations(stiffness=stiffness, damping=damping), timepts=TIMES)
    labels = dynamics.structure.tendon_labels
    table = dict(zip(labels, stiffness[1].tolist(), strict=True))
    sections["tendons"] = {"stiffness": table}
    if dynamics.damping.any():
        sections["tendons"]["damping"] = 4.0
    if dynamics.tied:  # a number for a merged tendon is meant for each of its parts
        parts = {label: len(label.split("+")) for label in labels}
        sections["tendons"]["stiffness"] = {label: value / parts[label] for label, value in table.items()}
    single = tc.simulate(
        tc.build_dynamics(shell_scene(n, m, pins=["P1_*_1"], **sections)), dynamics.structure.nodes, timepts=TIMES
    )
    assert np.abs(batch.nodes[1] - single.nodes).max() < 1e-8


def test_a_member_that_fails_stops_no_other(shell):
    nodes = np.stack([shell.structure.nodes] * 3)
    nodes[1] *= 1.01
    batch = tc.simulate_many(shell, tc.Variations(nodes=nodes), timepts=TIMES)
    assert "of its length too long" in batch.failures[1]
    assert batch.failures[0] == batch.failures[2] == ""
    assert batch.runs[1] is None
    assert np.isnan(batch.nodes[1]).all()
    assert np.isfinite(batch.nodes[[0, 2]]).all()
    data = batch.to_dataset()
    assert data.sizes["member"] == 3
    assert np.isnan(data.nodes.sel(member=1)).all()
    assert (data.nodes.sel(member=2).values == batch.nodes[2]).all()


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({}, "vary nothing"),
        ({"stiffness": np.ones((2, 23))}, r"stiffness of the variations have shape \(2, 23\); one row \(24,\)"),
        ({"mass": np.ones((2, 6)), "stiffness": np.ones((3, 24))}, r"numbers of members \(stiffness 3, mass 2\)"),
        ({"mass": np.zeros((1, 6))}, "mass of the variations go down to 0; finite numbers > 0"),
        ({"stiffness": np.full((1, 24), -1.0)}, "stiffness of the variations go down to -1; finite numbers > 0"),
        ({"rest_lengths": np.full((1, 24), -1.0)}, "rest_lengths of the variations go down to -1"),
        ({"damping": np.full((1, 24), -5.0)}, "damping of the variations goes down to -5; finite numbers >= 0"),
        ({"damping": np.full((1, 24), np.nan)}, "damping of the variations goes down to nan"),
        ({"forces": np.full((1, 12, 3), np.inf)}, "forces of the variations have entries"),
    ],
)
def test_refusals(shell, given, sentence):
    with pytest.raises(tc.SimulationError, match=sentence):
        tc.simulate_many(shell, tc.Variations(**given), timepts=TIMES)


@pytest.mark.parametrize("sections", [{"gravity": {"g": 9.8}, "loads": {"P4_*": [1.0, 0, 0]}}, {"cls": 2}], ids=str)
def test_other_masses(sections):
    """Weight follows the mass, loads do not; coordinates of jointed rods are square in the new mass metric."""
    nominal = tc.build_dynamics(shell_scene(3, 2, pins=["P1_*_1"], **sections))
    mass = nominal.members.mass * np.linspace(0.5, 2.0, nominal.members.mass.size)
    table = dict(zip(nominal.structure.rod_labels, mass.tolist(), strict=True))
    wanted, varied = (
        tc.build_dynamics(shell_scene(3, 2, pins=["P1_*_1"], rods={"mass": table}, **sections)),
        nominal.varied(mass=mass),
    )
    assert np.abs(varied.members.forces - wanted.members.forces).max() < 1e-14 * 100
    ours, theirs = (d.potential.at(d.structure.nodes) for d in (varied, wanted))
    eigenvalues = [
        np.linalg.eigvalsh((p.hessian.toarray() / m).T / m)
        for p, m in (
            (ours, np.sqrt(varied.potential.manifold.mass(mass))),
            (theirs, np.sqrt(wanted.potential.manifold.mass(mass))),
        )
    ]
    assert eigenvalues[0] == pytest.approx(eigenvalues[1], rel=1e-9, abs=1e-9 * np.abs(eigenvalues[1]).max())
    runs = [tc.simulate(d, d.structure.nodes, timepts=TIMES) for d in (varied, wanted)]
    assert np.abs(runs[0].nodes - runs[1].nodes).max() < 1e-8
