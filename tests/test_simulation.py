"""Runs are what mechanics says: reference trajectories, orders, conservation, exact special motions, exact inputs."""

import numpy as np
import pytest
from support import (
    MIXED_PINS,
    REFERENCE,
    order_of,
    pendulum_scene,
    prism_scene,
    replaced,
    shell_scene,
    solved,
)

import tensctl as tc
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators.splitting import Splitting

DAMPED = {"damping": 2.0}


def kinetic(dynamics, velocities):
    """m (|a|^2 + a.b + |b|^2)/6 of every rod with end velocities a and b."""
    a, b = velocities[..., dynamics.structure.rods[:, 0], :], velocities[..., dynamics.structure.rods[:, 1], :]
    return (dynamics.members.mass / 6 * (a * a + a * b + b * b).sum(axis=-1)).sum(axis=-1)


def energies(dynamics, run):
    """Kinetic, elastic and load energy at each recorded time, written out again."""
    stretch = np.maximum(run.lengths - run.rest_lengths, 0)
    k, forces = dynamics.members.stiffness, dynamics.members.forces
    density = k / 2 if dynamics.members.law == "k" else k / (2 * run.rest_lengths)
    work = (forces * (run.nodes - dynamics.structure.nodes)).sum(axis=(1, 2))
    return kinetic(dynamics, run.velocities) + (density * stretch**2).sum(axis=1) - work


def momenta(dynamics, run):
    """Momentum and moment of momentum about the origin, from the uniform rods' end velocities."""
    rods, m = dynamics.structure.rods, dynamics.members.mass[None, :, None]
    a, b = run.nodes[:, rods[:, 0]], run.nodes[:, rods[:, 1]]
    u, v = run.velocities[:, rods[:, 0]], run.velocities[:, rods[:, 1]]
    linear = (m * (u + v) / 2).sum(axis=1)
    angular = (m * (np.cross(a, u) / 3 + np.cross(a, v) / 6 + np.cross(b, u) / 6 + np.cross(b, v) / 3)).sum(axis=1)
    return linear, angular


def mass_centre(dynamics, nodes):
    middles = nodes[..., dynamics.structure.rods, :].mean(axis=-2)
    return np.einsum("r,...ri->...i", dynamics.members.mass, middles) / dynamics.members.mass.sum()


class Command:
    """A controller that asks for a given function of time."""

    def __init__(self, u, dt=0.1):
        self.u, self.dt, self.times = u, dt, []

    def step(self, t, measurement):
        self.times.append(t)
        return self.u(t)

    def reset(self):
        self.times = []


class TestReference:
    def test_shells(self, reference, reference_scene):
        """An independent code's trajectory with slack-taut switching, to 1e-9 m with default settings."""
        dynamics = tc.build_dynamics(reference_scene)
        times = np.array(reference["trajectory"]["t_s"])
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=times)
        assert run.method == "splitting6"
        assert (run.time == times).all()
        assert np.abs(run.nodes - reference["trajectory"]["nodes_m"]).max() < 1e-9
        assert run.switches > 0

    def test_shells_by_the_other_integrator(self, reference, reference_scene):
        dynamics = tc.build_dynamics(reference_scene)
        times = np.array(reference["trajectory"]["t_s"])
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=times, method="dopri5")
        assert np.abs(run.nodes - reference["trajectory"]["nodes_m"]).max() < 1e-8

    def test_prism(self):
        """STEDY's free prism, as an independent integration to rounding has it: damping-free, unequal rest lengths."""
        with np.load(REFERENCE / "prism_free.npz", allow_pickle=False) as data:
            nodes, rods, strings = data["N"].T, data["Cb"], data["Cs"]
            rest, k, times, wanted = data["L0"], data["K"], data["t"], data["y_dop853"]
            first = data["Nd"].T
        ends = [np.column_stack([(C < 0).argmax(axis=1), (C > 0).argmax(axis=1)]) for C in (rods, strings)]
        structure = tc.network(nodes, *ends)
        labels = structure.tendon_labels
        scene = tc.Scene(
            structure=structure,
            tendons={
                "stiffness": dict(zip(labels, k.tolist(), strict=True)),
                "rest_length": dict(zip(labels, rest.tolist(), strict=True)),
            },
        )
        run = tc.simulate(tc.build_dynamics(scene), (nodes, first), timepts=times)
        assert np.abs(run.nodes.reshape(len(times), -1) - wanted[:, :18]).max() < 1e-9
        assert np.abs(run.velocities.reshape(len(times), -1) - wanted[:, 18:36]).max() < 1e-8

    def test_two_stages_with_dampers_that_may_push(self):
        """STEDY's pinned mast under weight, damped, going slack: its law lets a taut damper push, ours clamps it."""
        with np.load(REFERENCE / "twostage_pinned.npz", allow_pickle=False) as data:
            nodes, first, times, size = data["N"].T, data["Nd"].T, data["t"], data["N"].size
            ends = [np.column_stack([(C < 0).argmax(axis=1), (C > 0).argmax(axis=1)]) for C in (data["Cb"], data["Cs"])]
            by_tendon = {"stiffness": data["K"], "rest_length": data["L0"], "damping": data["damper"]}
            mass, g, pins = data["mbar"], data["g"], np.flatnonzero(data["fixed"].all(axis=0))
            wanted, other = data["y_dop853"], data["y_stedy"]
        structure = tc.network(nodes, *ends, pins=pins.tolist())
        labels = structure.tendon_labels
        scene = tc.Scene(
            structure=structure,
            rods={"mass": dict(zip(structure.rod_labels, mass.tolist(), strict=True))},
            tendons={key: dict(zip(labels, values.tolist(), strict=True)) for key, values in by_tendon.items()},
            gravity={"g": g.tolist()},
        )
        dynamics = tc.build_dynamics(scene)
        run = tc.simulate(replaced(dynamics, clamped=False), (nodes, first), timepts=times, tol=1e-12)
        assert (run.tensions == 0).any()
        assert np.abs(run.nodes.reshape(len(times), -1) - wanted[:, :size]).max() < 1e-10
        assert np.abs(run.nodes.reshape(len(times), -1) - other[:, :size]).max() < 1.4e-8
        assert np.abs(run.velocities.reshape(len(times), -1) - wanted[:, size : 2 * size]).max() < 1e-9
        clamped = tc.simulate(dynamics, (nodes, first), timepts=times)
        assert 1e-5 < np.abs(clamped.nodes - run.nodes).max() < 1e-3

    def test_physical_pendulum_in_closed_form(self):
        """A rod of length 2 on a pin under gravity: its period from the complete elliptic integral."""
        import scipy.special

        swing = 1.9
        hanging = (2 * np.sin(swing), 0.0, -2 * np.cos(swing))
        scene = pendulum_scene(hanging, tendons={"rest_length": 100.0}, gravity={"g": 9.8})
        dynamics = tc.build_dynamics(scene)
        omega = np.sqrt(3 * 9.8 / (2 * 2.0))
        period = 4 * scipy.special.ellipk(np.sin(swing / 2) ** 2) / omega
        times = np.linspace(0, period, 9)
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=times)
        k = np.sin(swing / 2)
        sn = scipy.special.ellipj(omega * times + scipy.special.ellipk(k**2), k**2)[0]
        angle = np.arctan2(run.nodes[:, 1, 0], -run.nodes[:, 1, 2])
        assert np.abs(angle - 2 * np.arcsin(k * sn)).max() < 1e-9


def taut_motion(**sections):
    """A shell, free unless pins are given, tight enough to stay taut, in motion."""
    dynamics, rest, _ = solved(shell_scene(tendons={"rest_ratio": 0.5} | sections.pop("tendons", {}), **sections))
    rng = np.random.default_rng(5)
    velocities = (rest.point.tangent @ (0.3 * rng.standard_normal(rest.potential.manifold.size))).reshape(-1, 3)
    return dynamics, (rest.nodes, velocities)


TAUT = {"k": {}, "EA": {"tendons": {"EA": 100.0}}, "weight": {"pins": ["P1_*_1"], "gravity": {"g": 9.8}}}


ORDERS = {2: [40, 60, 90, 140], 4: [20, 30, 45, 70], 6: [12, 16, 22, 30]}


def steps_of(order, dynamics, start, steps, drive=None, t_end=0.5):
    """End of a run in equal steps, no tendon changing over."""
    q, v = dynamics.rod_coordinates(start[0]), dynamics.rod_coordinates(start[1])
    plant = Splitting(dynamics, order, t_end / steps)
    drive = Drive.constant(dynamics.members.rest_lengths, dynamics.members.forces) if drive is None else drive
    plant.march(q, v, np.array([0.0, t_end]), drive, *(np.empty((2, *q.shape)) for _ in range(2)))
    assert plant.switches == 0
    return np.hstack([q, v])


def assert_order(order, dynamics, start, drive=None):
    exact, counts = steps_of(6, dynamics, start, 400, drive), np.array(ORDERS[order])
    errors = [np.abs(steps_of(order, dynamics, start, n, drive) - exact).max() for n in counts]
    assert order - 0.3 < order_of(0.5 / counts, errors) < order + 0.6


class TestOrder:
    @pytest.mark.parametrize("order", ORDERS)
    @pytest.mark.parametrize("sections", TAUT.values(), ids=TAUT)
    def test_splittings_have_their_order(self, sections, order):
        assert_order(order, *taut_motion(**sections))

    @pytest.mark.parametrize("order", ORDERS)
    def test_inputs_that_change_keep_the_order(self, order):
        """Rest lengths that ramp and lag, loads that grow and swing."""
        dynamics, start = taut_motion()
        rest, forces = dynamics.members.rest_lengths, dynamics.members.forces
        share = np.linspace(-1, 1, rest.size)
        drive = Drive.constant(rest, forces)._replace(
            rate=0.2 * rest * share, lag=0.1 * rest * share[::-1], tau=0.3,
            force_rate=np.full_like(forces, 2.0), wave_node=np.array([1, 5]),
            wave_force=np.array([[3.0, 0, 1.0], [0, 2.0, 0]]), wave_omega=np.array([7.0, 9.0]),
            wave_phase=np.array([0.3, 1.0]), ramped=True, swept=True,
        )  # fmt: skip
        assert_order(order, dynamics, start, drive)

    def test_dopri5_error_is_proportional_to_tol(self):
        dynamics, start = taut_motion(tendons=DAMPED)

        def end(tol):
            return tc.simulate(dynamics, start, timepts=[0.0, 0.5], tol=tol).nodes[-1]

        exact, tols = end(1e-13), np.array([1e-5, 1e-6, 1e-7, 1e-8, 1e-9])
        errors = [np.abs(end(tol) - exact).max() for tol in tols]
        assert 0.8 < order_of(tols, errors) < 1.3
        assert (np.array(errors) < tols).all()

    def test_dopri5_table(self):
        """Order conditions of the tree types up to order 5 for the bushy and tall trees, and an embedded order 4."""
        from tensctl.simulation.integrators.dormand_prince import ERROR, NODES, A

        b, c = np.append(A[-1], 0), NODES
        full = np.hstack([A, np.zeros((7, 1))])
        assert np.abs(full.sum(axis=1) - c).max() < 1e-15
        for power in range(5):
            assert b @ c**power == pytest.approx(1 / (power + 1), abs=1e-15)
        assert b @ full @ c**3 == pytest.approx(1 / 20, abs=1e-15)
        assert b @ full @ full @ c**2 == pytest.approx(1 / 60, abs=1e-15)
        assert b @ full @ full @ full @ c == pytest.approx(1 / 120, abs=1e-15)
        for power in range(4):
            assert ERROR @ c**power == pytest.approx(0, abs=1e-15)
        assert abs(ERROR @ c**4) > 1e-4

    def test_both_integrators_agree(self):
        """On one motion with many switches and pinned ends, by two different methods."""
        dynamics = tc.build_dynamics(shell_scene(pins=MIXED_PINS, gravity={"g": 9.8}))
        runs = [
            tc.simulate(dynamics, dynamics.structure.nodes, timepts=[0.0, 0.5], method=method, tol=1e-11)
            for method in ("splitting6", "dopri5")
        ]
        assert runs[0].switches > 0
        assert np.abs(runs[0].nodes[-1] - runs[1].nodes[-1]).max() < 1e-8


@pytest.fixture(scope="module")
def thrown():
    """A free shell released far from rest, turning and drifting, with tendons that go slack."""
    dynamics = tc.build_dynamics(shell_scene())
    nodes = dynamics.structure.nodes
    velocities = np.array([0.3, -0.2, 0.5]) + np.cross([0.5, 1.0, -0.7], nodes)
    return dynamics, tc.simulate(dynamics, (nodes, velocities), t_end=2.0)


class TestDrives:
    @pytest.mark.parametrize("law", [{"stiffness": 100.0}, {"EA": 100.0}])
    def test_nothing_is_left_of_an_earlier_drive(self, law):
        """One integrator under still, ramped and swept drives, one after the other and back, and a new one for each."""
        dynamics, start = taut_motion(tendons=law | {"rest_ratio": 0.8})
        still = Drive.constant(dynamics.members.rest_lengths, dynamics.members.forces)
        ramped = still._replace(rate=np.full_like(still.rest, -0.02), ramped=True)
        wave = np.array([4], np.int64), np.array([[1.0, 0.0, 2.0]]), np.array([9.0]), np.array([0.3])
        swept = still._replace(force=still.force + 0.1, wave_node=wave[0], wave_force=wave[1], wave_omega=wave[2],
                               wave_phase=wave[3], swept=True)  # fmt: skip
        heavy = still._replace(force=still.force - 0.2, rest=0.99 * still.rest)
        states = []
        for fresh in (False, True):
            plant = Splitting.fitted(dynamics, 6, 1e-8, 30.0)
            q, v = dynamics.rod_coordinates(start[0]), dynamics.rod_coordinates(start[1])
            for drive in (still, ramped, heavy, swept, still, swept, ramped, still):
                plant = Splitting.fitted(dynamics, 6, 1e-8, 30.0) if fresh else plant
                plant.march(q, v, np.array([0.0, 0.05]), drive, *(np.empty((2, *q.shape)) for _ in range(2)))
            states.append(np.hstack([q, v]))
        assert (states[0] == states[1]).all()


class TestConservation:
    def test_energy(self, thrown):
        dynamics, run = thrown
        energy = energies(dynamics, run)
        assert run.switches > 20
        assert np.abs(energy / energy[0] - 1).max() < 1e-8

    def test_energy_does_not_drift_when_taut(self):
        """Symplectic: over thousands of periods' worth of steps the error stays bounded."""
        dynamics, start = taut_motion()
        run = tc.simulate(dynamics, start, t_end=20.0, tol=1e-4)
        error = energies(dynamics, run) / energies(dynamics, run)[0] - 1
        assert 1e-12 < np.abs(error).max() < 1e-5
        late, early = np.abs(error[-100:]).max(), np.abs(error[:100]).max()
        assert late < 3 * early

    def test_momenta(self, thrown):
        dynamics, run = thrown
        linear, angular = momenta(dynamics, run)
        assert np.abs(linear[0]).max() > 1
        assert np.abs(angular[0]).max() > 1
        assert np.abs(linear - linear[0]).max() < 1e-12 * np.abs(linear).max()
        assert np.abs(angular - angular[0]).max() < 1e-11 * np.abs(angular).max()

    def test_momenta_with_dampers(self):
        """Inner dampers take energy but neither momentum nor moment of momentum."""
        dynamics, start = taut_motion(tendons=DAMPED)
        run = tc.simulate(dynamics, start, t_end=1.0)
        linear, angular = momenta(dynamics, run)
        assert np.abs(linear - linear[0]).max() < 1e-9 * np.abs(linear).max()
        assert np.abs(angular - angular[0]).max() < 1e-9 * np.abs(angular).max()

    def test_rods_keep_their_lengths(self, thrown):
        dynamics, run = thrown
        assert run.rod_drift < 1e-14
        run.verify()
        ends = run.nodes[:, dynamics.structure.rods]
        rates = run.velocities[:, dynamics.structure.rods]
        along = ((ends[:, :, 1] - ends[:, :, 0]) * (rates[:, :, 1] - rates[:, :, 0])).sum(axis=2)
        assert np.abs(along).max() < 1e-13 * 10

    def test_slack_tendons_carry_nothing(self, thrown):
        dynamics, run = thrown
        slack = run.lengths <= run.rest_lengths
        assert slack.any()
        assert (run.tensions[slack] == 0).all()
        taut = dynamics.members.stiffness * (run.lengths - run.rest_lengths)
        assert np.abs(run.tensions - np.where(slack, 0, taut)).max() < 1e-12 * run.tensions.max()

    def test_published_functions_agree(self, thrown):
        from tensctl.simulation import momenta as published
        from tensctl.simulation import total_energy

        dynamics, run = thrown
        assert np.abs(total_energy(dynamics, run) / energies(dynamics, run) - 1).max() < 1e-12
        for ours, theirs in zip(momenta(dynamics, run), published(dynamics, run), strict=True):
            assert np.abs(ours - theirs).max() < 1e-12 * np.abs(ours).max()

    def test_time_reversal(self):
        """Turned back, the taut splitting run returns to its start: the method is symmetric."""
        dynamics, start = taut_motion()
        there = tc.simulate(dynamics, start, timepts=[0.0, 1.0], tol=1e-6)
        back = tc.simulate(dynamics, (there.nodes[-1], -there.velocities[-1]), timepts=[0.0, 1.0], tol=1e-6)
        assert np.abs(there.nodes[-1] - start[0]).max() > 0.1
        assert np.abs(back.nodes[-1] - start[0]).max() < 1e-11
        assert np.abs(back.velocities[-1] + start[1]).max() < 1e-11

    def test_equilibrium_stays_where_it_is(self, mast):
        dynamics, rest, _ = mast
        run = tc.simulate(dynamics, rest, t_end=2.0)
        assert np.abs(run.nodes - rest.nodes).max() < 1e-12
        assert np.abs(run.velocities).max() < 1e-11


class TestDissipation:
    @pytest.mark.parametrize("lossy", [{"tendons": DAMPED}, {"drag": {"coefficient": 0.5}}], ids=["dampers", "drag"])
    def test_energy_falls_all_the_way(self, lossy):
        dynamics = tc.build_dynamics(shell_scene(pins=["P1_*_1"], **lossy))
        run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=2.0)
        energy = energies(dynamics, run)
        assert run.method == "dopri5"
        assert np.diff(energy).max() < 1e-9
        assert energy[-1] < energy[0] - 1
        assert run.rod_drift < 1e-12
        assert run.tensions.min() >= 0
        ends, rates = run.nodes[:, dynamics.structure.rods], run.velocities[:, dynamics.structure.rods]
        along = ((ends[:, :, 1] - ends[:, :, 0]) * (rates[:, :, 1] - rates[:, :, 0])).sum(axis=2)
        assert np.abs(along).max() < 1e-14 * 10

    def test_energy_lost_is_the_power_of_drag(self):
        """int c sum |v|^2 dt over all rod ends, by Simpson's rule on a taut motion."""
        import scipy.integrate

        dynamics, start = taut_motion(drag={"coefficient": 0.5})
        run = tc.simulate(dynamics, start, timepts=np.linspace(0, 1, 2001))
        power = 0.5 * (run.velocities**2).sum(axis=(1, 2))
        lost = energies(dynamics, run)[0] - energies(dynamics, run)[-1]
        assert lost == pytest.approx(scipy.integrate.simpson(power, x=run.time), rel=1e-8)

    def test_slack_dampers_carry_nothing(self):
        dynamics = tc.build_dynamics(shell_scene(tendons={"rest_ratio": 1.2, "damping": 50.0}))
        nodes = dynamics.structure.nodes
        drift = np.array([0.1, 0.0, 0.0]) + np.cross([0, 0, 0.3], nodes)
        run = tc.simulate(dynamics, (nodes, drift), t_end=0.5)
        assert (run.tensions == 0).all()

    def test_comes_to_the_equilibrium(self):
        scene = shell_scene(pins=["P1_*_1"], tendons={"damping": {"ratio": 0.2}})
        run = tc.simulate(tc.build_dynamics(scene), tc.build_structure(scene).nodes, t_end=30.0, tol=1e-8)
        assert run.distance_to(tc.find_equilibrium(scene).nodes)[-1] < 1e-5


class TestExactMotions:
    def test_pinned_nodes_never_move(self):
        """Whatever end of the rod they are."""
        for sections in ({}, {"tendons": DAMPED}):
            dynamics = tc.build_dynamics(shell_scene(pins=MIXED_PINS, gravity={"g": 9.8}, **sections))
            run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=1.0)
            held = dynamics.structure.pinned
            assert np.abs(run.nodes[:, held] - dynamics.structure.nodes[held]).max() < 1e-15
            assert np.abs(run.velocities[:, held]).max() < 1e-14
            assert np.abs(run.nodes[-1] - run.nodes[0])[~held].min(axis=1).max() > 0.01

    def test_slack_structure_falls_freely(self):
        """The mass centre on its parabola, rods turning steadily."""
        g = np.array([0.5, 0.0, -9.8])
        dynamics = tc.build_dynamics(shell_scene(tendons={"rest_ratio": 3.0}, gravity={"g": g.tolist()}))
        nodes = dynamics.structure.nodes
        velocities = np.array([1.0, 2.0, 3.0]) + np.cross([0.3, -0.4, 0.5], nodes)
        run = tc.simulate(dynamics, (nodes, velocities), t_end=1.0)
        assert (run.tensions == 0).all()
        start, drift = mass_centre(dynamics, nodes), mass_centre(dynamics, velocities)
        t = run.time[:, None]
        assert np.abs(mass_centre(dynamics, run.nodes) - start - t * drift - t**2 / 2 * g).max() < 1e-12

    def test_taut_structure_falls_freely_too(self, thrown):
        """Tendons do not move the mass centre: a straight line without gravity."""
        dynamics, run = thrown
        centre = mass_centre(dynamics, run.nodes)
        drift = mass_centre(dynamics, run.velocities[0])
        assert np.abs(centre - centre[0] - run.time[:, None] * drift).max() < 1e-12

    def test_a_push_gives_force_times_duration(self):
        """Exactly, although its edges are no recorded times and no multiples of any step."""
        dynamics = tc.build_dynamics(shell_scene())
        rest = tc.find_equilibrium(shell_scene())
        force = np.array([3.0, -2.0, 1.0])
        push = tc.Push("P4_1_1", force, 0.123456, 0.3141592)
        run = tc.simulate(dynamics, rest, timepts=[0.0, 0.1, 0.4, 1.0], pushes=[push])
        linear, _ = momenta(dynamics, run)
        wanted = force * (0.3141592 - 0.123456)
        assert np.abs(linear[:2]).max() < 1e-13
        assert np.abs(linear[2:] - wanted).max() < 1e-13

    def test_edges_that_miss_a_recorded_time_by_rounding(self):
        """0.1 * 3 > 0.3 in double precision: the push still acts from there on, and not a step longer or shorter."""
        dynamics, rest, _ = solved(shell_scene())
        push = tc.Push("P4_1_1", [1.0, 0.0, 0.0], 0.1 * 3, 0.1 * 7)
        assert push.start != 0.3
        run = tc.simulate(dynamics, rest, timepts=np.array([0, 1, 2, 3, 4, 5, 6, 7, 8]) / 10, pushes=[push])
        wanted = [0, 0, 0, 0, 0.1, 0.2, 0.3, 0.4, 0.4]
        assert momenta(dynamics, run)[0][:, 0] == pytest.approx(wanted, abs=1e-13)

    def test_pushes_add_up_by_pattern(self):
        """Every node that the pattern names gets the whole force."""
        dynamics = tc.build_dynamics(shell_scene())
        push = tc.Push("P4_*", [0.0, 0.0, 2.0], 0.0, 0.25)
        run = tc.simulate(dynamics, tc.find_equilibrium(shell_scene()), timepts=[0.0, 1.0], pushes=[push, push])
        assert momenta(dynamics, run)[0][-1] == pytest.approx([0, 0, 2 * 3 * 2.0 * 0.25], abs=1e-12)


class TestInputs:
    def test_rest_lengths_ramp_to_each_command(self, mast):
        """Linearly, to arrive at the end of the period, for actuated tendons only."""
        dynamics, rest, _ = mast
        rng = np.random.default_rng(0)
        table = 0.02 * rng.standard_normal((11, 21))
        command = Command(lambda t: table[round(t / 0.1)])
        run = tc.simulate(dynamics, rest, controller=command, timepts=np.linspace(0, 1, 101))
        asked = np.vstack([np.zeros(21), table])
        k, share = np.divmod(np.arange(101), 10)
        wanted = asked[k] + (share / 10)[:, None] * (asked[np.minimum(k + 1, 11)] - asked[k])
        assert np.abs(run.inputs - wanted).max() < 1e-14
        acting = dynamics.members.inputs
        assert np.abs(run.rest_lengths[:, acting] - dynamics.members.rest_lengths[acting] + wanted).max() < 1e-14
        others = np.delete(run.rest_lengths, acting, axis=1)
        assert (others == others[0]).all()
        assert np.abs(np.array(command.times) - np.linspace(0, 1, 11)).max() < 1e-12

    def test_rate_limit(self, mast):
        dynamics, rest, _ = mast
        run = tc.simulate(dynamics, rest, controller=Command(lambda t: np.full(21, 0.2)), t_end=1.0, rate_max=0.3)
        assert np.abs(run.inputs[:, 0] - np.minimum(0.3 * run.time, 0.2)).max() < 1e-13

    def test_floors(self, mast):
        dynamics, rest, _ = mast
        members = dynamics.members
        run = tc.simulate(dynamics, rest, controller=Command(lambda t: np.full(21, 50.0)), t_end=0.5)
        assert (run.rest_lengths >= members.floors * (1 - 1e-12)).all()
        acting = members.inputs
        assert np.abs(run.rest_lengths[-1, acting] - members.floors[acting]).max() < 1e-14

    def test_starting_from_another_equilibrium(self, mast):
        """It brings its own rest lengths along, and inputs count from L0."""
        dynamics, rest, _ = mast
        u = np.full(21, 0.03)
        other = tc.find_equilibrium(shell_scene(pins=["P1_*_1"]), start=rest.nodes, inputs=u)
        run = tc.simulate(dynamics, other, t_end=0.5)
        assert np.abs(run.inputs - u).max() < 1e-15
        assert np.abs(run.nodes - other.nodes).max() < 1e-12

    def test_controller_sees_what_is_recorded(self, mast):
        dynamics, rest, _ = mast
        seen = []

        class Watching(Command):
            def step(self, t, measurement):
                seen.append(measurement)
                return super().step(t, measurement)

        rng = np.random.default_rng(2)
        run = tc.simulate(dynamics, rest, controller=Watching(lambda t: 0.01 * rng.standard_normal(21)), t_end=0.5)
        for k, m in enumerate(seen):
            for name in ("nodes", "velocities", "lengths", "tensions", "inputs"):
                assert (getattr(m, name) == getattr(run, name)[k]).all()


class TestTimes:
    def test_timepts_are_honoured(self, mast):
        dynamics, rest, _ = mast
        times = np.array([0.0, 0.013, 0.1, 0.1000001, 0.77])
        run = tc.simulate(dynamics, rest, timepts=times)
        assert (run.time == times).all()
        assert run.nodes.shape == (5, 12, 3)

    @pytest.mark.parametrize("past", [0.0, 1e-15, -1e-15])
    def test_an_end_that_misses_a_sample_by_rounding(self, mast, past):
        """It is recorded once, and as what comes of the step before."""
        rest = mast[1]
        runs = [
            tc.simulate(mast[0], rest, controller=Command(lambda t: rest.inputs + 0.01), t_end=t_end)
            for t_end in (0.4, 0.4 * (1 + past))
        ]
        assert runs[1].time.size == 5
        assert runs[1].time[-1] == 0.4 * (1 + past)
        assert [np.abs(runs[0].nodes - runs[1].nodes).max(), np.abs(runs[0].inputs - runs[1].inputs).max()] == (
            pytest.approx([0.0, 0.0], abs=1e-14)
        )

    def test_two_last_times_that_are_one_to_rounding(self, mast):
        rest = mast[1]
        times = [0.0, 0.1, 0.4, 0.4 * (1 + 4e-16)]
        run = tc.simulate(mast[0], rest, controller=Command(lambda t: rest.inputs + 0.01), timepts=times)
        assert (run.time == times).all()
        assert np.abs(run.nodes[-1] - run.nodes[-2]).max() < 1e-14
        assert np.abs(run.rest_lengths[-1] - run.rest_lengths[-2]).max() < 1e-14

    def test_recording_does_not_change_the_motion(self, thrown):
        """Other recorded times cut the steps elsewhere; the motion stays the same within the tolerance."""
        dynamics, run = thrown
        again = tc.simulate(dynamics, (run.nodes[0], run.velocities[0]), timepts=[0.0, 0.333, 1.0])
        k = int(np.abs(run.time - 1.0).argmin())
        assert np.abs(again.nodes[-1] - run.nodes[k]).max() < 1e-9

    def test_runs_join(self):
        """Stopped and started again from where it stopped, the motion goes on as if nothing had been."""
        dynamics, start = taut_motion()
        whole = tc.simulate(dynamics, start, timepts=[0.0, 0.5, 1.0])
        rest = tc.simulate(dynamics, (whole.nodes[1], whole.velocities[1]), timepts=[0.0, 0.5])
        assert np.abs(rest.nodes[-1] - whole.nodes[-1]).max() < 1e-12

    def test_defaults(self, mast):
        dynamics, rest, _ = mast
        assert tc.simulate(dynamics, rest, t_end=0.5).time.size == 501
        controlled = tc.simulate(dynamics, rest, controller=Command(lambda t: np.zeros(21)), t_end=0.55)
        assert controlled.time == pytest.approx([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.55])

    def test_a_controller_without_a_period_is_asked_every_twenty_milliseconds(self, mast):
        dynamics, rest, _ = mast
        command = Command(lambda t: np.zeros(21))
        del command.dt
        tc.simulate(dynamics, rest, controller=command, t_end=0.1)
        assert command.times == pytest.approx([0, 0.02, 0.04, 0.06, 0.08, 0.1])

    def test_period_of_the_call_wins(self, mast):
        dynamics, rest, _ = mast
        command = Command(lambda t: np.zeros(21))
        tc.simulate(dynamics, rest, controller=command, t_end=0.5, dt=0.25)
        assert command.times == [0.0, 0.25, 0.5]


class TestMistakes:
    def refused(self, sentence, dynamics, start, error=tc.SimulationError, **arguments):
        with pytest.raises(error, match=sentence):
            tc.simulate(dynamics, start, **{"t_end": 0.1} | arguments)

    def test_starts(self, mast):
        dynamics, rest, _ = mast
        nodes = rest.nodes
        self.refused(r"start nodes have shape \(3, 3\); finite \(12, 3\) is expected", dynamics, np.eye(3))
        self.refused("start nodes have shape", dynamics, np.where(nodes == nodes[4], np.nan, nodes))
        self.refused("rod r1_1_1 starts 1.0e-06 of its length too long", dynamics, nodes * (1 + 1e-6))
        shifted = nodes + 0.1
        self.refused("a pinned node is moved at the start", dynamics, shifted)
        velocities = np.zeros_like(nodes)
        velocities[3] = nodes[3] - nodes[2]
        self.refused("the start velocities stretch a rod", dynamics, (nodes, velocities))

    @pytest.mark.parametrize("t_end", [None, 0.0, -1.0, np.nan, np.inf])
    def test_ends(self, mast, t_end):
        dynamics, rest, _ = mast
        self.refused("t_end (is|=) .* > 0", dynamics, rest, t_end=t_end)

    @pytest.mark.parametrize("timepts", [[], [0.0, 0.0], [1.0, 0.5], [0.0, np.nan], [[0.0, 1.0]]])
    def test_timepts(self, mast, timepts):
        dynamics, rest, _ = mast
        self.refused("finite times in ascending order", dynamics, rest, timepts=timepts)

    def test_negative_times(self, mast):
        dynamics, rest, _ = mast
        self.refused("timepts start at -1 s; a run starts at 0", dynamics, rest, timepts=[-1.0, 1.0])

    def test_splitting_for_dampers(self):
        dynamics, rest, _ = solved(shell_scene(tendons=DAMPED))
        self.refused("splitting4 moves undamped scenes only", dynamics, rest, method="splitting4")

    @pytest.mark.parametrize("u", [np.zeros(3), np.zeros((21, 1)), np.full(21, np.nan), 0.0], ids=str)
    def test_controller_output(self, mast, u):
        dynamics, rest, _ = mast
        sentence = r"at 0 s the controller gave u of shape .*; finite \(21,\) is expected"
        self.refused(sentence, dynamics, rest, controller=Command(lambda t: u))

    @pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf])
    def test_control_period(self, mast, dt):
        dynamics, rest, _ = mast
        command = Command(lambda t: np.zeros(21), dt)
        self.refused("the control period dt is .*; expected a finite number > 0", dynamics, rest, controller=command)

    def test_push_on_no_node(self, mast):
        dynamics, rest, _ = mast
        push = tc.Push("P9_1_1", [1, 0, 0], 0.0, 1.0)
        self.refused('push.node: "P9_1_1" names nothing', dynamics, rest, tc.StructureError, pushes=[push])

    def test_verify_tells_drift_and_pushing(self, thrown):
        _, run = thrown
        with pytest.raises(tc.SimulationError, match="a rod's length drifted by"):
            replaced(run, nodes=run.nodes * (1 + 1e-11)).verify()
        with pytest.raises(tc.SimulationError, match="a tendon pushed with 1 N"):
            replaced(run, tensions=np.minimum(run.tensions, -1.0)).verify()


def test_a_prism_swings_at_its_own_frequency():
    """Small motion in one mode repeats after its period: the nonlinear plant against the linear model."""
    dynamics, rest, linear = solved(prism_scene())
    mode = next(mode for mode in linear.modes if mode.kind == "flexible" and mode.multiplicity == 1)
    start = rest.potential.manifold.retract(rest.nodes, 1e-5 * rest.spectrum.shapes[:, mode.index])
    run = tc.simulate(dynamics, start, timepts=[0.0, 0.5 / mode.frequency, 1 / mode.frequency])
    moved = start - rest.nodes
    assert np.abs(run.nodes[1] - rest.nodes + moved).max() < 1e-4 * np.abs(moved).max()
    assert np.abs(run.nodes[2] - start).max() < 1e-4 * np.abs(moved).max()


def test_a_rod_whose_tie_is_not_stretched_at_first_order():
    """Tied along its own line it swings with omega^2 = 3 T a / ((a - 1) m): small motion is harmonic."""
    dynamics, rest, linear = solved(pendulum_scene(anchor=(3, 0, 0)))
    start = rest.potential.manifold.retract(rest.nodes, np.array([1e-5, 0.0]))
    run = tc.simulate(dynamics, start, timepts=[0.0, 0.5 / linear.modes[0].frequency])
    assert np.abs(run.nodes[1] - 2 * rest.nodes + start).max() < 1e-9


def test_a_heavy_pendulum_without_tendons():
    """A rod on a pin, let go level: its energy is kept, and it passes the bottom at omega^2 = 3 g / L."""
    structure = tc.network({"o": [0, 0, 0], "e": [0.01, 0, 0]}, {"r": ["o", "e"]}, {}, pins=["o"])
    dynamics = tc.build_dynamics(tc.Scene(structure=structure, gravity={"g": 9.81}))
    run = tc.simulate(dynamics, structure.nodes, t_end=0.2)
    height, speed = run.nodes[:, 1, 2], np.linalg.norm(run.velocities[:, 1], axis=1)
    assert np.abs(speed**2 / 6 + 9.81 * height / 2).max() < 1e-9 * 9.81 * 0.01
    assert height.min() == pytest.approx(-0.01, rel=1e-3)


def test_a_controller_without_a_period_is_asked_every_20_ms():
    dynamics, rest, _ = solved(shell_scene(pins=["P1_*_1"]))
    seen = []

    class Watch:
        dt = None

        def reset(self):
            seen.clear()

        def step(self, t, measurement):
            seen.append(t)
            return measurement.inputs

    tc.simulate(dynamics, rest, controller=Watch(), t_end=0.1)
    assert seen == pytest.approx([0.0, 0.02, 0.04, 0.06, 0.08, 0.1])


def test_far_from_the_origin_rounding_is_not_taken_for_error():
    """A short interval at 10 km and 20 s: the step does not shrink after what no step can change."""
    scene = tc.Scene(structure=tc.shell(3, 1), tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    manifold, rng = rest.potential.manifold, np.random.default_rng(0)
    velocities = (manifold.tangent(rest.nodes) @ (0.5 * rng.standard_normal(manifold.size))).reshape(-1, 3)
    times = [0.0, 2.0, 2.0 + 4e-5, 2.5]
    near, far = (
        tc.simulate(dynamics, (rest.nodes + off, velocities), timepts=times, tol=1e-10) for off in (0.0, 1e4)
    )  # fmt: skip
    assert far.evaluations < 1.5 * near.evaluations
    assert np.abs(far.nodes - 1e4 - near.nodes).max() < 1e-7
