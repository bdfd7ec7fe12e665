"""What actuators have to give: a case by hand, work against energy on runs and paths, gangs, peaks, limits."""

import io
import json
import re
from typing import ClassVar

import numpy as np
import pytest
from support import network_scene, order_of, replaced, shell_scene

import tensctl as tc
from tensctl.progress import Progress
from tensctl.simulation.demand_table import record

LAWS = {"k": {"stiffness": 100.0}, "EA": {"EA": 80.0}}
# A rod that points at its anchor: its tendon only ever pulls along it, so nothing moves and forces are known.
NODES = {"o": [0, 0, 0], "head": [1, 0, 0], "anchor": [3, 0, 0]}
GANGS = {"top": {"t6_*": 1.0, "t6_1_1": 0.5}, "tilt": {"t5_1_1": 1.0, "t5_2_1": -0.7}}
UP_AND_BACK = tc.Schedule("tie", [0.0, 1.0, 2.0], [0.0, 0.2, 0.1])


def still(law, **actuators):
    ends = {"rod": ["o", "head"]}, {"tie": ["head", "anchor"]}, ["o", "anchor"]
    return tc.build_dynamics(network_scene(NODES, *ends, tendons=LAWS[law], actuators=actuators))


def pulled(dynamics, times, schedule=UP_AND_BACK):
    run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=times, schedule=[schedule])
    return tc.actuator_demand(run, dynamics)


class Shaking:
    """Asks for random rest lengths."""

    dt = 0.05

    def __init__(self, inputs):
        self.inputs = inputs

    def reset(self):
        self.rng = np.random.default_rng(0)

    def step(self, t, measurement):
        return 0.005 * self.rng.standard_normal(self.inputs)


@pytest.fixture(scope="module", params=LAWS)
def mast(request):
    scene = shell_scene(pins=["P1_*_1"], tendons=LAWS[request.param])
    return tc.build_dynamics(scene), tc.find_equilibrium(scene)


def shaken(dynamics, rest, samples=1, t_end=1.0):
    """A run recorded so many times in each control period."""
    controller = Shaking(len(dynamics.input_labels))
    times = np.linspace(0, t_end, round(t_end / controller.dt) * samples + 1)
    return tc.simulate(dynamics, rest, controller=controller, timepts=times, tol=1e-12)


class TestByHand:
    def test_constant_stiffness(self):
        """T = 100 (2 - L), L from 1.6 to 1.4 m in a second and to 1.5 in another: every number is exact."""
        found = pulled(still("k"), np.linspace(0, 2, 5))
        assert found.labels == ("tie",)
        assert found.force[:, 0] == pytest.approx([40, 50, 60, 55, 50], abs=1e-10)
        assert found.speed[:, 0] == pytest.approx([0, 0.2, 0.2, -0.1, -0.1], abs=1e-12)
        assert found.power[:, 0] == pytest.approx([0, 10, 12, -5.5, -5], abs=1e-10)
        assert found.power_after[:, 0] == pytest.approx([8, 10, -6, -5.5, 0], abs=1e-10)
        peaks = found.peak_force, found.peak_speed, found.peak_power, found.peak_braking
        assert [p.value[0] for p in peaks] == pytest.approx([60, 0.2, 12, 6], abs=1e-10)
        assert [p.time[0] for p in (found.peak_force, found.peak_power, found.peak_braking)] == [1.0, 1.0, 1.0]
        assert [part[0] for part in found.work] == pytest.approx([10, -5.5, 4.5], abs=1e-10)
        assert found.holding_force[0] == pytest.approx(50)
        assert found.peak_supply == pytest.approx((12, 1.0))
        assert found.energy_change == pytest.approx((50**2 - 40**2) / 200)
        found.verify(1e-12)

    def test_root_mean_square(self):
        """Of 40 to 60 N and back to 50, straight: (60^3 - 40^3)/60 and (60^3 - 50^3)/30 over two seconds."""
        found = pulled(still("k"), np.linspace(0, 2, 401))
        exact = np.sqrt(((60**3 - 40**3) / 60 + (60**3 - 50**3) / 30) / 2)
        assert found.rms_force[0] == pytest.approx(exact, rel=1e-6)

    def test_constant_EA(self):
        """Energy 80 (2 - L)^2/(2 L): the cable that is reeled in takes its strain along, and the balance is exact."""
        dynamics = still("EA")
        counts = np.array([4, 8, 16])
        energy = [40 * (2 - L) ** 2 / L for L in (1.6, 1.4, 1.5)]
        given = [pulled(dynamics, np.linspace(0, 2, n + 1)).work.positive[0] for n in counts]
        errors = np.abs(np.array(given) - energy[1] + energy[0])
        assert order_of(1 / counts, errors) == pytest.approx(4, abs=0.2)
        found = pulled(dynamics, np.linspace(0, 2, 401))
        assert found.force[0, 0] == pytest.approx(80 * (2 / 1.6 - 1))
        assert [part[0] for part in found.work] == pytest.approx([*np.diff(energy), energy[2] - energy[0]], rel=1e-9)

    def test_a_corner_between_times(self):
        """Speeds are means over intervals, and the work is off by less than it says."""
        found = pulled(still("EA"), np.linspace(0, 2, 8))
        assert found.speed[4, 0] == pytest.approx((0.2 - 0.1 * (1 / 7) - 0.2 * 6 / 7) * 7 / 2)
        assert 1e-6 < abs(found.balance) < found.work_error[0]

    def test_one_time_only(self):
        found = pulled(still("k"), [0.0])
        assert found.rms_force[0] == found.holding_force[0] == pytest.approx(40)
        assert [part[0] for part in found.work] == [0, 0, 0]
        found.verify()


class TestEnergy:
    def test_work_is_the_change_of_energy(self, mast):
        """Of order 4 in the recorded times, and off by less than it says."""
        dynamics, rest = mast
        counts = np.array([4, 8, 16])
        found = [tc.actuator_demand(shaken(dynamics, rest, n), dynamics) for n in counts]
        errors = [abs(demand.balance) for demand in found]
        assert found[0].closed
        assert (found[0].work.positive - found[0].work.regenerated).sum() > 0.5
        assert errors[-1] < 1e-7
        assert order_of(1 / counts, errors) == pytest.approx(4, abs=0.1)
        for demand in found:
            assert abs(demand.balance) < 0.1 * demand.work_error.sum()
            demand.verify(1e-12)

    @pytest.mark.parametrize("stiffness", [1e4, 1e8])
    def test_stiff_tendons(self, stiffness):
        """Micrometres of work at 20 N: what is left of the balance is the run's own error of place times force."""
        tendons = {"stiffness": stiffness, "rest_ratio": 1 - 20 / stiffness}
        scene = shell_scene(pins=["P1_*_1"], tendons=tendons)
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        plan = tc.Schedule("t5_1_1", [0.0, 0.1], [0.0, 5 / stiffness])
        run = tc.simulate(dynamics, rest, schedule=[plan], timepts=np.linspace(0, 0.1, 501))
        found = tc.actuator_demand(run, dynamics)
        assert found.energy_error < 1e-7
        found.verify()

    def test_corners_between_times(self, mast):
        """Recorded past the controller's samples the order is lost, and the error is still less than it says."""
        dynamics, rest = mast
        run = tc.simulate(dynamics, rest, controller=Shaking(21), timepts=np.linspace(0, 1, 144))
        found = tc.actuator_demand(run, dynamics)
        assert 1e-4 < abs(found.balance) < found.work_error.sum()
        found.verify(1e-12)

    def test_a_wrong_work_is_found(self, mast):
        dynamics, rest = mast
        found = tc.actuator_demand(shaken(dynamics, rest, 8), dynamics)
        wrong = replaced(found, energy_change=found.energy_change + 1e-3)
        with pytest.raises(tc.SimulationError, match=r"differs from the change of energy by -0.001 J"):
            wrong.verify()

    def test_weight_and_loads_are_energies(self):
        scene = shell_scene(pins=["P1_*_1"], gravity={"g": 0.1}, loads={"P4_1_1": [0.1, 0.0, -0.1]})
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        found = tc.actuator_demand(shaken(dynamics, rest, 16), dynamics)
        assert abs(found.balance) < 1e-6 < abs(found.work.net.sum())

    def test_dampers_take_the_rest(self):
        scene = shell_scene(pins=["P1_*_1"], drag={"coefficient": 1.0})
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        found = tc.actuator_demand(shaken(dynamics, rest, 4), dynamics)
        assert not found.closed
        assert found.balance > 0.1
        found.verify()
        assert "dampers, drag and pushes" in str(found)

    def test_pushes_do_work_too(self, mast):
        dynamics, rest = mast
        push = tc.Push("P4_1_1", [5.0, 0.0, 0.0], 0.1, 0.2)
        run = tc.simulate(dynamics, rest, controller=Shaking(21), timepts=np.linspace(0, 0.5, 81), pushes=[push])
        assert not tc.actuator_demand(run, dynamics, pushes=[push]).closed
        with pytest.raises(tc.SimulationError, match="differs from the change of energy"):
            tc.actuator_demand(run, dynamics).verify()

    def test_cables(self):
        """A ring of one cable around the top of a prism: its length grows by all of its segments."""
        prism = tc.prism(3, pins=["a*"])
        recipe = prism.as_recipe()
        tendons = {k: v for k, v in recipe["tendons"].items() if not k.startswith("top")}
        recipe["tendons"] = tendons | {"ring": ["b1", "b2", "b3", "b1"]}
        scene = tc.Scene(structure=recipe)
        dynamics = tc.build_dynamics(scene)
        run = tc.simulate(
            dynamics, dynamics.structure.nodes, timepts=np.linspace(0, 1, 201), tol=1e-12,
            schedule=[tc.Schedule("ring", [0.0, 1.0], [0.0, 0.3])],
        )  # fmt: skip
        found = tc.actuator_demand(run, dynamics)
        assert abs(found.work.net.sum()) > 0.1
        assert abs(found.balance) < 1e-3 * abs(found.work.net.sum())
        found.verify()


class TestGangs:
    def test_a_motor_carries_its_tendons(self):
        """F = sum of ratio T, and the power of a gang is that of its tendons."""
        scene = shell_scene(pins=["P1_*_1"], actuators={"gangs": GANGS})
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        run = shaken(dynamics, rest, 4)
        found = tc.actuator_demand(run, dynamics)
        tendons = dict(zip(dynamics.structure.tendon_labels, run.tensions.T, strict=True))
        rests = dict(zip(dynamics.structure.tendon_labels, run.rest_lengths.T, strict=True))
        tilt = found.labels.index("tilt")
        assert np.abs(found.force[:, tilt] - tendons["t5_1_1"] + 0.7 * tendons["t5_2_1"]).max() < 1e-12
        by_tendon = -sum(tendons[t][1:] * np.diff(rests[t]) / np.diff(run.time) for t in GANGS["tilt"])
        assert np.abs(found.power[1:, tilt] - by_tendon).max() < 1e-12
        assert abs(found.balance) < 1e-5
        found.verify(1e-12)

    def test_a_gear_trades_speed_for_force(self):
        """Through a ratio of 2 the motor feels twice the force at half the speed, and gives the same power."""
        plain, geared = still("k"), still("k", gangs={"motor": {"tie": 2.0}})
        times = np.linspace(0, 2, 21)
        one, other = (
            pulled(plain, times),
            pulled(geared, times, tc.Schedule("motor", [0.0, 1.0, 2.0], [0.0, 0.1, 0.05])),
        )
        assert np.abs(other.force - 2 * one.force).max() < 1e-10
        assert np.abs(other.speed - 0.5 * one.speed).max() < 1e-12
        assert np.abs(other.power - one.power).max() < 1e-10
        assert np.abs(np.array(other.work) - np.array(one.work)).max() < 1e-10


@pytest.fixture(scope="module", params=LAWS)
def path(request):
    target = {"height_scale": 1.2, "start": 0.5, "duration": 3.0}
    return tc.plan_shape(shell_scene(pins=["P1_*_1"], tendons=LAWS[request.param], target=target))


@pytest.fixture(scope="module")
def round_about():
    """A mast whose tip goes aside and round: some motors have their peak where a leg ends and speeds jump."""
    legs = [{"tip": [0.3, 0.0], "duration": 3.0}, {"circle": "tip", "turns": -0.25, "duration": 2.5}]
    return tc.plan_shape(shell_scene(3, 2, pins=["P1_*_1"], target={"waypoint": legs}))


class TestPath:
    def test_work_is_the_change_of_potential(self, path):
        """Along equilibria."""
        found = tc.actuator_demand(path, inertia=False)
        assert found.closed
        work = (found.work.positive - found.work.regenerated).sum()
        assert work > 5
        assert abs(found.balance) < 1e-6 * work
        found.verify()

    def test_inertia_fades_with_the_square_of_time(self, path):
        """So does what of it no actuator balances, which is the only difference in energy."""
        durations = np.array([2.0, 4.0, 8.0])
        paths = [replaced(path, legs=(replaced(path.legs[0], duration=T),)) for T in durations]
        moved, slow = ([tc.actuator_demand(p, inertia=way) for p in paths] for way in (True, False))
        added = [np.abs(a.force - b.force).max() for a, b in zip(moved, slow, strict=True)]
        left = [abs(a.balance - b.balance) for a, b in zip(moved, slow, strict=True)]
        assert not moved[0].closed
        assert order_of(1 / durations, added) == pytest.approx(2, abs=0.01)
        assert order_of(1 / durations, left) == pytest.approx(2, abs=0.1)

    def test_reach_and_pace(self, path):
        """From first to last planned inputs and tensions; as fast as the path says."""
        found = tc.actuator_demand(path)
        first, last = path.equilibria[0], path.target
        moved = np.trapezoid(np.vstack([found.speed[1:], found.speed[-1:]]), found.time, axis=0)
        assert np.abs(moved - last.inputs).max() < 1e-5
        assert np.abs(found.force[0] - first.tensions[first.potential.members.inputs]).max() < 1e-9
        assert np.abs(found.holding_force - last.tensions[last.potential.members.inputs]).max() < 1e-9
        assert found.peak_speed.value.max() == pytest.approx(path.fastest, rel=1e-4)
        assert (found.time[0], found.time[-1]) == (0.5, 3.5)

    @pytest.mark.parametrize("apart", [-1e-6, 1e-6], ids=["before", "after"])
    def test_peaks_beside_a_jump_of_speeds(self, round_about, apart):
        """What a motor does in the microsecond before or after a leg ends is not above the peaks that are told."""
        found, end = tc.actuator_demand(round_about), round_about.legs[1].start
        speed = (round_about.inputs_at(end + apart) - round_about.inputs_at(end)) / apart
        power = speed * round_about.tensions_at(end)[round_about.target.potential.members.inputs]
        assert np.all(np.abs(speed) < found.peak_speed.value + 1e-5 * np.abs(speed).max())
        told = np.maximum(found.peak_power.value, found.peak_braking.value)
        assert np.all(np.abs(power) < told + 1e-5 * np.abs(power).max())
        assert np.abs(speed).max() < round_about.fastest_of(round_about.legs[0 if apart < 0 else 1]) * (1 + 1e-5)

    def test_a_slow_run_agrees(self, path):
        """Steered along the path in ten times its time, peaks of force and work are those of the path."""
        slow = replaced(path, legs=(replaced(path.legs[0], duration=30.0, start=0.0),))
        dynamics = tc.build_dynamics(shell_scene(pins=["P1_*_1"], tendons=LAWS[path.target.potential.members.law]))
        times = np.linspace(0, 30, 121)
        plan = [tc.Schedule(t, times, slow.inputs_at(times)[:, k]) for k, t in enumerate(dynamics.input_labels)]
        run = tc.simulate(dynamics, path.equilibria[0], t_end=30.0, schedule=plan, timepts=np.linspace(0, 30, 601))
        found, wanted = tc.actuator_demand(run, dynamics), tc.actuator_demand(slow, inertia=False)
        assert np.abs(found.peak_force.value - wanted.peak_force.value).max() < 0.05
        assert np.abs(found.work.net - wanted.work.net).max() < 0.02
        assert "infinitely slow" in str(wanted)
        assert "infinitely slow" not in str(found)


class TestPower:
    WANTED: ClassVar = {"height_scale": 1.1, "duration": 1.2}

    @pytest.mark.parametrize("gangs", [None, {"top": {"t6_*": 1.0}, "side": {"t7_1_1": 2.0, "t8_1_1": 1.0}}])
    def test_a_path_takes_the_time_that_its_power_needs(self, gangs):
        """Refused with a time: that keeps the limit, as the demand integrates it by itself, and 3 % less does not."""
        scene = shell_scene(pins=["P1_*_1"], actuators={"gangs": gangs} if gangs else {})
        peak = largest(tc.actuator_demand(tc.plan_shape(scene, self.WANTED)))
        limit = 0.4 * peak
        limited = scene.replaced(actuators={"gangs": gangs, "power_max": limit})
        sentence = rf"duration = 1.2 s asks {peak:.3g} W of actuator \S+ at .* = {limit:g} W; allow (\S+) s or more"
        with pytest.raises(tc.SynthesisError, match=sentence) as caught:
            tc.plan_shape(limited, self.WANTED)
        needed = float(re.search(r"allow (\S+) s", str(caught.value))[1])
        path = tc.plan_shape(limited, self.WANTED | {"duration": needed})
        assert largest(tc.actuator_demand(path)) <= limit
        with pytest.raises(tc.SynthesisError, match="power_max"):
            tc.plan_shape(limited, self.WANTED | {"duration": 0.97 * needed})


def largest(demand):
    """Most power that a motor gives or takes, W."""
    return float(np.maximum(demand.peak_power.value, demand.peak_braking.value).max())


class TestTold:
    def test_share_of_the_stall_limit(self):
        dynamics = still("k", force_max=80.0)
        found = pulled(dynamics, np.linspace(0, 2, 5))
        assert found.load.value[0] == pytest.approx(60 / 80)
        assert "75 %" in str(found)
        assert record(found)["largest_share_of_force_max"] == pytest.approx(0.75)
        free = pulled(still("k"), np.linspace(0, 2, 5))
        assert free.load.value[0] == 0
        assert "of limit" not in str(free)
        assert found.stalls is None

    def test_beyond_the_stall_limit(self):
        """A schedule knows no limits; what it exceeds is told with its time."""
        found = pulled(still("k", force_max=48.0), np.linspace(0, 2, 5))
        assert found.stalls == "actuator tie beyond force_max: 125 % of it at 1 s"
        assert found.stalls in str(found)

    def test_beyond_a_power(self):
        """The tie gives most as it comes to its end; half of that is too much, a little more than it is not."""
        found = pulled(still("k"), np.linspace(0, 2, 5))
        most = max(found.peak_power.value[0], found.peak_braking.value[0])
        assert most > 0
        assert found.beyond(1.001 * most) is None
        assert found.beyond(most / 2).startswith(f"actuator tie beyond power_max = {most / 2:g} W: ")
        assert f"{most:.4g} W at" in found.beyond(most / 2)

    def test_table_and_record(self, mast):
        """Most powerful first; JSON holds the same numbers by label."""
        dynamics, rest = mast
        found = tc.actuator_demand(shaken(dynamics, rest), dynamics)
        lines = str(found).splitlines()
        strongest = int(np.argmax(np.maximum(found.peak_power.value, found.peak_braking.value)))
        assert lines[1].split()[0] == found.labels[strongest]
        assert len(lines) == 21 + 3
        told = json.loads(json.dumps(record(found), allow_nan=False))
        assert told["actuators"]["t4_1_1"]["peak_force_N"] == found.peak_force.value[found.labels.index("t4_1_1")]
        assert told["of"] == "run"

    def test_what_is_missing(self, mast):
        dynamics, rest = mast
        run = shaken(dynamics, rest, t_end=0.1)
        for given in ((), (still("k"),)):
            with pytest.raises(tc.SimulationError, match=r"give actuator_demand\(run, dynamics\)"):
                tc.actuator_demand(run, *given)
        bare = tc.build_dynamics(shell_scene(actuators={"tendons": []}))
        idle = tc.simulate(bare, bare.structure.nodes, t_end=0.01)
        with pytest.raises(tc.SimulationError, match="nothing is asked of any"):
            tc.actuator_demand(idle, bare)


def test_the_report_of_a_plan_draws_force_speed_and_power(tmp_path):
    """A scene with a target and no run: one figure each, and the peaks in the table."""
    scene = shell_scene(pins=["P1_*_1"], equilibrium={}, target={"height_scale": 1.05, "duration": 3.0}, report={})
    tc.run(scene, tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    for name in ("Force", "Speed", "Power"):
        assert page.count(f"{name} of every actuator over time") == 1
    assert "Controllability: least gain of a mode over the largest" in page


def test_a_run_beyond_its_power_is_told(tmp_path):
    """On the terminal and in the report: a schedule knows no limits."""
    plan = {"t_end": 0.1, "schedule": [{"tendon": "t7_1_1", "times": [0, 0.1], "change": [0, 0.02]}]}
    scene = shell_scene(pins=["P1_*_1"], actuators={"power_max": 0.1}, equilibrium={}, simulation=plan, report={})
    said = io.StringIO()
    results = tc.run(scene, tmp_path / "out", progress=Progress(stream=said))
    told = results.demand.beyond(0.1)
    assert told.startswith("actuator t7_1_1 beyond power_max = 0.1 W: gives ")
    assert f"warning: {told}" in said.getvalue()
    assert told[1:] in (tmp_path / "out" / "report.html").read_text()
