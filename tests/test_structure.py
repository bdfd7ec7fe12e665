"""The shell class is built as its topology table says; recipes and mistakes give what they should."""

import itertools
import re
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import replaced, shell_scene

import tensctl as tc
from tensctl.structure import build_members

SIZES = [(3, 1), (3, 2), (4, 1), (4, 3), (5, 2), (6, 4), (7, 1), (8, 4), (12, 6)]

# Every tendon vector is head - tail: alpha, stage j = 1, stages between, stage j = m. In a shell of one stage t1, t2
# and t9 follow the first column, t6, t7 and t10 the last.
TABLE = """
1  | P2(i,j) - P1(i+1,j)     | P2(i,j) - P4(i,j-1)     | P2(i,j) - P4(i,j-1)
2  | P1(i,j) - P1(i+1,j)     | P1(i,j) - P4(i,j-1)     | P1(i,j) - P4(i,j-1)
3  | P3(i-1,j) - P1(i,j)     | P3(i-1,j) - P1(i,j)     | P3(i-1,j) - P1(i,j)
4  | P2(i,j) - P3(i-1,j)     | P2(i,j) - P3(i-1,j)     | P2(i,j) - P3(i-1,j)
5  | P4(i,j) - P2(i,j)       | P4(i,j) - P2(i,j)       | P4(i,j) - P2(i,j)
6  | P1(i+1,j+1) - P4(i,j)   | P1(i+1,j+1) - P4(i,j)   | P4(i+1,j) - P4(i,j)
7  | P3(i,j) - P1(i+1,j+1)   | P3(i,j) - P1(i+1,j+1)   | P3(i,j) - P4(i+1,j)
8  | P2(i,j) - P3(i,j)       | P2(i,j) - P3(i,j)       | P2(i,j) - P3(i,j)
9  | none                    | P1(i+1,j) - P2(i,j)     | P1(i+1,j) - P2(i,j)
10 | P4(i+1,j) - P3(i,j)     | P4(i+1,j) - P3(i,j)     | none
"""
END = re.compile(r"P(\d)\(i([+-]1)?,j([+-]1)?\)")


def rule(alpha, j, m):
    """What the table says of tendon alpha in stage j: ends (number, di, dj) of head and tail, or nothing."""
    line = next(row for row in TABLE.strip().splitlines() if int(row.split("|")[0]) == alpha)
    column = (3 if alpha in (6, 7, 10) else 1) if m == 1 else {1: 1, m: 3}.get(j, 2)
    ends = END.findall(line.split("|")[column])
    return [(int(k), int(di or 0), int(dj or 0)) for k, di, dj in ends]


def expected_tendons(n, m, primal):
    """Label -> (tail label, head label) from the table."""
    tendons = {}
    for j, i, alpha in itertools.product(range(1, m + 1), range(1, n + 1), range(1, 9 if primal else 11)):
        if ends := rule(alpha, j, m):
            head, tail = (f"P{k}_{(i + di - 1) % n + 1}_{j + dj}" for k, di, dj in ends)
            tendons[f"t{alpha}_{i}_{j}"] = (tail, head)
    return tendons


def named_ends(structure, members):
    return [tuple(structure.node_labels[end] for end in pair) for pair in members]


@pytest.mark.parametrize(("n", "m"), SIZES)
class TestShellClass:
    def test_counts(self, n, m):
        full, primal = tc.shell(n, m), tc.shell(n, m, primal=True)
        assert (len(full.tendons), len(primal.tendons)) == (n * (10 * m - 2), 8 * n * m)
        assert (len(full.rods), len(full.nodes)) == (2 * n * m, 4 * n * m)

    @pytest.mark.parametrize("primal", [False, True])
    def test_topology_table(self, n, m, primal):
        built = tc.shell(n, m, primal=primal)
        expected = expected_tendons(n, m, primal)
        assert built.tendon_labels == tuple(expected)
        assert named_ends(built, built.tendons) == list(expected.values())

    def test_rods_join_their_own_nodes(self, n, m):
        built = tc.shell(n, m)
        wanted = [
            (f"P{k}_{i}_{j}", f"P{k + 1}_{i}_{j}") for j in range(1, m + 1) for i in range(1, n + 1) for k in (1, 3)
        ]
        assert named_ends(built, built.rods) == wanted
        assert np.unique(built.rods).size == 4 * n * m

    def test_no_two_tendons_join_the_same_nodes(self, n, m):
        built = tc.shell(n, m)
        assert len({frozenset(pair) for pair in built.tendons.tolist()}) == len(built.tendons)

    def test_left_out_copies_are_other_tendons_reversed(self, n, m):
        """t9 of the first stage would be t1 reversed, t10 of the last stage t7 reversed."""
        tendons = expected_tendons(n, m, False)
        for i in range(1, n + 1):
            following = i % n + 1
            assert tendons[f"t1_{i}_1"] == (f"P1_{following}_1", f"P2_{i}_1")
            assert tendons[f"t7_{i}_{m}"] == (f"P4_{following}_{m}", f"P3_{i}_{m}")

    def test_turning_by_one_element_maps_it_on_itself(self, n, m):
        built = tc.shell(n, m)
        c, s = np.cos(2 * np.pi / n), np.sin(2 * np.pi / n)
        turned = built.nodes @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        index = {label: k for k, label in enumerate(built.node_labels)}
        image = np.array([index[following(label, n)] for label in built.node_labels])
        assert np.abs(turned - built.nodes[image]).max() < 1e-14 * (1 + np.abs(built.nodes).max())
        pairs = {tuple(pair) for pair in built.tendons.tolist()}
        assert {tuple(image[list(pair)].tolist()) for pair in pairs} == pairs


def following(label, n):
    """The label one element on around the axis."""
    k, i, j = label.split("_")
    return f"{k}_{int(i) % n + 1}_{j}"


def test_reference_shells(reference):
    built = tc.shell(reference["n"], reference["m"])
    assert list(built.tendon_labels) == reference["tendon_labels"]
    assert built.tendons.tolist() == reference["tendons_tail_head"]
    assert built.rods.tolist() == reference["rods"]
    assert np.abs(built.nodes - reference["nodes_initial"]).max() < 1e-15
    assert np.abs(built.rod_lengths - reference["rod_lengths"]).max() < 1e-15


lengths = st.floats(0.1, 10)


@given(lengths, lengths, st.floats(-0.5, 0.5), st.floats(-3, 3))
def test_cylinder(radius, height, overlap, twist):
    built = tc.shell(5, 2, radius=radius, height=height, overlap=overlap, twist=twist)
    x, y, z = built.nodes.reshape(-1, 4, 3).transpose(2, 0, 1)
    assert np.abs(np.hypot(x, y) / radius - 1).max() < 1e-14
    angle = np.unwrap(np.arctan2(y, x) - np.arctan2(y, x)[:, :1], axis=1)
    wanted = np.array([0, twist, twist + np.pi / 5, np.pi / 5])
    assert np.abs(np.exp(1j * angle) - np.exp(1j * wanted)).max() < 1e-13
    rise = np.array([0, height, height - overlap, 2 * height - overlap])
    base = np.repeat([0, 2 * height - 2 * overlap], 5)
    assert np.abs(z - base[:, None] - rise).max() < 1e-13 * (1 + height)
    chord = np.hypot(2 * radius * np.sin(twist / 2), height)
    assert np.abs(built.rod_lengths / chord - 1).max() < 1e-13


class TestPrism:
    @pytest.mark.parametrize("n", [3, 4, 7])
    def test_counts_and_rods(self, n):
        built = tc.prism(n)
        assert (len(built.nodes), len(built.rods), len(built.tendons)) == (2 * n, n, 3 * n)
        assert np.ptp(built.rod_lengths) < 1e-15

    @pytest.mark.parametrize("n", [3, 5, 8])
    def test_default_twist_balances(self, n):
        """At pi/2 + pi/n equal force densities in the verticals and scaled ones in the polygons balance the rods."""
        built = tc.prism(n)
        side = built.nodes[built.tendons[2 * n, 1]] - built.nodes[built.tendons[2 * n, 0]]
        rod, top = built.rod_vectors[0], built.nodes[n]
        following, before = built.nodes[n + 1], built.nodes[2 * n - 1]
        forces = np.column_stack([-side, rod, (following - top) + (before - top)])
        assert np.linalg.svd(forces, compute_uv=False)[-1] < 1e-14


class TestPins:
    def test_pattern(self):
        built = tc.shell(3, 2, pins=["P1_*_1", "P4_2_2"])
        held = {label for label, pinned in zip(built.node_labels, built.pinned, strict=True) if pinned}
        assert held == {"P1_1_1", "P1_2_1", "P1_3_1", "P4_2_2"}

    def test_tendons_between_pins_are_grounded(self):
        built = tc.shell(3, 1, pins=["P1_*_1"])
        grounded = {label for label, g in zip(built.tendon_labels, built.grounded_tendons, strict=True) if g}
        assert grounded == {"t2_1_1", "t2_2_1", "t2_3_1"}

    def test_network_pins_by_index_and_label(self):
        nodes, rods = np.eye(3)[[0, 1]], [[0, 1]]
        assert tc.network(nodes, rods, [], pins=[1]).pinned.tolist() == [False, True]
        assert tc.network(nodes, rods, [], pins=["2"]).pinned.tolist() == [False, True]

    def test_single_directions(self):
        built = tc.shell(3, 1, pins={"P1_*_1": "z", "P1_2_1": "zxy", "P4_*_1": "xy"})
        held = dict(zip(built.node_labels, built.held.tolist(), strict=True))
        assert held["P1_1_1"] == [False, False, True]
        assert held["P1_2_1"] == [True, True, True]
        assert held["P4_3_1"] == [True, True, False]
        assert built.pinned.sum() == 1
        assert not built.guides[built.pinned].any()
        assert (built.free == ~built.held).all()

    def test_joints_are_held_where_either_part_is(self):
        built = tc.shell(3, 2, cls=2, pins={"P4_1_1": "xy", "P3_3_2": "z", "P1_1_1": "x"})
        held = dict(zip(built.node_labels, built.held.tolist(), strict=True))
        assert held["P4_1_1+P3_3_2"] == [True, True, True]
        assert held["P1_1_1"] == [True, False, False]
        assert built.pinned.sum() == 1


class TestPlane:
    def test_directions(self):
        built = tc.planar([[0, 0], [1, 0]], [[0, 1]], [], pins={"1": "xy", "2": "y"})
        assert built.dimension == 2
        assert built.nodes.tolist() == [[0, 0, 0], [1, 0, 0]]
        assert built.pinned.tolist() == [True, False]
        assert built.free.tolist() == [[False] * 3, [True, False, False]]

    def test_weight_is_along_y(self):
        scene = tc.Scene(structure=tc.planar([[0, 0], [1, 0]], [[0, 1]], [], pins=[0]), gravity={"g": 2.0})
        members = build_members(scene, tc.build_structure(scene))
        assert members.forces.tolist() == [[0, -1, 0], [0, -1, 0]]


TWO = {"a": [0, 0, 0], "b": [1, 0, 0], "c": [0, 1, 0], "d": [0, 0, 1]}
RODS = {"r": ["a", "b"], "s": ["c", "d"]}


def network(**changes):
    return lambda: tc.network(**{"nodes": TWO, "rods": RODS, "tendons": {"t": ["a", "c"]}} | changes)


def plane(**sections):
    structure = tc.planar([[0, 0], [1, 0]], [[0, 1]], [])
    return lambda: build_members(tc.Scene(structure=structure, **sections), structure)


MISTAKES = {
    "n": (lambda: tc.shell(2, 1), "n = 2: a shell closes around its axis with n >= 3 elements"),
    "m": (lambda: tc.shell(3, 0), "m = 0: a shell has m >= 1 stages"),
    "class": (lambda: tc.shell(3, 1, cls=3), "class = 3: a shell has class 1"),
    "radius": (lambda: tc.shell(3, 1, radius=0), "radius = 0: a shell needs a radius > 0 m"),
    "height": (lambda: tc.shell(3, 1, height=-1), "height = -1: a shell needs a height > 0 m"),
    "prism n": (lambda: tc.prism(2), "n = 2: a prism has n >= 3 rods"),
    "prism size": (lambda: tc.prism(3, radius=0), "a prism needs both > 0 m"),
    "direction": (lambda: tc.prism(3, pins={"a1": "w"}), 'pins: a1 = "w"; expected some of the letters in "xyz"'),
    "no direction": (lambda: tc.prism(3, pins={"a1": ""}), 'pins: a1 = ""; expected some of the letters in "xyz"'),
    "out of plane": (
        lambda: tc.planar([[0, 0], [1, 0]], [[0, 1]], [], pins={"1": "z"}),
        'pins: 1 = "z"; expected some of the letters in "xy"',
    ),
    "space": (lambda: tc.planar(np.eye(3), [[0, 1]], []), r"nodes have shape \(3, 3\); two coordinates"),
    "pinned and guided": (
        lambda: replaced(tc.prism(3, pins=["a1"]), guides=np.ones((6, 3), bool)).verify(),
        "node a1 is pinned and guided",
    ),
    "off the plane": (lambda: replaced(tc.prism(3), planar=True).verify(), "node b1 has z = 1 m .* lies in z = 0"),
    "load out of plane": (plane(loads={"1": [0, 0, 1]}), r"loads.1 is \[0.0, 0.0, 1.0\]; a planar structure"),
    "weight out of plane": (plane(gravity={"g": [0, 0, 1]}), r"gravity.g is \[0.0, 0.0, 1.0\]; a planar structure"),
    "push out of plane": (
        plane(simulation={"t_end": 1.0, "push": [{"node": "1", "force": [0, 0, 1], "from": 0, "to": 1}]}),
        r"the force of simulation.push on 1 is \[0.0, 0.0, 1.0\]; a planar structure",
    ),
    "pin label": (lambda: tc.shell(3, 1, pins=["P1_9_1"]), r'pins: "P1_9_1" names nothing.*nearest label is P1_\d_1'),
    "repeated tendon": (
        network(tendons={"t": ["a", "c"], "u": ["c", "a"]}),
        "tendons t and u join the same two nodes; give one tendon with the sum of both stiffnesses",
    ),
    "loop": (network(tendons={"t": ["a", "a"]}), "tendon t starts and ends at a; give two different nodes"),
    "no rod": (network(rods={}, pins=["*"]), "the structure has no rod, so nothing in it moves"),
    "massless node": (network(nodes=TWO | {"e": [1, 1, 1]}), "node e belongs to no rod and is not pinned"),
    "no length": (network(nodes=TWO | {"b": [0, 0, 0]}), "rod r has length 0 m between a and b"),
    "twice in a row": (network(tendons={"t": ["a", "c", "c"]}), "tendon t passes node c twice in a row; name it once"),
    "repeated cable": (
        network(tendons={"t": ["a", "c", "d"], "u": ["d", "c", "a"]}),
        "tendons t and u run along the same nodes; give one tendon with the sum of both stiffnesses",
    ),
    "one node": (network(tendons={"t": ["a"]}), "tendon t names 1 nodes; at least a tail and a head, are expected"),
    "rod of three": (network(rods={"r": ["a", "b", "c"]}), "rod r names 3 nodes; two, a tail and a head, are expected"),
    "unknown end": (network(rods={"r": ["a", "z"]}), "rod r ends at node z, which is not among the 4 nodes"),
    "index": (lambda: tc.network(np.eye(3), [[0, 3]], []), "rod r1 ends at node 3"),
    "shape": (lambda: tc.network([[0, 0], [1, 1]], [[0, 1]], []), r"nodes have shape \(2, 2\)"),
    "finite": (network(nodes=TWO | {"a": [np.nan, 0, 0]}), "node a is at .*; coordinates must be finite"),
}


@pytest.mark.parametrize(("build", "sentence"), MISTAKES.values(), ids=MISTAKES)
def test_mistakes(build, sentence):
    with pytest.raises(tc.StructureError, match=sentence):
        build()


@pytest.mark.parametrize(
    ("sections", "sentence"),
    [
        ({"tendons": {"stiffness": {"t99_*": 1.0, "*": 2.0}}}, 'tendons.stiffness: "t99_\\*" names nothing'),
        ({"tendons": {"stiffness": {"t1_*": 1.0}}}, "tendons.stiffness: no entry for t2_1_1"),
        ({"rods": {"mass": {"r3_1_1": 1.0}}}, 'rods.mass: "r3_1_1" names nothing'),
        ({"loads": {"Q": [0, 0, 1]}}, 'loads: "Q" names nothing'),
        ({"actuators": {"tendons": ["s*"]}}, 'actuators.tendons: "s\\*" names nothing'),
    ],
)
def test_labels_that_the_structure_does_not_have(sections, sentence):
    with pytest.raises(tc.StructureError, match=sentence):
        tc.build_dynamics(shell_scene(**sections))


@pytest.mark.parametrize(
    "built",
    [
        tc.shell(3, 1, pins=["P1_*_1"]),
        tc.shell(4, 2, primal=True, twist=1.1),
        tc.prism(5, pins=["a*"]),
        tc.prism(5, pins={"a*": "z", "a1": "xyz"}),
        tc.planar({"a": [0, 0.1], "b": [1, 0]}, {"r": ["a", "b"]}, {}, pins={"a": "xy", "b": "y"}),
    ],
    ids=["mast", "primal", "prism", "guides", "plane"],
)
def test_recipe_round_trip_is_exact(built):
    again = tc.build_structure(tc.Scene(**tomllib.loads(tc.Scene(structure=built).to_toml())))
    assert (again.nodes == built.nodes).all()
    assert (again.held == built.held).all()
    assert (again.pinned == built.pinned).all()
    assert again.planar == built.planar
    assert again.rods.tolist() == built.rods.tolist()
    assert again.tendons.tolist() == built.tendons.tolist()
    for names in ("node_labels", "rod_labels", "tendon_labels"):
        assert getattr(again, names) == getattr(built, names)
