"""Joints in motion: references made by others, one statement of the physics against another, what must be kept."""

from dataclasses import replace

import numpy as np
import pytest
from support import REFERENCE, network_scene, random_motion, shell_scene

import tensctl as tc
from tensctl.model.joint_kernel import constrain, factor, solve
from tensctl.model.kernel import accelerations
from tensctl.simulation import momenta, total_energy


def pendulum(**sections):
    """Two rods of 1 m, pinned at the origin, both 45 degrees from -y, as the analytic reference has them."""
    u = np.array([np.sin(np.pi / 4), -np.cos(np.pi / 4), 0.0])
    nodes = {"o": [0, 0, 0], "a": u.tolist(), "b": (2 * u).tolist()}
    rods = {"r1": ["o", "a"], "r2": ["a", "b"]}
    return network_scene(nodes, rods, {}, ["o"], gravity={"g": [0, -9.8, 0]}, **sections)


def class_two(n=3, m=2, **sections):
    return shell_scene(n, m, cls=2, **sections)


class TestReference:
    def test_double_pendulum(self):
        """Two pinned rods against the closed-form equations of the angles."""
        with np.load(REFERENCE / "double_pendulum_analytic.npz", allow_pickle=False) as data:
            times, first, second = data["t"], data["P2"], data["P3"]
        dynamics = tc.build_dynamics(pendulum())
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=times)
        assert run.method == "dopri5"
        assert np.abs(run.nodes[:, 1, :2] - first).max() < 7.5e-11
        assert np.abs(run.nodes[:, 2, :2] - second).max() < 7.5e-11
        assert np.abs(run.nodes[:, :, 2]).max() == 0

    def test_d_bar(self):
        """Four rods in a closed loop with damped strings, as an independent integration to rounding has it."""
        with np.load(REFERENCE / "stedy_dbar.npz", allow_pickle=False) as data:
            nodes, rods, strings = data["N"].T, data["Cb"], data["Cs"]
            rest, k, c, mass = data["L0"], data["K"], data["damper"], data["mbar"]
            times, wanted, other = data["t"], data["y_dop853"], data["y_stedy"]
        ends = [np.column_stack([(C < 0).argmax(axis=1), (C > 0).argmax(axis=1)]) for C in (rods, strings)]
        structure = tc.network(nodes, *ends, pins=[0])
        labels = structure.tendon_labels
        tendons = {
            key: dict(zip(labels, values.tolist(), strict=True))
            for key, values in (("stiffness", k), ("rest_length", rest), ("damping", c))
        }
        masses = dict(zip(structure.rod_labels, mass.tolist(), strict=True))
        scene = tc.Scene(structure=structure, tendons=tendons, rods={"mass": masses})
        dynamics = replace(tc.build_dynamics(scene), clamped=False)
        run = tc.simulate(dynamics, nodes, timepts=times, tol=1e-12)
        found = run.nodes.reshape(len(times), -1)
        assert np.abs(found - wanted[:, :12]).max() < 2e-10
        assert np.abs(found - other[:, :12]).max() < 2.9e-9
        assert np.abs(run.velocities.reshape(len(times), -1) - wanted[:, 12:]).max() < 1e-8


SCENES = {
    "class 2": class_two(tendons={"damping": 1.0}),
    "base pinned": class_two(4, 2, pins=["P1_*_1"], gravity={"g": 9.8}, drag={"coefficient": 0.3}),
    "double pendulum": pendulum(),
}


@pytest.fixture(params=SCENES, ids=SCENES)
def moved(request):
    dynamics = tc.build_dynamics(SCENES[request.param])
    rng = np.random.default_rng(7)
    return dynamics, *random_motion(dynamics.potential, rng, reach=0.05)


def jointed_accelerations(dynamics, nodes, velocities):
    q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
    a, data = np.zeros_like(q), dynamics.kernel
    accelerations(data, q, v, dynamics.members.rest_lengths, dynamics.layout.spread(dynamics.members.forces), a)
    assert constrain(data, q, a, np.zeros(data.place[-1]), np.zeros(data.first.size))
    return q, v, a


class TestAccelerations:
    def test_kernel_and_casadi_agree(self, moved):
        dynamics, nodes, velocities = moved
        _, _, a = jointed_accelerations(dynamics, nodes, velocities)
        x = dynamics.pack(nodes, velocities)
        rate = np.asarray(dynamics.f(x, np.zeros(len(dynamics.members.inputs)), np.zeros(0))).ravel()
        assert np.abs(rate[x.size // 2 :] - a[dynamics.state_mask]).max() < 1e-12 * np.abs(a).max()

    def test_joints_stay_closed(self, moved):
        """Ends that share a node accelerate together."""
        dynamics, nodes, velocities = moved
        _, _, a = jointed_accelerations(dynamics, nodes, velocities)
        ends = np.stack([0.5 * (a[:, :3] - a[:, 3:]), 0.5 * (a[:, :3] + a[:, 3:])], axis=1).ravel()
        C = dynamics.constraints.matrix(2 * len(a))
        assert np.abs(C @ ends).max() < 1e-13 * np.abs(a).max()
        assert np.abs(a).max() > 1

    def test_newton_with_a_mass_matrix(self, moved):
        """The same motion from consistent masses of slender rods on shared nodes, rod lengths as constraints."""
        dynamics, nodes, velocities = moved
        structure, members = dynamics.structure, dynamics.members
        _, _, a = jointed_accelerations(dynamics, nodes, velocities)
        N, rods = len(nodes), structure.rods
        M, G, bias = np.zeros((N, N)), np.zeros((len(rods), 3 * N)), np.zeros(len(rods))
        for r, (i, j) in enumerate(rods):
            M[np.ix_([i, j], [i, j])] += members.mass[r] / 6 * np.array([[2, 1], [1, 2]])
            e, rate = nodes[j] - nodes[i], velocities[j] - velocities[i]
            G[r, 3 * j : 3 * j + 3], G[r, 3 * i : 3 * i + 3], bias[r] = e, -e, -rate @ rate
        forces = members.forces.copy()
        length = np.linalg.norm(nodes[structure.tendons[:, 1]] - nodes[structure.tendons[:, 0]], axis=1)
        for t, (i, j) in enumerate(structure.tendons):
            n = (nodes[j] - nodes[i]) / length[t]
            closing = n @ (velocities[j] - velocities[i])
            stretch = length[t] - members.rest_lengths[t]
            pull = max(0.0, members.stiffness[t] * stretch + dynamics.damping[t] * closing) if stretch > 0 else 0.0
            forces[i] += pull * n
            forces[j] -= pull * n
        for i, j in rods:
            forces[i] -= dynamics.drag * velocities[i]
            forces[j] -= dynamics.drag * velocities[j]
        free = np.repeat(~structure.pinned, 3)
        mass, none = np.kron(M, np.eye(3))[np.ix_(free, free)], np.zeros((len(rods), len(rods)))
        K = np.block([[mass, G[:, free].T], [G[:, free], none]])
        answer, *_ = np.linalg.lstsq(K, np.concatenate([forces.ravel()[free], bias]), rcond=1e-12)
        nodal = np.zeros(3 * N)
        nodal[free] = answer[: free.sum()]
        assert np.abs(dynamics.rod_coordinates(nodal.reshape(-1, 3)) - a).max() < 1e-10 * np.abs(a).max()

    def test_factor_within_its_profile(self, moved):
        dynamics, nodes, _ = moved
        data, q = dynamics.kernel, dynamics.rod_coordinates(nodes)
        values, x = np.zeros(data.place[-1]), np.random.default_rng(1).standard_normal(data.first.size)
        assert factor(data, q, values)
        y = x.copy()
        solve(data, values, y)
        S = np.zeros((x.size, x.size))
        for j in range(x.size):
            S[j, data.low[j] : j + 1] = values[data.place[j] : data.place[j + 1]]
        assert np.abs(S @ S.T @ y - x).max() < 1e-11 * np.abs(x).max()


class TestMotion:
    def test_energy_and_momenta_are_kept(self):
        """A class 2 shell released from the cylinder, its tendons going slack and taut."""
        dynamics = tc.build_dynamics(class_two())
        nodes = dynamics.structure.nodes
        velocities = np.array([0.3, -0.2, 0.5]) + np.cross([0.5, 1.0, -0.7], nodes)
        run = tc.simulate(dynamics, (nodes, velocities), t_end=1.0)
        energy = total_energy(dynamics, run)
        linear, angular = momenta(dynamics, run)
        assert np.abs(energy / energy[0] - 1).max() < 1e-8
        assert np.abs(linear - linear[0]).max() < 1e-9 * np.abs(linear).max()
        assert np.abs(angular - angular[0]).max() < 1e-9 * np.abs(angular).max()
        assert run.rod_drift < 1e-14
        assert np.abs(run.nodes[-1] - nodes - velocities).max() > 0.1

    def test_equilibrium_stays(self):
        scene = class_two(pins=["P1_*_1"])
        rest = tc.find_equilibrium(scene)
        run = tc.simulate(tc.build_dynamics(scene), rest, t_end=1.0)
        assert np.abs(run.nodes - rest.nodes).max() < 1e-10

    def test_small_motion_swings_at_the_modes_frequency(self):
        scene = class_two(pins=["P1_*_1"])
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        linear = tc.linearize(dynamics, rest)
        mode = next(m for m in linear.modes if m.kind == "flexible" and m.multiplicity == 1)
        start = rest.potential.manifold.retract(rest.nodes, 1e-5 * rest.spectrum.shapes[:, mode.index])
        run = tc.simulate(dynamics, start, timepts=[0.0, 0.5 / mode.frequency, 1 / mode.frequency])
        moved = start - rest.nodes
        assert np.abs(run.nodes[1] - rest.nodes + moved).max() < 2e-4 * np.abs(moved).max()
        assert np.abs(run.nodes[2] - start).max() < 2e-4 * np.abs(moved).max()

    def test_loops_of_rods_move_as_one_body(self):
        """A triangle of rods (joints redundant by their lengths) spins freely about its mass centre."""
        nodes = {"a": [0, 0, 0], "b": [1, 0, 0], "c": [0.2, 0.9, 0.3]}
        rods = {"ab": ["a", "b"], "bc": ["b", "c"], "ca": ["c", "a"]}
        dynamics = tc.build_dynamics(network_scene(nodes, rods, {}))
        p = dynamics.structure.nodes
        run = tc.simulate(dynamics, (p, np.cross([0.0, 0.0, 3.0], p - p.mean(axis=0))), t_end=1.0)
        side = np.linalg.norm(run.nodes - np.roll(run.nodes, 1, axis=1), axis=2)
        assert np.abs(side - side[0]).max() < 1e-13
        _, angular = momenta(dynamics, run)
        assert np.abs(angular - angular[0]).max() < 1e-10

    def test_rod_forces_balance_every_node(self):
        """At rest the rods' axial forces, joint by joint, hold the tendons' pull."""
        scene = class_two(pins=["P1_*_1"])
        rest = tc.find_equilibrium(scene)
        dynamics = tc.build_dynamics(scene)
        sanity = tc.inspect_run(dynamics, tc.simulate(dynamics, rest, t_end=0.1))
        forces = sanity.forces.largest
        assert np.abs(forces - rest.rod_forces).max() < 1e-8 * np.abs(rest.rod_forces).max()

    def test_splittings_are_refused(self):
        dynamics = tc.build_dynamics(pendulum())
        with pytest.raises(tc.SimulationError, match="moves rods that share no node and no guide; use dopri5"):
            tc.simulate(dynamics, dynamics.structure.nodes, t_end=1.0, method="splitting6")

    def test_explain_counts_the_multipliers(self):
        text = str(tc.build_dynamics(class_two()).explain())
        assert "18 rows tie rod ends" in text
