"""Harmonics are the dense linear model in another basis: spectra, matrices, transfer functions, states, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from harmonic_support import DAMPED, relative
from support import network_scene, random_motion, replaced, shell_scene, solved

import tensctl as tc
from tensctl.linear import harmonics
from tensctl.linear.harmonic_map import is_real

EVERY = ("nodes", "lengths", "tensions")
CASES = {
    "free (3,1)": lambda: shell_scene(3, 1),
    "free (4,2)": lambda: shell_scene(4, 2),
    "pinned, damped, dragged, EA (4,1)": lambda: shell_scene(4, 1, pins=["P1_*_1"], **DAMPED),
    "two kinds of inputs only": lambda: shell_scene(5, 1, actuators={"tendons": ["t5_*", "t8_*"]}),
    "unequal kinds of tendons": lambda: shell_scene(
        3, 2, tendons={"stiffness": {"*": 100.0, "t5_*": 1e4, "t1_*": 10.0}, "rest_ratio": 0.8}
    ),
    "every second sector acts": lambda: shell_scene(6, 1, actuators={"tendons": [f"t*_{i}_*" for i in (1, 3, 5)]}),
}


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def both(request):
    """The dense flexible model and the harmonics about the same rest."""
    dynamics, rest, linear = solved(request.param(), EVERY)
    return linear.flexible, harmonics(dynamics, rest)


def test_spectrum(both):
    linear, model = both
    wanted = np.sort([mode.omega2 for mode in linear.modes])
    assert np.abs(model.omega2 - wanted).max() < 1e-12 * wanted.max()
    assert (model.nx, model.nu) == linear.B.shape
    model.verify(1e-12)


def test_harmonics_besides_the_first_and_the_middle_one_come_twice(both):
    _, model = both
    counts = [block.copies for block in model.blocks]
    assert sum(counts) == model.order
    assert [count == 1 for count in counts] == [is_real(k, model.order) for k in range(len(counts))]
    assert all(np.isrealobj(block.shapes) == (block.copies == 1) for block in model.blocks)


def test_the_change_of_basis_is_unitary_and_carries_A_and_B(both):
    linear, model = both
    bases, inputs = model.changed_basis(linear), model.map.waves(np.eye(model.nu))
    parts = list(zip(model.blocks, bases, inputs, strict=True))
    unit = sum(b.copies * (T.conj().T @ T).real for b, T, _ in parts)
    assert np.abs(unit - np.eye(model.nx)).max() < 1e-11
    assert relative(sum(b.copies * (T.conj().T @ b.A @ T).real for b, T, _ in parts), linear.A) < 1e-12
    assert relative(sum(b.copies * (T.conj().T @ b.B @ W).real for b, T, W in parts), linear.B) < 1e-12


def outputs_of_sectors(model, kind, y):
    """Outputs (ny, columns) of the dense model by sector, nodes turned back, (n, y, columns)."""
    symmetry, structure = model.map.point.sector.symmetry, model.dynamics.structure
    if kind != "nodes":
        return y[symmetry.tendons]
    full = np.zeros((structure.nodes.size, y.shape[1]), complex)
    full[structure.free.ravel()] = y
    by_sector = full.reshape(*structure.nodes.shape, -1)[symmetry.nodes]
    turned = np.einsum("sji,sajc->saic", symmetry.turns, by_sector)
    return turned.reshape(model.order, -1, y.shape[1])[:, structure.free[symmetry.nodes[0]].ravel()]


@pytest.mark.parametrize("kind", EVERY)
def test_transfer_functions(both, kind):
    """C (sI - A)^-1 B + D, whatever the basis, at a complex frequency."""
    linear, model = both
    starts = np.cumsum([0, *(sum(label[0] == k for label in linear.outputs) for k in "PlT")])
    rows = slice(*starts[[EVERY.index(kind), EVERY.index(kind) + 1]])
    s = 0.3 + 5.0j
    dense = linear.C[rows] @ np.linalg.solve(s * np.eye(model.nx) - linear.A, linear.B) + linear.D[rows]
    own = outputs_of_sectors(model, kind, dense)
    # The dense response is no real quantity, so the transform is written out here, for each of the n harmonics.
    n, sectors = model.order, np.arange(model.order)
    for block in model.blocks:
        waves = np.exp(-2j * np.pi * block.k * sectors / n) / np.sqrt(n)
        found = block.C(kind) @ np.linalg.solve(s * np.eye(block.nx) - block.A, block.B) + block.D(kind)
        wanted = np.einsum("s,syu->yu", waves, own)[:, model.map.inputs]
        wanted = np.einsum("ysp,s->yp", wanted, waves.conj())
        assert np.abs(found - wanted).max() < 1e-10 * np.abs(dense).max()


def test_states_of_the_moving_structure(both, rng):
    linear, model = both
    nodes, velocities = random_motion(model.equilibrium.potential, rng)
    wanted = linear.state_of(nodes, velocities)
    found = model.state_of(nodes, velocities)
    for x, T in zip(found, model.changed_basis(linear), strict=True):
        assert np.abs(x - T @ wanted).max() < 1e-11 * np.linalg.norm(wanted)


def test_lengths_of_vectors_are_kept(both, rng):
    """Parseval, of inputs and of tangent coordinates in the mass metric."""
    linear, model = both
    u = rng.standard_normal(model.nu)
    waves = model.map.waves(u)
    assert sum(b.copies * np.linalg.norm(w) ** 2 for b, w in zip(model.blocks, waves, strict=True)) == pytest.approx(
        u @ u, rel=1e-13
    )
    assert np.abs(model.map.shortening(waves) - u).max() < 1e-14
    x = linear.shapes @ rng.standard_normal(len(linear.modes))
    mass = model.equilibrium.potential.manifold.mass(model.dynamics.members.mass)
    eta = model.modal(x[:, None])
    assert sum(b.copies * np.linalg.norm(e) ** 2 for b, e in zip(model.blocks, eta, strict=True)) == pytest.approx(
        x @ (mass * x), rel=1e-12
    )


def test_a_turn_by_one_sector_delays_every_harmonic(both, rng):
    """u of sector s seen in sector s + 1 is exp(-2 pi i k/n) u_k, and the tendons' response moves along with it."""
    _, model = both
    u = rng.standard_normal(model.nu)
    turned = np.empty_like(u)
    turned[np.roll(model.map.inputs, -1, axis=0)] = u[model.map.inputs]
    for k, (before, after) in enumerate(zip(model.map.waves(u), model.map.waves(turned), strict=True)):
        assert np.abs(after - np.exp(-2j * np.pi * k / model.order) * before).max() < 1e-13


def test_output_weights_are_those_of_the_dense_outputs(both):
    linear, model = both
    starts = np.cumsum([0, *(sum(label[0] == k for label in linear.outputs) for k in "PlT")])
    weights = {"nodes": 2.0, "lengths": 3.0, "tensions": 0.1}
    rows = np.repeat([2.0, 3.0, 0.1], np.diff(starts))
    wanted = linear.C.T @ (rows[:, None] * linear.C)
    parts = zip(model.blocks, model.weight_of(weights), model.changed_basis(linear), strict=True)
    assert relative(sum(b.copies * (T.conj().T @ Q @ T).real for b, Q, T in parts), wanted) < 1e-11


def test_circulant_blocks(both, rng):
    """A block-circulant matrix, written out, is its blocks in the transform of the inputs."""
    _, model = both
    n, p = model.map.inputs.shape
    row = rng.standard_normal((n, p, p))
    full = np.empty((n * p, n * p))
    for s in range(n):
        for t in range(n):
            full[np.ix_(model.map.inputs[s], model.map.inputs[t])] = row[(t - s) % n]
    found = sum(
        b.copies * (W.conj().T @ M @ W).real
        for b, M, W in zip(model.blocks, model.circulant(row), model.map.waves(np.eye(n * p)), strict=True)
    )
    assert relative(found, full) < 1e-13


def test_unstable_modes_have_the_dense_model_s_scale():
    """About the cylinder, which is no rest here, some modes have no frequency to be scaled with."""
    tendons = {"stiffness": {"*": 1.0, "t5_*": 100.0}, "rest_ratio": 0.5}
    scene = shell_scene(3, 1, pins=["P1_*_1"], tendons=tendons)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    cylinder = replaced(rest, nodes=dynamics.structure.nodes)
    linear, model = tc.linearize(dynamics, cylinder), harmonics(dynamics, cylinder)
    assert sum(mode.kind == "unstable" for mode in linear.modes) >= 6
    A = sum(
        b.copies * (T.conj().T @ b.A @ T).real for b, T in zip(model.blocks, model.changed_basis(linear), strict=True)
    )
    assert relative(A, linear.flexible.A) < 1e-11


def ring_of_cables():
    """A prism of three rods whose rings are a cable each."""
    corners = [(np.cos(a), np.sin(a)) for a in 2 * np.pi / 3 * np.arange(3)]
    tops = [(np.cos(a), np.sin(a)) for a in 2 * np.pi / 3 * np.arange(3) + 5 * np.pi / 6]
    nodes = {f"a{k}": [x, y, 0.0] for k, (x, y) in enumerate(corners)}
    nodes |= {f"b{k}": [x, y, 1.0] for k, (x, y) in enumerate(tops)}
    rings = {side: [f"{side}0", f"{side}1", f"{side}2", f"{side}0"] for side in "ab"}
    sides = {f"s{k}": [f"a{k}", f"b{(k + 2) % 3}"] for k in range(3)}
    rods = {f"r{k}": [f"a{k}", f"b{k}"] for k in range(3)}
    return network_scene(nodes, rods, rings | sides)


class TestRefusals:
    def test_a_load_on_one_node(self):
        scene = shell_scene(3, 1, pins=["P1_*_1"], loads={"P4_1_1": [0.1, 0.0, 0.0]})
        with pytest.raises(tc.LinearizationError, match=r"no cyclic symmetry: no turn by 2 pi/n, n >= 3"):
            harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))

    @pytest.mark.parametrize(
        ("scene", "what"),
        [
            (shell_scene(4, 2, cls=2, tendons={"rest_ratio": 0.85}), "nodes that rods share"),
            (shell_scene(3, 1, pins={"P1_*_1": "z"}), "guided nodes"),
            (shell_scene(3, 2, cls=2, pins={"P1_*_1": "z"}), "nodes that rods share and guided nodes"),
            (ring_of_cables(), "cables through several nodes"),
        ],
    )
    def test_symmetric_but_not_split(self, scene, what):
        with pytest.raises(tc.LinearizationError, match=f"^the scene has {what}, which harmonics do not split"):
            harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))

    def test_one_stiffer_tendon(self):
        scene = shell_scene(3, 1, tendons={"stiffness": {"*": 100.0, "t5_1_1": 101.0}, "rest_ratio": 0.8})
        with pytest.raises(tc.LinearizationError, match=r"no cyclic symmetry.*use tc\.linearize"):
            harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))

    def test_one_actuator(self):
        scene = shell_scene(3, 1, actuators={"tendons": ["t5_1_1"]})
        with pytest.raises(tc.LinearizationError, match="its acting tendons differ from sector to sector"):
            harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))

    def test_one_damper(self):
        scene = shell_scene(3, 1, tendons={"stiffness": 100.0, "rest_ratio": 0.8, "damping": {"*": 1.0, "t5_1_1": 1.5}})
        with pytest.raises(tc.LinearizationError, match=r"dampers differ by 3e-01 of the largest"):
            harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))

    def test_other_materials(self):
        scene = shell_scene(3, 1)
        other = tc.find_equilibrium(shell_scene(3, 1, tendons={"stiffness": 120.0, "rest_ratio": 0.8}))
        with pytest.raises(tc.LinearizationError, match="other materials"):
            harmonics(tc.build_dynamics(scene), other)

    def test_a_dense_model_of_another_rest(self):
        dynamics, rest, linear = solved(shell_scene(3, 1))
        other = tc.find_equilibrium(shell_scene(3, 1), inputs=np.full(24, 0.01))
        with pytest.raises(tc.LinearizationError, match="another equilibrium"):
            harmonics(dynamics, other).changed_basis(linear)
        assert harmonics(dynamics, rest).mismatch < 1e-14

    def test_unknown_outputs(self):
        dynamics, rest, _ = solved(shell_scene(3, 1))
        with pytest.raises(tc.LinearizationError, match='output "force" is unknown'):
            harmonics(dynamics, rest).weight_of({"force": 1.0})


@pytest.mark.parametrize("part", [1e-6, 1e-3])
def test_a_mismatch_is_let_pass_when_asked_for_and_reported(part):
    broken = {"*": 100.0, "t5_1_1": 100.0 * (1 + part)}
    scene = shell_scene(3, 1, tendons={"stiffness": broken, "rest_ratio": 0.8})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    model = harmonics(dynamics, rest, tol=10 * part)
    assert 0.5 * part < model.mismatch < 2 * part
    wanted = np.sort([mode.omega2 for mode in tc.linearize(dynamics, rest).flexible.modes])
    assert 1e-3 * part < np.abs(model.omega2 / wanted - 1).max() < 10 * part


def test_verify_tells_wrong_modes(free):
    model = harmonics(free[0], free[1])
    wrong = replace(model.blocks[1], omega2=model.blocks[1].omega2 * (1 + 1e-6))
    with pytest.raises(tc.LinearizationError, match="the modes of harmonic 1 miss the Hessian"):
        replace(model, blocks=(model.blocks[0], wrong)).verify()
