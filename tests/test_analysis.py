"""Verdicts on modes agree with brute force, every "no" has its true reason, and static reach is what statics does."""

import numpy as np
import pytest
from support import REFERENCE, network_scene, prism_scene, reference_prism, shell_scene, solved, taylor_order

import tensctl as tc
from tensctl.analysis import static_influence, tension_influence


def by_brute_force(A, B, omega, count):
    """How many of the `count` states at +i omega no input moves: zero singular values of [A - i omega I, B]."""
    values = np.linalg.svd(np.hstack([A - 1j * omega * np.eye(len(A)), B]), compute_uv=False)
    return int((values[-count:] < 1e-9 * values[0]).sum())


def verdict_counts(linear, report):
    """Per cluster of flexible modes: omega, its size and how many of it are not driven."""
    clusters = {}
    for mode, verdict in zip(linear.modes, report.modes, strict=True):
        if mode.kind == "flexible":
            clusters.setdefault(mode.cluster, []).append((np.sqrt(mode.omega2), verdict.verdict))
    return [(group[0][0], len(group), sum(v != "yes" for _, v in group)) for group in clusters.values()]


class TestShells:
    def test_free_shell(self, free):
        _, _, linear = free
        report = tc.controllability(linear)
        assert report.uncontrollable_modes == tuple(range(6))
        assert report.controllable_modes == tuple(range(6, 30))
        names = [f"{kind} {axis}" for kind in ("translation", "rotation") for axis in "xyz"]
        for mode in report.modes[:6]:
            assert mode.kind == "rigid-body"
            assert any(mode.reason.startswith(f"rigid-body {name}: tendons pull on both") for name in names)
        assert len({mode.reason for mode in report.modes[:6]}) == 6
        assert all(mode.reason == "" and mode.tendons for mode in report.modes[6:])

    def test_pinned_mast(self, mast):
        report = tc.controllability(mast[2])
        assert report.controllable_modes == tuple(range(21))
        assert report.uncontrollable_modes == ()

    @pytest.mark.parametrize(("n", "m"), [(4, 1), (3, 2), (4, 2), (6, 3)])
    def test_larger_shells_are_driven_too(self, n, m):
        """Where the Krylov matrix gives NaN."""
        _, _, linear = solved(shell_scene(n, m))
        assert tc.controllability(linear).controllable_modes == tuple(range(6, 10 * n * m))

    def test_repeated_frequencies_stand_together(self, free):
        """A structure with threefold symmetry has as many pairs as single modes of each kind: 30 = 10 + 2 x 10."""
        _, _, linear = free
        sizes = [mode.multiplicity for mode in linear.modes if mode.kind == "flexible"]
        assert set(sizes) == {1, 2}
        assert sizes.count(2) == 16

    def test_is_a_table(self, free):
        lines = str(tc.controllability(free[2])).splitlines()
        assert lines[0] == "24 of 30 modes are controllable"
        assert len(lines) == 2 + 30


ACTUATED = {
    "all": ["*"],
    "one": ["t5_1_1"],
    "two": ["t1_1_1", "t8_2_1"],
    "one orbit": ["t3_*"],
}


@pytest.mark.parametrize("actuators", ACTUATED.values(), ids=ACTUATED)
@pytest.mark.parametrize("pins", [(), ("P1_*_1",)], ids=["free", "pinned"])
def test_verdicts_agree_with_brute_force(actuators, pins):
    _, _, linear = solved(shell_scene(pins=pins, actuators={"tendons": actuators}))
    report = tc.controllability(linear)
    flexible = linear.flexible
    for omega, size, undriven in verdict_counts(linear, report):
        assert by_brute_force(flexible.A, flexible.B, omega, size) == undriven


def test_dampers_that_break_the_symmetry_let_one_tendon_reach_everything():
    """Hautus: with a damper on one tendon no eigenvalue is repeated, and one actuator reaches all 21 modes."""
    damped = {"damping": {"*": 0.0, "t1_1_1": 5.0}}
    _, _, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": ["t5_1_1"]}, tendons=damped))
    for pole in np.linalg.eigvals(linear.A):
        assert np.linalg.svd(np.hstack([linear.A - pole * np.eye(42), linear.B]), compute_uv=False)[-1] > 1e-2
    assert tc.controllability(linear).uncontrollable_modes == ()


class TestDistance:
    def test_taking_it_away_from_B_undoes_the_mode(self, mast):
        """The distance is reached: a change of B of that 2-norm makes the Hautus matrix of the mode singular."""
        _, _, linear = mast
        report = tc.controllability(linear)
        assert linear.modes[2].multiplicity == 1
        values, left = np.linalg.eig(linear.A.T)
        v = left[:, np.abs(values - 1j * np.sqrt(linear.modes[2].omega2)).argmin()]
        change = -np.outer(v.conj(), v @ linear.B)
        assert np.linalg.norm(change, 2) == pytest.approx(report.modes[2].distance, rel=1e-9)
        hautus = np.hstack([linear.A - 1j * np.sqrt(linear.modes[2].omega2) * np.eye(42), linear.B + change])
        assert np.linalg.svd(hautus, compute_uv=False)[-1] < 1e-12 * np.abs(linear.A).max()

    def test_gain_is_the_row_of_B(self, mast):
        _, _, linear = mast
        single = [k for k, mode in enumerate(linear.modes) if mode.multiplicity == 1]
        report = tc.controllability(linear)
        for k in single:
            assert report.modes[k].gain == pytest.approx(np.linalg.norm(linear.B[21 + k]), rel=1e-12)

    def test_damped_and_undamped_agree_for_little_damping(self, mast):
        """Distances come from the damped A's own eigenvectors and go over into the undamped ones."""
        _, _, damped = solved(shell_scene(pins=["P1_*_1"], tendons={"damping": 1e-7}))
        alone = [k for k, mode in enumerate(damped.modes) if mode.multiplicity == 1]
        one, other = tc.controllability(damped).modes, tc.controllability(mast[2]).modes
        for k in alone:
            assert one[k].distance == pytest.approx(other[k].distance, rel=1e-5)

    def test_strongest_tendon_by_hand(self, mast):
        dynamics, _, linear = mast
        report = tc.controllability(linear)
        k = next(k for k, mode in enumerate(linear.modes) if mode.multiplicity == 1)
        strongest = np.abs(linear.B[21 + k]).max()
        named = dynamics.input_labels.index(report.modes[k].tendons[0])
        assert abs(linear.B[21 + k, named]) == pytest.approx(strongest, rel=1e-9)


class TestReasons:
    def two_masts(self, **sections):
        """Two rods on pins that know nothing of each other, each between two ties along x and two along y."""
        nodes, rods, ties = {}, {}, {}
        for name, x in (("a", 0.0), ("b", 10.0)):
            nodes |= {f"{name}o": [x, 0, 0], f"{name}e": [x, 0, 1]}
            rods[name] = [f"{name}o", f"{name}e"]
            for k, (dx, dy) in enumerate([(2, 0), (-2, 0), (0, 3), (0, -3)]):
                nodes[f"{name}{k}"] = [x + dx, dy, 1]
                ties[f"{name}t{k}"] = [f"{name}e", f"{name}{k}"]
        pins = [label for label in nodes if not label.endswith("e")]
        stiffness = {"*": 100.0, "b*": 300.0}
        return solved(network_scene(nodes, rods, ties, pins, tendons={"stiffness": stiffness}, **sections))

    def test_unactuated(self):
        report = tc.controllability(self.two_masts(actuators={"tendons": ["at*"]})[2])
        assert len(report.controllable_modes) == 2
        for mode in report.uncontrollable_modes:
            assert report.modes[mode].reason.startswith("unactuated: it stretches only tendons without actuator (bt")

    def test_not_stretched_at_first_order(self):
        """A rod between two ties along x swings along y against their prestress, but stretches neither."""
        nodes = {"o": [0, 0, 0], "e": [0, 0, 1], "l": [-2, 0, 1], "r": [2, 0, 1]}
        scene = network_scene(nodes, {"rod": ["o", "e"]}, {"p": ["e", "l"], "q": ["e", "r"]}, ["o", "l", "r"])
        _, rest, linear = solved(scene)
        report = tc.controllability(linear)
        assert rest.stable
        assert [mode.kind for mode in report.modes] == ["flexible", "flexible"]
        assert report.controllable_modes == (1,)
        assert report.modes[0].reason.startswith("not stretched at first order")
        assert np.abs(linear.modes[0].shape[1]).argmax() == 1

    def test_symmetry(self):
        """One input reaches one of the two directions of each repeated frequency."""
        _, _, linear = solved(shell_scene(actuators={"tendons": ["t5_1_1"]}))
        report = tc.controllability(linear)
        pairs = [mode for mode in report.modes if mode.kind == "flexible" and mode.multiplicity == 2]
        assert sum(mode.verdict == "yes" for mode in pairs) == 8
        refused = [mode.reason for mode in pairs if mode.verdict == "no"]
        assert refused == ["symmetry: the inputs reach 1 of the 2 directions of this repeated frequency"] * 8

    def test_inputs_without_any_drive(self):
        """A slack actuated tendon drives nothing; no division by zero, no yes."""
        sections = {"tendons": {"rest_ratio": {"*": 0.8, "t5_1_1": 2.5}}, "actuators": {"tendons": ["t5_1_1"]}}
        report = tc.controllability(solved(shell_scene(pins=["P1_*_1"], **sections))[2])
        assert report.controllable_modes == ()
        assert all(mode.reason for mode in report.modes)


class TestObservability:
    def test_nodes_see_everything(self, free):
        report = tc.observability(free[2])
        assert report.observable_modes == tuple(range(30))
        assert report.unobservable_modes == ()

    def test_lengths_see_no_rigid_motion(self, free):
        dynamics, rest, _ = free
        linear = tc.linearize(dynamics, rest, outputs=("lengths",))
        report = tc.observability(linear)
        assert report.observable_modes == tuple(range(6, 30))
        assert all(mode.reason.endswith("lengths and tensions do not change") for mode in report.modes[:6])

    def test_is_the_dual(self, mast):
        """The system (A', C', B') drives with C' what (A, B, C) sees with C; brute force for one tension."""
        dynamics, rest, _ = mast
        linear = tc.linearize(dynamics, rest, outputs=("tensions",))
        one = linear.C[[linear.outputs.index("T_t5_1_1")]]
        for omega, size, _ in verdict_counts(linear, tc.controllability(linear)):
            assert by_brute_force(linear.A.T, one.T, omega, size) == size - 1
            assert by_brute_force(linear.A.T, linear.C.T, omega, size) == 0
        assert tc.observability(linear).unobservable_modes == ()

    def test_nothing_is_seen_without_outputs(self, mast):
        dynamics, rest, _ = mast
        report = tc.observability(tc.linearize(dynamics, rest, outputs=()))
        assert report.observable_modes == ()
        assert {mode.reason for mode in report.modes} == {"no output changes with this mode at first order"}


SCENES = {
    "free": shell_scene(),
    "pinned": shell_scene(pins=["P1_*_1"]),
    "EA": shell_scene(pins=["P1_*_1"], tendons={"EA": 150.0}),
    "weight": shell_scene(pins=["P1_*_1"], gravity={"g": 9.8}, tendons={"stiffness": 300.0}),
    "few actuators": prism_scene(actuators={"tendons": ["top*"]}),
}


@pytest.mark.parametrize("name", SCENES)
class TestStaticInfluence:
    STEPS = np.array([2e-2, 1e-2, 5e-3])

    def resettled(self, name, rng):
        scene = SCENES[name]
        rest = tc.find_equilibrium(scene)
        du = rng.uniform(-1, 1, rest.inputs.size)
        return rest, du, lambda h: tc.find_equilibrium(scene, start=rest.nodes, inputs=h * du)

    def test_lengths_of_resettled_structures(self, name, rng):
        """Tendon lengths are blind to rigid-body motion, so free structures compare too."""
        rest, du, again = self.resettled(name, rng)
        moved = (rest.point.tangent @ (static_influence(rest) @ du)).reshape(-1, 3)[rest.structure.tendons]
        ends = rest.nodes[rest.structure.tendons]
        growth = np.einsum("ti,ti->t", ends[:, 1] - ends[:, 0], moved[:, 1] - moved[:, 0]) / rest.lengths
        order = taylor_order(lambda h: again(h).lengths - rest.lengths - h * growth, self.STEPS)
        assert 1.9 < order < 2.15

    def test_tensions_of_resettled_structures(self, name, rng):
        rest, du, again = self.resettled(name, rng)
        growth = tension_influence(rest) @ du
        order = taylor_order(lambda h: again(h).tensions - rest.tensions - h * growth, self.STEPS)
        assert 1.9 < order < 2.15


def test_static_influence_of_the_reference_prism():
    """An independent code's d(nodes)/d(rest length), of which the first digits are certain to 6.7e-7."""
    with np.load(REFERENCE / "prism_pinned_linear.npz", allow_pickle=False) as data:
        wanted = data["static_influence_constk"], data["static_influence_constEA"]
    rest = tc.find_equilibrium(reference_prism(pins=["a", "b", "c"]))
    reach = (rest.point.tangent @ static_influence(rest)).reshape(6, 3, -1)[3:].reshape(9, -1)
    names = [rest.structure.tendon_labels[t] for t in rest.potential.members.inputs]
    assert names == [f"s{k}" for k in range(3, 9)]
    assert np.abs(-reach - wanted[0][:, 3:]).max() < 2e-6 * np.abs(wanted[0]).max()
    as_strain = reach * (rest.lengths / rest.rest_lengths)[3:]
    assert np.abs(-as_strain - wanted[1][:, 3:]).max() < 2e-6 * np.abs(wanted[1]).max()


class TestPrestressDirection:
    @pytest.mark.parametrize("name", ["free", "EA"])
    def test_tension_over_stiffness_moves_nothing(self, name):
        """At an unloaded equilibrium scaling all tensions alike keeps the balance: B (T / (dT/du)) = 0."""
        _, rest, linear = solved(SCENES[name])
        k = rest.potential.members.stiffness
        slope = k if name == "free" else k * rest.lengths / rest.rest_lengths**2
        drive = rest.point.input_map @ (rest.tensions / slope)
        assert np.abs(drive).max() < 1e-12 * rest.tensions.max()
        if name == "free":
            assert np.linalg.norm(linear.B @ (rest.tensions / slope)) < 1e-12 * np.linalg.norm(linear.B)

    def test_rank_of_the_free_shell(self, free):
        _, _, linear = free
        values = np.linalg.svd(linear.B, compute_uv=False)
        assert values.size == 24
        assert values[22] > 1e-2 * values[0]
        assert values[23] < 1e-13 * values[0]
