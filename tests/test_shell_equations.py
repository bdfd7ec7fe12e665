"""[S]'s equations of motion against the project's own model, Newton and Euler, and equilibria."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import network_scene, pendulum_scene, prism_scene, random_motion, shell_scene

import tensctl as tc
import tensctl.model.shell_equations as se
from tensctl.errors import StructureError
from tensctl.structure import build_members

SIZES = [(3, 1, False), (3, 1, True), (4, 2, False), (4, 2, True), (5, 3, True), (8, 4, False), (8, 4, True)]
UNEQUAL = {
    "rods": {"mass": {"*": 1.0, "r2_*": 2.5}},
    "tendons": {"stiffness": {"*": 100.0, "t5_*": 250.0, "t1_2_*": 170.0}, "rest_ratio": {"*": 0.9, "t3_*": 1.1}},
    "gravity": {"g": 9.8},
    "loads": {"P4_2_1": [1.0, 2.0, 3.0], "P1_1_1": [5.0, 0.0, 0.0]},
}


class Case:
    """A shell with a random state far from rest: rods rigid, some tendons slack, inputs and pushes."""

    def __init__(self, n, m, primal, seed=0):
        push = {"t_end": 1.0, "push": [{"node": "P*", "force": [1, 0, 0], "from": 0, "to": 1}]}
        scene = shell_scene(n, m, primal=primal, **UNEQUAL, simulation=push)
        self.dynamics, self.equations = tc.build_dynamics(scene), se.ShellEquations.of(scene)
        rng, members = np.random.default_rng(seed), self.dynamics.members
        self.nodes, self.velocities = random_motion(self.dynamics.potential, rng, reach=0.3, speed=2.0)
        self.q, self.v = se.q_of(self.nodes), se.q_of(self.velocities)
        self.by_tendon = 0.3 * rng.uniform(-1, 1, len(members.rest_lengths)) * members.rest_lengths
        self.u = self.equations.inputs(self.by_tendon)
        self.push = 10 * rng.standard_normal(self.q.size)
        self.w = self.push + self.equations.loads
        self.lengths = np.linalg.norm(se.q_of(self.nodes).reshape(-1, 2, 3)[:, 1], axis=1)

    @property
    def x(self):
        return self.dynamics.pack(self.nodes, self.velocities)

    def by_casadi(self):
        return np.asarray(self.dynamics.f(self.x, self.by_tendon, self.push)).ravel()[self.q.size :]

    def by_kernel(self):
        from tensctl.model.kernel import accelerations

        d, found = self.dynamics, np.zeros((len(self.lengths), 6))
        rest, force = d.members.rest_lengths - self.by_tendon, self.w.reshape(-1, 3)
        q, v = d.rod_coordinates(self.nodes), d.rod_coordinates(self.velocities)
        accelerations(d.kernel, q, v, rest, force, found)
        return found.ravel()


@pytest.fixture(scope="module", params=SIZES, ids=str)
def case(request):
    return Case(*request.param)


def largest(x):
    return np.abs(x).max()


class TestMotion:
    """(5.21)."""

    def test_equal_to_the_symbolic_model(self, case):
        wanted = case.by_casadi()
        found = case.equations.acceleration(case.q, case.v, case.u, case.w)
        assert largest(found - wanted) < 1e-13 * largest(wanted)

    def test_equal_to_the_kernel(self, case):
        wanted = case.by_kernel()
        found = case.equations.acceleration(case.q, case.v, case.u, case.w)
        assert largest(found - wanted) < 1e-13 * largest(wanted)

    def test_some_tendons_are_slack_and_some_are_not(self, case):
        tensions = case.equations.y_f(case.q, case.u)
        assert 0.05 < (tensions == 0).mean() < 0.95

    def test_newton_and_euler(self, case):
        """(3.2), (3.3), with the rods' own lengths."""
        e = case.equations
        a, f = e.acceleration(case.q, case.v, case.u, case.w), e.nodal_forces(case.q, case.u, case.w)
        left = se.newton_euler_residual(case.q, case.v, a, f, e.mass)
        assert largest(left["translation"]) < 1e-13 * largest(f)
        assert largest(left["rotation"]) < 1e-13 * largest(f)
        assert largest(left["length"]) < 1e-13 * largest(a)

    def test_the_terms_add_up_to_the_nodal_forces(self, case):
        """H f of (3.4) is -K_p q + B u + D w of (5.21)."""
        e = case.equations
        f = e.nodal_forces(case.q, case.u, case.w)
        assert largest(e.H(case.q) @ f + e.static_residual(case.q, case.u, case.w)) < 1e-12 * largest(e.H(case.q) @ f)

    def test_the_input_matrix_is_the_derivative_by_u(self, case):
        """With slack tendons staying slack, q'' is linear in u, with slope B."""
        e, step = case.equations, 1e-3
        margin = np.abs(e.y_l(case.q) - (e.inputs(case.dynamics.members.rest_lengths) - case.u))
        change = step * np.where(margin > 2 * step, 1.0, 0.0)
        there = e.acceleration(case.q, case.v, case.u + change, case.w)
        here = e.acceleration(case.q, case.v, case.u, case.w)
        assert largest(there - here - e.B(case.q, case.u) @ change) < 1e-12 * largest(here)

    def test_shapes(self, case):
        e = case.equations
        shapes = se.dimensions(e.n, e.m, primal=e.primal)
        d, o = e.forces_d(case.q, case.u), e.forces_0(case.q, case.u)
        matrices = {
            "H": e.H(case.q),
            "K_r": e.K_r(case.q, case.v),
            "K_p": e.K_p(case.q, case.u),
            "B": e.B(case.q, case.u),
            "D": e.D(case.q),
            "K~": e.K_tilde(case.q, case.u),
            "B~": e.B_tilde(case.q, case.u),
            "K^d": d.K,
            "P^d": d.P,
            "K^0": o.K,
            "P^0": o.P,
        }
        assert {name: matrix.shape for name, matrix in matrices.items()} == {name: shapes[name] for name in matrices}


class TestLengthOfRods:
    def test_nominal_and_actual_lengths_agree_on_the_manifold(self, case):
        e = case.equations
        one = e.acceleration(case.q, case.v, case.u, case.w)
        other = e.acceleration(case.q, case.v, case.u, case.w, lengths=case.lengths)
        assert largest(one - other) < 1e-13 * largest(one)

    def test_a_length_error_turns_nominal_rods_twice_too_fast(self, case):
        """At |q2| = (1 + eps) L the torque term of [S] is (1 + eps)^2 times the actual one."""
        e, eps = case.equations, 1e-4
        q = case.q.copy().reshape(-1, 2, 3)
        q[:, 1] *= 1 + eps
        q, rest = q.ravel(), np.zeros_like(case.v)
        actual = e.acceleration(q, rest, case.u, case.w).reshape(-1, 2, 3)
        nominal = e.acceleration(q, rest, case.u, case.w, lengths=case.lengths).reshape(-1, 2, 3)
        assert largest(nominal[:, 1] - (1 + eps) ** 2 * actual[:, 1]) < 1e-12 * largest(actual)
        assert largest(nominal[:, 1] - actual[:, 1]) > 1e-4 * largest(actual[:, 1])
        assert largest(nominal[:, 0] - actual[:, 0]) == 0


class TestOutputs:
    """(5.22) and after it."""

    def test_nodes(self, case):
        e, chosen = case.equations, np.eye(case.q.size)[3:6]
        assert largest(e.y_p(case.q) - case.nodes.ravel()) < 1e-14
        assert largest(e.y_p(case.q, chosen) - case.nodes[1]) < 1e-14

    def test_lengths_and_tensions(self, case):
        e, d = case.equations, case.dynamics
        lengths, tensions = np.asarray(d.y_l(case.x)).ravel(), np.asarray(d.y_f(case.x, case.by_tendon)).ravel()
        assert largest(e.y_l(case.q) - e.inputs(lengths)) < 1e-14
        assert largest(e.y_f(case.q, case.u) - e.inputs(tensions)) < 1e-12 * largest(tensions)

    def test_labels_are_those_of_the_structure(self, case):
        labels = np.array(case.dynamics.structure.tendon_labels)
        assert case.equations.input_labels == tuple(case.equations.inputs(labels))


class TestTendonForces:
    """(5.1)-(5.12)."""

    def test_force_is_linear_in_q_and_u(self, case):
        """F t/|t| of (5.1) is -K q + b u of (5.5), slack tendons included."""
        e = case.equations
        count, expanded = 8 * e.n * e.m + 1, e.T @ case.u
        for forces, u in ((e.forces_d, expanded[:count]), (e.forces_0, expanded[count:])):
            found = forces(case.q, case.u)
            pull = (found.tensions(u) / found.lengths)[:, None] * found.t
            assert largest(found.P @ u - found.K @ case.q - pull.ravel()) < 1e-12 * largest(pull)
            assert not found.K[np.repeat(~found.taut, 3)].count_nonzero()
            assert not found.P[:, ~found.taut].count_nonzero()
            assert (found.tensions(u) >= 0).all()


def test_a_tendon_of_no_length_does_no_harm():
    """Nodes in one place: finite matrices, slack tendon."""
    e = se.ShellEquations.of(shell_scene())
    nodes = np.round(64 * tc.shell(3, 1).nodes) / 64
    nodes[3] = nodes[1]
    q, none = se.q_of(nodes), np.zeros(24)
    assert (e.y_l(q) == 0).sum() == 1
    assert np.isfinite(e.static_residual(q, none, np.zeros(36))).all()


EQUILIBRIA = {
    "(3,1)": shell_scene(),
    "(4,2)": shell_scene(4, 2),
    "(4,2) primal": shell_scene(4, 2, primal=True),
    "(3,1) under load": shell_scene(loads={"P4_1_1": [1.0, 0.0, -1.0], "P1_1_1": [-1.0, 0.0, 1.0]}),
}


@pytest.mark.parametrize("name", EQUILIBRIA)
def test_equilibria_solve_the_static_equations(name):
    """(5.23), with and without a load, against the size of its terms."""
    scene = EQUILIBRIA[name]
    found, e = tc.find_equilibrium(scene), se.ShellEquations.of(scene)
    q, u = se.q_of(found.nodes), np.zeros(len(found.tensions))
    size = largest(e.K_p(q, u) @ q) if e.loads.any() else largest(e.H(q).diagonal()) * found.tensions.max()
    assert largest(e.static_residual(q, u, e.loads)) < 1e-10 * size
    start = se.q_of(tc.build_dynamics(scene).structure.nodes)
    assert largest(e.static_residual(start, u, e.loads)) > 1e-2 * size


def test_inputs_that_rest_elsewhere_are_one_input_too(rng):
    """Rest lengths changed in the scene, or by u: the same accelerations."""
    scene = shell_scene(4, 2)
    e, members = se.ShellEquations.of(scene), tc.build_dynamics(scene).members
    by_tendon = 0.1 * rng.uniform(-1, 1, len(members.rest_lengths))
    rest = dict(zip(tc.shell(4, 2).tendon_labels, (members.rest_lengths - by_tendon).tolist(), strict=True))
    changed = se.ShellEquations.of(shell_scene(4, 2, tendons={"rest_length": rest}))
    q, zero = se.q_of(tc.shell(4, 2).nodes), np.zeros(by_tendon.size)
    still, w = np.zeros_like(q), np.zeros_like(q)
    one, other = e.acceleration(q, still, e.inputs(by_tendon), w), changed.acceleration(q, still, zero, w)
    assert largest(one - other) < 1e-12 * largest(one)


def test_a_large_shell_stays_sparse():
    """(50,40): 24 000 coordinates and 19 900 inputs; nonzeros grow no faster than the elements, four times as many."""
    counts = []
    for n, m in ((25, 20), (50, 40)):
        scene = shell_scene(n, m)
        e, q = se.ShellEquations.of(scene), se.q_of(tc.shell(n, m).nodes)
        u = e.inputs(0.9 * build_members(scene, tc.shell(n, m)).rest_lengths)
        assert (e.y_f(q, u) > 0).all()
        counts.append([matrix.nnz for matrix in (e.K_p(q, u), e.B(q, u), e.D(q))])
    assert e.B(q, u).shape == (24_000, 19_900)
    growth = np.array(counts[1]) / np.array(counts[0])
    assert (growth < 4.1).all()


class TestScenes:
    def test_nodes_of_a_shell_given_one_by_one(self):
        moved = tc.shell(4, 2, primal=True, radius=2.0)
        e = se.ShellEquations.of(tc.Scene(structure=moved))
        assert (e.n, e.m, e.primal) == (4, 2, True)

    @pytest.mark.parametrize(
        ("scene", "why"),
        [
            (prism_scene(), "no Class 1 shell"),
            (pendulum_scene(), "no Class 1 shell"),
            (shell_scene(3, 2, cls=2), "no Class 1 shell"),
            (shell_scene(pins=["P1_*_1"]), "has pins"),
            (shell_scene(tendons={"EA": 100.0}), "have EA"),
            (shell_scene(tendons={"damping": 1.0}), "damped"),
            (shell_scene(drag={"coefficient": 1.0}), "damped"),
            (shell_scene(drag={"coefficient": {"ratio": 1.0}}), "damped"),
        ],
        ids=["prism", "network", "class 2", "pins", "EA", "damping", "drag", "ratio"],
    )
    def test_what_the_equations_do_not_cover_is_refused(self, scene, why):
        with pytest.raises(StructureError, match=why):
            se.ShellEquations.of(scene)


def test_the_model_does_not_load_the_equations():
    look = "import sys, tensctl.model; print(any('shell_equations' in name for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_public_names_exist_and_are_listed():
    listed = set(se.__all__)
    assert all(hasattr(se, name) for name in listed)
    found = {name for name, thing in vars(se).items() if not name.startswith("_") and callable(thing)}
    assert found <= listed


class TestPlanarExamples:
    """Appendix A, Examples 1 and 2."""

    def test_one_rod(self, rng):
        """Against H and K_r in space, for forces in the plane."""
        q1, f1, f2, v1 = rng.standard_normal((4, 2))
        mass, length, angle, spin = 1.7, 1.3, 0.6, 2.0
        q2 = length * np.array([np.cos(angle), np.sin(angle)])
        v2 = spin * np.array([-q2[1], q2[0]])
        q, v = np.r_[q1, 0, q2, 0], np.r_[v1, 0, v2, 0]
        f = np.r_[f1 + f2, 0, f1 - f2, 0]
        wanted = se.H_matrix(q, [mass]) @ f - se.K_r_matrix(q, v) @ q
        found = se.example1(np.r_[q1, q2], np.r_[v1, v2], f1, f2, mass, length)
        assert largest(found - wanted[[0, 1, 3, 4]]) < 1e-13 * largest(wanted)
        assert wanted[2] == wanted[5] == 0

    def test_one_rod_keeps_its_length(self):
        """The printed |q2|^2/L^2 for |q2'|^2/L^2 would pull a rod at rest together: with it |q2| q2'' = -q2."""
        at_rest = se.example1(np.array([0.0, 0, 1, 0]), np.zeros(4), np.zeros(2), np.zeros(2), 1.0, 1.0)
        assert largest(at_rest) == 0

    @pytest.mark.parametrize("seed", range(3))
    def test_two_rods_and_four_tendons(self, seed):
        """Against the project's model of the same network in space, everything at z = 0."""
        scene, planar, q, v, u, w = planar_case(seed)
        dynamics = tc.build_dynamics(scene)
        space = [np.zeros((4, 3)) for _ in range(3)]
        pairs = zip(space, (q, v, w), (NODES_FROM_Q, NODES_FROM_Q, None), strict=True)
        for array, vector, table in pairs:
            flat = vector.reshape(4, 2)
            array[:, :2] = flat if table is None else table @ flat
        nodes, velocities, pushes = space
        rates = np.asarray(dynamics.f(dynamics.pack(nodes, velocities), u, pushes.ravel())).ravel()[12:]
        rates = rates.reshape(4, 3)
        found = planar.acceleration(q, v, u, w).reshape(4, 2)
        assert largest(found - rates[:, :2]) < 1e-13 * largest(found)
        assert largest(rates[:, 2]) == 0

    def test_constant_matrices(self, rng):
        """(A.20)-(A.22) as printed: q = Q l^0, l^d = R q, and R Q."""
        planar = planar_case(0)[1]
        p = rng.standard_normal((4, 2))
        l_0 = np.concatenate([p[0], p[1] - p[0], p[3] - p[2], p[3] - p[1]])
        l_d = np.concatenate([p[1] - p[2], p[0] - p[2], p[3] - p[0]])
        q = np.concatenate([p[0] + p[1], p[1] - p[0], p[2] + p[3], p[3] - p[2]])
        assert largest(planar.Q @ l_0 - q) < 1e-14
        assert largest(planar.Q_inverse @ planar.Q - np.eye(8)) == 0
        assert largest(planar.R @ q - l_d) < 1e-14
        printed = np.array([[0, 0, 1, -1], [0, -1, 1, -1], [0, 1, 0, 1]])
        assert (np.kron(printed, np.eye(2)) == planar.R @ planar.Q).all()
        assert (np.kron([[1], [-1], [-1], [1]], np.eye(2)) == planar.B0).all()
        assert (planar.Bd == np.kron([[-1, -1, 1], [1, -1, 1], [1, 1, -1], [1, 1, 1]], np.eye(2))).all()
        assert (np.kron([[1, 1, -1, 1], [1, -1, -1, 1], [-1, 1, 1, 1]], np.eye(2)) == 2 * planar.R).all()


NODES_FROM_Q = np.array([[1, -1, 0, 0], [1, 1, 0, 0], [0, 0, 1, -1], [0, 0, 1, 1]]) / 2


def planar_case(seed):
    """A planar tensegrity as a scene and as Example 2, with a random state in which a tendon is slack."""
    rng = np.random.default_rng(seed)
    p = np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]) + 0.2 * rng.standard_normal((4, 2))
    ends = {"t1": (2, 1), "t2": (2, 0), "t3": (0, 3), "t5": (1, 3)}
    k, rest = rng.uniform(50, 150, 4), 0.7 * np.array([np.linalg.norm(p[b] - p[a]) for a, b in ends.values()])
    names = ["P1", "P2", "P3", "P4"]
    mass = np.array([1.0, 2.5])
    scene = network_scene(
        {name: [*point, 0.0] for name, point in zip(names, p.tolist(), strict=True)},
        {"r1": ["P1", "P2"], "r2": ["P3", "P4"]},
        {label: [names[a], names[b]] for label, (a, b) in ends.items()},
        rods={"mass": {"r1": 1.0, "r2": 2.5}},
        tendons={
            "stiffness": dict(zip(ends, k.tolist(), strict=True)),
            "rest_length": dict(zip(ends, rest.tolist(), strict=True)),
        },
        simulation={"t_end": 1.0, "push": [{"node": "*", "force": [1, 0, 0], "from": 0, "to": 1}]},
    )
    q = np.concatenate([p[0] + p[1], p[1] - p[0], p[2] + p[3], p[3] - p[2]])
    spins, v = rng.standard_normal(2), rng.standard_normal(8)
    for at, spin in zip((2, 6), spins, strict=True):
        v[at : at + 2] = spin * np.array([-q[at + 1], q[at]])
    u = np.array([0.1, -0.1, 0.05, -10.0])
    return scene, se.PlanarTensegrity(mass, k, rest), q, v, u, rng.standard_normal(8)


def test_appendix_d():
    """Every size that [S] prints for (3, 1)."""
    s = se.dimensions(3, 1)
    assert s["Q"] == s["K_r"] == s["H"] == s["K_p"] == s["D"] == s["W^0"] == (36, 36)
    assert (s["B^d"], s["K^d"]) == ((36, 75), (75, 36))
    assert (s["B^0"], s["K^0"]) == ((36, 18), (18, 36))
    assert s["R"] == (75, 36)
    assert s["P^d"] == (75, 25)
    assert s["P^0"] == (18, 6)
    assert (s["B~"], s["T"], s["B"]) == ((36, 31), (31, 24), (36, 24))


def test_code_of_the_page_runs(capsys):
    page = Path(__file__).parent.parent / "docs" / "shell_equations.md"
    [block] = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    exec(compile(block, str(page), "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    assert float(printed[0]) < 1e-9
    assert printed[1] == "(96,) (96, 96) (96, 72) (96, 96)"


def test_the_page_names_every_public_function():
    page = (Path(__file__).parent.parent / "docs" / "shell_equations.md").read_text(encoding="utf-8")
    # Orders and their record, and a view of Q^-1's rows, go with the functions that are named.
    unnamed = {name for name in se.__all__ if name not in page and not re.fullmatch(r"B_[2-7]", name)}
    assert unnamed == {"Member", "dependent_members", "independent_members", "independent_rows"}
