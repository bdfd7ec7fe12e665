"""Rods that share nodes: the cut manifold is exact, class 2 shells close, and independent statements agree."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla

import tensctl as tc
from tensctl.elements import JointedManifold, Potential

G = 9.81


def class_two(n, m, **options):
    return tc.Scene(structure=tc.shell(n, m, cls=2), tendons={"stiffness": 100.0, "rest_ratio": 0.8}, **options)


def chain(links, *, mass=1.0, length=1.0):
    """A pendulum of equal rods hanging from a pin."""
    nodes = {str(k): [0.0, 0.0, -k * length] for k in range(links + 1)}
    rods = {f"rod{k}": [str(k), str(k + 1)] for k in range(links)}
    structure = tc.network(nodes, rods, {}, pins=["0"])
    return tc.Scene(structure=structure, rods={"mass": mass}, gravity={"g": G})


@pytest.mark.parametrize(("n", "m"), [(3, 1), (3, 2), (4, 2), (3, 3), (6, 3), (5, 4)])
def test_counts_of_class_two(n, m):
    shell = tc.shell(n, m, cls=2)
    assert (len(shell.nodes), len(shell.tendons), len(shell.rods)) == (2 * n * (m + 1), n * (6 * m + 2), 2 * n * m)
    ends = np.bincount(shell.rods.ravel())
    assert ends.max() == (2 if m > 1 else 1)
    assert (ends == 2).sum() == 2 * n * (m - 1)
    pairs = {frozenset(t) for t in shell.tendons.tolist()}
    assert len(pairs) == len(shell.tendons)


def test_only_the_closing_pairs_of_tendons_merge():
    merged = [label for label in tc.shell(4, 3, cls=2).tendon_labels if "+" in label]
    kinds = {tuple(part.split("_")[0] for part in label.split("+")) for label in merged}
    assert kinds == {("t1", "t4"), ("t2", "t3"), ("t5", "t6"), ("t7", "t8")}


@pytest.mark.parametrize("wrong", [{"overlap": 0.3}, {"twist": 1.4}])
def test_dimensions_that_do_not_close_are_refused(wrong):
    with pytest.raises(tc.StructureError, match="close on the cylinder only for"):
        tc.shell(3, 2, cls=2, **wrong)


def test_merged_tendons_add_up():
    scene = class_two(3, 2).replaced(tendons={"stiffness": {"*": 100.0, "t5_*": 50.0}, "rest_ratio": 0.8})
    potential = Potential.of(scene)
    by_label = dict(zip(potential.structure.tendon_labels, potential.members.stiffness, strict=True))
    assert by_label["t5_1_1+t6_1_1"] == 150.0
    assert by_label["t7_1_1+t8_1_1"] == 200.0
    assert by_label["t5_1_2"] == 50.0


def test_merged_tendons_need_one_rest_length():
    scene = class_two(3, 2).replaced(tendons={"rest_ratio": {"*": 0.8, "t5_*": 0.7}})
    with pytest.raises(tc.StructureError, match="one value"):
        tc.find_equilibrium(scene)


def test_a_recipe_keeps_merged_stiffness():
    structure = tc.shell(3, 2, cls=2)
    scene = tc.Scene(structure=structure, tendons={"stiffness": {"*": 100.0, "t5_*": 50.0}})
    again = tc.Scene(structure=Potential.of(scene).structure, tendons={"stiffness": {"*": 100.0, "t5_*": 50.0}})
    assert np.array_equal(Potential.of(scene).members.stiffness, Potential.of(again).members.stiffness)


@pytest.mark.parametrize(("n", "m"), [(3, 2), (4, 2), (3, 3), (6, 3)])
def test_class_two_shells_are_stable_and_taut(n, m):
    rest = tc.find_equilibrium(class_two(n, m))
    rest.verify()
    assert rest.stable
    assert rest.tensions.min() > 0
    assert rest.residual < 1e-12
    assert len(rest.spectrum.rigid.names) == 6
    joints = 2 * n * (m - 1)
    assert rest.potential.manifold.size == 5 * 2 * n * m - 3 * joints


def test_gradient_and_hessian_of_the_cut_manifold():
    """Remainders of the energy along `retract` shrink as h^2 and h^3, away from rest and under load."""
    scene = class_two(3, 2, loads={"P4_*_2": [0.3, 0.2, -1.0]})
    potential = Potential.of(scene)
    manifold, rng = potential.manifold, np.random.default_rng(0)
    nodes = manifold.retract(potential.structure.nodes, 0.1 * rng.normal(size=manifold.size))
    point, way = potential.at(nodes), rng.normal(size=manifold.size)
    steps = np.array([4e-3, 2e-3, 1e-3])
    energy = np.array([potential.at(manifold.retract(nodes, h * way)).energy for h in steps])
    first = np.abs(energy - point.energy - steps * (point.gradient @ way))
    second = np.abs(energy - point.energy - steps * (point.gradient @ way) - steps**2 / 2 * (way @ point.hessian @ way))
    assert np.polyfit(np.log(steps), np.log(first), 1)[0] == pytest.approx(2, abs=0.1)
    assert np.polyfit(np.log(steps), np.log(second), 1)[0] == pytest.approx(3, abs=0.2)


def test_rods_and_joints_stay_exact():
    potential = Potential.of(class_two(4, 2))
    manifold, rng = potential.manifold, np.random.default_rng(1)
    assert isinstance(manifold, JointedManifold)
    nodes = potential.structure.nodes
    for _ in range(5):
        nodes = manifold.retract(nodes, 0.2 * rng.normal(size=manifold.size))
    ends = nodes[potential.structure.rods]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert np.abs(lengths / potential.structure.rod_lengths - 1).max() < 1e-14


def test_a_basis_chain_by_chain_spans_all_that_rows_leave():
    """The mass-square projector on the tangent space is that of the dense null space of all rows together."""
    manifold = Potential.of(class_two(4, 3)).manifold
    nodes = manifold.retract(manifold.anchor, 0.1 * np.random.default_rng(3).normal(size=manifold.size))
    root, basis = np.sqrt(manifold.weights), manifold.basis(nodes).toarray()
    at = nodes[manifold.end_node].ravel()
    rows = np.zeros((len(manifold.first), at.size))
    rows[np.arange(len(rows)), manifold.first], rows[np.arange(len(rows)), manifold.second] = 1.0, -1.0
    wanted = sla.null_space(rows @ manifold.ends.tangent(at.reshape(-1, 3)).toarray() * root)
    square = basis / root[:, None]
    assert np.abs(square.T @ square - np.eye(manifold.size)).max() < 1e-14
    assert np.abs(square @ square.T - wanted @ wanted.T).max() < 1e-13


def test_tangents_of_many_chains_are_sparse():
    """A coordinate moves the m rods of its own chain only: 3 + 2 m entries a row."""
    potential = Potential.of(class_two(20, 10))
    point = potential.at(potential.structure.nodes)
    assert potential.manifold.basis(point.nodes).nnz == 23 * potential.manifold.ends.size
    assert point.input_map.nnz < 0.1 * np.prod(point.input_map.shape)
    assert point.hessian.nnz < 0.6 * np.prod(point.hessian.shape)


def test_logarithm_and_its_rate():
    """To first order the chart gives back the step; its rate is its derivative at any distance."""
    manifold = Potential.of(class_two(3, 2)).manifold
    rng, nodes = np.random.default_rng(2), tc.shell(3, 2, cls=2).nodes
    way, onward = rng.normal(size=(2, manifold.size))
    errors = [np.abs(manifold.logarithm(nodes, manifold.retract(nodes, h * way)) - h * way).max() for h in (1e-2, 1e-3)]
    assert errors[0] / errors[1] > 90
    there, h = manifold.retract(nodes, 0.1 * way), 1e-5
    forth, back = (manifold.retract(there, sign * h * onward) for sign in (1, -1))
    rate = (manifold.logarithm(nodes, forth) - manifold.logarithm(nodes, back)) / (2 * h)
    assert manifold.velocity(nodes, there, (forth - back) / (2 * h)) == pytest.approx(rate, abs=1e-8)


def test_joints_are_the_limit_of_stiff_links():
    """Split nodes held together by tendons of growing stiffness come to the same rest, with error ~ 1/stiffness."""
    shell = tc.shell(3, 2, cls=2)
    rest = tc.find_equilibrium(tc.Scene(structure=shell))
    errors = [np.abs(linked_tensions(shell, stiff) - rest.tensions).max() for stiff in (1e5, 1e6)]
    assert errors[1] < 1e-2
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.05)


def linked_tensions(shell, stiff):
    """Tensions of a class 2 shell whose joints are stiff links between two nodes."""
    ends = shell.rods.ravel()
    nodes, seen, rods, links = list(shell.nodes), set(), shell.rods.copy(), []
    for k, node in enumerate(ends):
        if node in seen:
            nodes.append(shell.nodes[node] + 1e-9)
            links.append([node, len(nodes) - 1])
            rods.flat[k] = len(nodes) - 1
        seen.add(node)
    names = tuple(str(k) for k in range(len(nodes)))
    split = replace(
        shell,
        nodes=np.array(nodes),
        rods=rods,
        tendons=np.vstack([shell.tendons, links]),
        node_labels=names,
        tendon_labels=tuple(f"t{k}" for k in range(len(shell.tendons))) + tuple(f"link{k}" for k in range(len(links))),
        pinned=np.zeros(len(nodes), bool),
        guides=np.zeros((len(nodes), 3), bool),
    )
    parts = [label.count("+") + 1 for label in shell.tendon_labels]
    stiffness = {f"t{k}": 100.0 * count for k, count in enumerate(parts)} | {"link*": stiff}
    rest_length = {f"t{k}": 0.8 * length for k, length in enumerate(shell.tendon_lengths)} | {"link*": 1e-9}
    scene = tc.Scene(structure=split, tendons={"stiffness": stiffness, "rest_length": rest_length})
    return tc.find_equilibrium(scene).tensions[: len(shell.tendons)]


def test_the_hanging_double_pendulum():
    """Two uniform rods: M = m L^2 [[4/3, 1/2], [1/2, 1/3]], K = m g L diag(3/2, 1/2), in two planes."""
    rest = tc.find_equilibrium(chain(2, mass=2.0, length=0.7))
    M = 2.0 * 0.7**2 * np.array([[4 / 3, 1 / 2], [1 / 2, 1 / 3]])
    K = 2.0 * G * 0.7 * np.diag([3 / 2, 1 / 2])
    wanted = np.repeat(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real), 2)
    assert rest.omega2 == pytest.approx(wanted, rel=1e-12)
    assert rest.stable


def test_rod_forces_of_a_hanging_chain():
    """Each rod carries half of its own weight at both ends and all that hangs below, in tension."""
    rest = tc.find_equilibrium(chain(4))
    below = np.array([3, 2, 1, 0]) * G
    assert rest.rod_forces == pytest.approx(-(below + 0.5 * G), rel=1e-12)


def test_a_standing_chain_is_unstable():
    scene = chain(2)
    nodes = {"0": [0, 0, 0], "1": [0, 0, 1], "2": [0, 0, 2]}
    up = tc.network(nodes, {"a": ["0", "1"], "b": ["1", "2"]}, {}, pins=["0"])
    rest = tc.find_equilibrium(scene.replaced(structure=up))
    assert rest.stable is tc.Stability.NO


def test_a_loop_of_rods_has_redundant_joints():
    """A rigid triangle of rods keeps six rigid-body motions and nothing else."""
    nodes = {"a": [0, 0, 0], "b": [1, 0, 0], "c": [0.2, 0.9, 0.3], "d": [3, 0, 0], "e": [3, 1, 0]}
    rods = {"ab": ["a", "b"], "bc": ["b", "c"], "ca": ["c", "a"], "de": ["d", "e"]}
    structure = tc.network(nodes, rods, {"t": ["b", "d"]}, pins=["d", "e"])
    potential = Potential.of(tc.Scene(structure=structure))
    assert potential.manifold.size == 6
