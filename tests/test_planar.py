"""Structures in a plane: the third dimension is left out, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest
from support import order_of, random_motion, solved

import tensctl as tc
from tensctl.elements import JointedManifold, Potential, RodManifold
from tensctl.interop.mjcf import mjcf
from tensctl.linear import best_fit
from tensctl.statics.prestress import self_stress
from tensctl.statics.starts import same_rest

NODES = {"a": [0, 0], "b": [1.1, 1], "c": [0, 1], "d": [1, 0]}
RODS = {"r": ["a", "b"], "s": ["c", "d"]}
TENDONS = {"ac": ["a", "c"], "cb": ["c", "b"], "bd": ["b", "d"], "da": ["d", "a"]}

# Two rods in a joint over a rod that stands on the ground, tied to two nodes on it.
ARM = {
    "nodes": {"o": [0, 0], "p": [0, 1], "q": [0.9, 1.4], "l": [-1, 0], "g": [1.2, 0]},
    "rods": {"lower": ["o", "p"], "upper": ["p", "q"]},
    "tendons": {"lp": ["l", "p"], "gp": ["g", "p"], "lq": ["l", "q"], "gq": ["g", "q"]},
}

CASES = {
    "free": {"nodes": NODES, "rods": RODS, "tendons": TENDONS},
    "pinned": {"nodes": NODES, "rods": RODS, "tendons": TENDONS, "pins": ["a"]},
    "guided": {"nodes": NODES, "rods": RODS, "tendons": TENDONS, "pins": {"a": "xy", "d": "y"}},
    "rolling": {"nodes": NODES, "rods": RODS, "tendons": TENDONS, "pins": {"a": "y", "d": "y"}},
    "jointed": {**ARM, "pins": ["o", "l", "g"]},
    "jointed and guided": {**ARM, "pins": {"o": "x", "l": "xy", "g": "xy", "p": "x"}},
}
cases = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
LOADS = {"b": [0.3, -0.2, 0], "q": [1.0, -0.2, 0]}


def in_plane(case, **sections):
    return tc.Scene(structure=tc.planar(**case), **sections)


def in_space(case, **sections):
    """The same structure in space, with z of every node guided."""
    flat = tc.planar(**case)
    guides = flat.guides | np.outer(~flat.pinned, [False, False, True])
    return tc.Scene(structure=replace(flat, planar=False, guides=guides), **sections)


def loaded(case):
    """Loads on what the ground can hold."""
    return {"loads": {k: w for k, w in LOADS.items() if k in case["nodes"]}} if "o" in case["nodes"] else {}


@cases
def test_coordinates_are_counted(case):
    """2 + 1 a free rod, 1 a rod held at one end, less 2 a joint and 1 a guide."""
    structure = tc.planar(**case)
    manifold = Potential.of(in_plane(case)).manifold
    assert isinstance(manifold, JointedManifold if structure.jointed or structure.has_guides else RodManifold)
    ends = np.bincount(structure.rods.ravel(), minlength=len(structure.nodes))
    rows = 2 * (ends - 1)[(ends > 0)].sum() + structure.held[ends > 0][:, :2].sum()
    assert manifold.size == 3 * len(structure.rods) - rows
    if isinstance(manifold, RodManifold):
        assert set(manifold.mass(np.ones(2))) == {1.0, 1 / 3} - ({1.0} if structure.pinned.all() else set())


@cases
def test_it_is_the_model_in_space_with_z_held(case):
    """Energy, tensions, rod forces and frequencies are those of the structure in space whose nodes are guided in z."""
    flat, deep = (tc.find_equilibrium(make(case, **loaded(case))) for make in (in_plane, in_space))
    flat.verify()
    assert flat.potential.manifold.size == deep.potential.manifold.size
    assert same_rest(flat, deep)
    assert flat.stable == deep.stable
    assert flat.energy == pytest.approx(deep.energy, rel=1e-11)
    assert flat.tensions == pytest.approx(deep.tensions, rel=1e-9)
    assert flat.rod_forces == pytest.approx(deep.rod_forces, rel=1e-8)
    assert flat.omega2 == pytest.approx(deep.omega2, rel=1e-8, abs=1e-9 * deep.omega2[-1])
    assert flat.spectrum.rigid.names == deep.spectrum.rigid.names


@cases
def test_gradient_and_hessian(case):
    potential = Potential.of(in_plane(case, **loaded(case)))
    manifold, rng = potential.manifold, np.random.default_rng(0)
    nodes = manifold.retract(potential.structure.nodes, 0.1 * rng.normal(size=manifold.size))
    assert (nodes[:, 2] == 0).all()
    point, way = potential.at(nodes), rng.normal(size=manifold.size)
    steps = np.array([4e-3, 2e-3, 1e-3])
    energy = np.array([potential.at(manifold.retract(nodes, h * way)).energy for h in steps])
    linear = point.energy + steps * (point.gradient @ way)
    assert order_of(steps, np.abs(energy - linear)) == pytest.approx(2, abs=0.1)
    curved = linear + steps**2 / 2 * (way @ point.hessian @ way)
    assert order_of(steps, np.abs(energy - curved)) == pytest.approx(3, abs=0.3)


@cases
def test_static_response_is_that_of_the_nonlinear_rest(case):
    scene = in_plane(case, **loaded(case))
    rest = tc.find_equilibrium(scene)
    response = tc.statics.static_influence(rest)
    way, mass = np.random.default_rng(3).normal(size=response.shape[1]), rest.potential.members.mass
    steps, off = np.array([4e-3, 2e-3, 1e-3]), []
    rigid = rest.potential.manifold.mass(mass)[:, None] * rest.spectrum.rigid.basis
    for h in steps:
        moved = tc.find_equilibrium(scene, start=rest.nodes, inputs=h * way)
        xi = rest.potential.manifold.logarithm(rest.nodes, moved.nodes)
        xi = xi - rest.spectrum.rigid.basis @ (rigid.T @ xi)
        off.append(np.abs(xi - h * (response @ way)).max())
    assert order_of(steps, off) == pytest.approx(2, abs=0.15)


def test_a_free_structure_has_three_rigid_motions():
    rest = tc.find_equilibrium(in_plane(CASES["free"]))
    assert rest.stable
    assert rest.spectrum.rigid.names == ("translation x", "translation y", "rotation z")
    assert (np.abs(rest.omega2) < 1e-10 * rest.omega2[-1]).sum() == 3


def test_stability_is_judged_in_the_plane():
    """A column between four ties in its plane is stable there; in space it falls over."""
    ties = {"nodes": {"o": [0, 0], "top": [0, 1], "l": [-1, 0], "r": [1, 0]}, "rods": {"rod": ["o", "top"]}}
    ties |= {"tendons": {"lt": ["l", "top"], "rt": ["r", "top"]}, "pins": ["o", "l", "r"]}
    flat = in_plane(ties, gravity={"g": [0, -50.0, 0]})
    assert tc.find_equilibrium(flat).stable
    deep = flat.replaced(structure=replace(tc.planar(**ties), planar=False))
    assert tc.find_equilibrium(deep).stable is tc.Stability.NO


def test_pendulum_under_weight_along_y():
    """A rod on a pin swings at omega^2 = 3 g / 2 L, once."""
    structure = tc.planar({"o": [0, 0], "p": [0, -2.0]}, {"r": ["o", "p"]}, {}, ["o"])
    rest = tc.find_equilibrium(tc.Scene(structure=structure, gravity={"g": 9.0}))
    assert rest.omega2 == pytest.approx([1.5 * 9.0 / 2.0], rel=1e-14)
    assert rest.rod_forces == pytest.approx([-4.5])


def test_turned_moved_and_rescaled():
    """A motion within the plane changes nothing; twice the lengths at equal stiffness make four times the energy."""
    case = CASES["free"]
    rest, angle = tc.find_equilibrium(in_plane(case)), 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = {label: (2 * turn @ p + [3.0, -1.0]).tolist() for label, p in NODES.items()}
    other = tc.find_equilibrium(in_plane({**case, "nodes": turned}))
    assert other.energy == pytest.approx(4 * rest.energy, rel=1e-11)
    assert other.omega2[3:] == pytest.approx(rest.omega2[3:], rel=1e-10)


def test_mirror_images_are_different_rests():
    """In a plane no turn carries a shape onto its mirror image, as a turn in space would."""
    rest = tc.find_equilibrium(in_plane(CASES["free"]))
    image = replace(rest, nodes=rest.nodes * [-1.0, 1.0, 1.0])
    assert not same_rest(rest, image)
    turned = replace(rest, nodes=rest.nodes[:, [1, 0, 2]] * [-1.0, 1.0, 1.0])
    assert same_rest(rest, turned)


class TestLinear:
    @cases
    def test_outputs_have_no_z(self, case):
        _, rest, linear = solved(in_plane(case, **loaded(case)), ("nodes",))
        linear.verify()
        free = [
            f"{label}_{axis}"
            for label, row in zip(rest.structure.node_labels, ~rest.structure.held, strict=True)
            for axis, at in zip("xy", row, strict=False)
            if at
        ]
        assert list(linear.outputs) == free
        assert len(linear.states) == 2 * rest.potential.manifold.size

    def test_co_moving_frame(self):
        """The frame gives back a turn within the plane, the mirror image of a shape included."""
        potential = Potential.of(in_plane(CASES["free"]))
        nodes, angle, spin = potential.structure.nodes, 2.5, 0.4
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        moved = nodes @ turn.T + [1.0, 2.0, 0.0]
        frame = best_fit(potential, nodes, moved, np.cross([0, 0, spin], moved))
        assert frame.rotation == pytest.approx(turn, abs=1e-14)
        assert frame.spin == pytest.approx([0, 0, spin], abs=1e-14)
        assert frame.nodes(moved) == pytest.approx(nodes, abs=1e-14)
        mirrored = best_fit(potential, nodes, nodes * [-1.0, 1.0, 1.0], 0 * nodes)
        assert np.linalg.det(mirrored.rotation[:2, :2]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda scene: self_stress(tc.build_structure(scene)), "prestress is found for whole pins in space only"),
        (lambda scene: tc.inverse_statics(Potential.of(scene), tension_min=1.0), "prestress is found for"),
        (lambda scene: tc.nearest_shape(Potential.of(scene), tension_min=1.0), "prestress is found for"),
        (lambda scene: mjcf(tc.build_dynamics(scene)), "MuJoCo holds single directions by springs only"),
    ],
    ids=["prestress", "inverse", "nearest", "mujoco"],
)
def test_rooms_without_planes(ask, words):
    with pytest.raises(tc.StructureError, match=f"the structure is planar, and {words}"):
        ask(in_plane(CASES["free"]))


class TestMotion:
    @cases
    def test_the_model_has_two_dimensions(self, case):
        """X has two components of q1 and q2 of free rods and of q2 of held ones; f costs a fifth less than in space."""
        flat = tc.build_dynamics(in_plane(case))
        hold = flat.potential.manifold.hold
        assert flat.f.size1_in(0) == 4 * np.select([hold == 0, hold == 3], [2, 0], 1).sum()
        if not flat.tied:
            deep = tc.build_dynamics(tc.Scene(structure=replace(flat.structure, planar=False)))
            assert operations(flat.f) < 0.8 * operations(deep.f)

    @cases
    def test_it_moves_as_the_model_in_space_with_z_held(self, case):
        """Accelerations of the CasADi model of the plane are those in space with guides."""
        flat, deep = (tc.build_dynamics(make(case, **loaded(case))) for make in (in_plane, in_space))
        nodes, velocities = random_motion(flat.potential, np.random.default_rng(7), reach=0.05)
        rates = []
        for dynamics in (flat, deep):
            x = dynamics.pack(nodes, velocities)
            rate = np.asarray(dynamics.f(x, np.zeros(len(dynamics.members.inputs)), np.zeros(0))).ravel()
            _, a = dynamics.unpack(np.concatenate([x[: x.size // 2], rate[x.size // 2 :]]))
            rates.append(a)
        assert rates[0] == pytest.approx(rates[1], abs=1e-11 * np.abs(rates[1]).max())
        again = flat.unpack(flat.pack(nodes, velocities))
        assert again[0] == pytest.approx(nodes, abs=1e-14)
        assert again[1] == pytest.approx(velocities, abs=1e-13)

    @pytest.mark.parametrize("name", ["free", "jointed"])
    def test_runs_agree(self, name):
        case = CASES[name]
        flat, deep = (tc.build_dynamics(make(case)) for make in (in_plane, in_space))
        start = random_motion(flat.potential, np.random.default_rng(8), reach=0.02, speed=0.5)
        runs = [tc.simulate(d, start, t_end=0.5, timepts=[0, 0.25, 0.5]) for d in (flat, deep)]
        assert (runs[0].nodes[..., 2] == 0).all()
        assert runs[0].nodes == pytest.approx(runs[1].nodes, abs=1e-8)

    @pytest.mark.parametrize("name", ["guided", "jointed"])
    def test_cvodes_moves_it_as_the_kernel_does(self, name):
        """Its forces have two components a node too: weight, loads, a push."""
        dynamics = tc.build_dynamics(in_plane(CASES[name], gravity={"g": 2.0}, **loaded(CASES[name])))
        node = dynamics.structure.node_labels[1]
        given = {"t_end": 0.5, "timepts": [0, 0.25, 0.5], "pushes": [tc.Push(node, (1.0, -0.5, 0.0), 0.1, 0.3)]}
        ours, theirs = (
            tc.simulate(dynamics, dynamics.structure.nodes, method=method, tol=1e-9, **given)
            for method in ("dopri5", "cvodes")
        )
        assert np.abs(ours.nodes[-1] - ours.nodes[0]).max() > 1e-2
        assert theirs.nodes == pytest.approx(ours.nodes, abs=1e-6)

    def test_explained(self):
        flat = tc.build_dynamics(in_plane(CASES["free"]))
        deep = tc.build_dynamics(tc.Scene(structure=replace(flat.structure, planar=False)))
        inside = [{t.name: t.included for t in d.explain().terms}["third dimension"] for d in (flat, deep)]
        assert inside == [False, True]

    def test_disturbances(self):
        """A push has two components, in f as in the linear model."""
        push = [{"node": "b", "force": [1.0, 2.0, 0], "from": 0, "to": 1}]
        dynamics, rest, linear = solved(in_plane(CASES["pinned"], simulation={"t_end": 1.0, "push": push}))
        assert dynamics.f.size1_in(2) == 2 == linear.E.shape[1]
        w, h = np.array([1.0, 2.0]), 1e-6
        at_rest = dynamics.pack(rest.nodes)
        rate = np.asarray(dynamics.f(at_rest, np.zeros(4), w)).ravel()
        ahead, back = (linear.state_of(*dynamics.unpack(at_rest + s * h * rate)) for s in (1, -1))
        assert (ahead - back) / (2 * h) == pytest.approx(linear.E @ w, abs=1e-6)


def operations(f):
    """Instructions of a function but for those that hand over its inputs and outputs."""
    return f.n_instructions() - f.nnz_in() - f.nnz_out()
