"""Controllers in C answer as those in Python do, keep hard limits to the last bit, and allocate nothing."""

import numpy as np
import pytest
from compiled import ALLOCATORS, Compiled, flat, links
from support import MIXED_PINS, network_scene, random_motion, shell_scene, solved

import tensctl as tc
from tensctl.cli import main
from tensctl.errors import OutputError, SceneError
from tensctl.pipeline import design
from tensctl.simulation import Measurement
from tensctl.synthesis.constant_rates import ConstantRates

OK, RELAXED, FALLBACK, REFUSED, BOUNDED = range(5)
HORIZON, FLOOR, RATE = 5, 1.0, 1.0
PLANE = {
    "kind": "planar",
    "nodes": {"a": [0, 0], "b": [1, 0], "c": [1, 1], "d": [0, 1]},
    "rods": {"r1": ["a", "c"], "r2": ["b", "d"]},
    "tendons": {"t1": ["a", "b"], "t2": ["b", "c"], "t3": ["c", "d"], "t4": ["d", "a"]},
}
CHARTS = {
    "free": shell_scene(),
    "pinned in many ways": shell_scene(pins=list(MIXED_PINS)),
    "joints": shell_scene(3, 2, cls=2, pins=["P1_*_1"]),
    "free joints": shell_scene(3, 2, cls=2),
    "free in a plane": tc.Scene(structure=PLANE),
}


def shown(rest, nodes, velocities, inputs):
    return Measurement(nodes, velocities, rest.lengths, rest.tensions, inputs)


def predictive(linear, **given):
    return tc.MPC(linear, **{"horizon": HORIZON, "tension_min": FLOOR, "rate_max": RATE} | given)


class Both:
    """A controller and its C source on the same measurements; C steers, told what is `asked` of it."""

    def __init__(self, python, c, asked=None):
        self.python, self.c, self.dt, self.asked = python, c, python.dt, asked
        self.sensors, self.delay = getattr(python, "sensors", None), getattr(python, "delay", 0.0)
        self.differences, self.outcomes, self.steps, self.measurements, self.reports = [], [], [], [], []
        self.statuses = []

    def reset(self):
        self.python.reset()
        self.c.reset()

    def as_array(self, measurement):
        """A measurement as the C source reads it."""
        return flat(measurement) if self.sensors is None else np.concatenate([measurement.values, measurement.inputs])

    def step(self, t, measurement):
        seen = self.as_array(measurement)
        if self.asked is not None:
            seen = np.concatenate([seen, self.asked(t)])
        wanted = self.python.step(t, measurement)
        outcome, u = self.c.step(seen)
        self.differences.append(np.abs(u - wanted).max())
        self.outcomes.append(outcome)
        self.reports.append(self.c.last)
        self.steps.append((measurement.inputs, u, wanted))
        self.measurements.append(seen)
        self.statuses.extend(record.status for record in getattr(self.python, "records", [])[-1:])
        if self.delay:  # both foresee the command that was given, not each its own
            self.python.restore(self.python.state() | {"command": u})
        return u


@pytest.fixture(scope="module")
def steered(mast, tmp_path_factory):
    """The mast thrown about and held by its MPC in C, Python beside it: 201 steps, 4 s."""
    dynamics, rest, linear = mast
    folder = tmp_path_factory.mktemp("mpc")
    mpc = predictive(linear)
    made = tc.export_c(mpc, folder)
    both = Both(mpc, Compiled(folder / "controller.c", 21))
    start = random_motion(rest.potential, np.random.default_rng(1), 0.02, 0.5)
    tc.simulate(dynamics, start, controller=both, t_end=4.0, rate_max=RATE)
    return both, made, folder


class TestPredictive:
    def test_commands_are_those_of_python(self, steered):
        both, _, _ = steered
        assert len(both.differences) == 201
        assert max(both.differences) < 1e-9

    def test_the_run_has_all_kinds_of_steps(self, steered):
        """Floors that cannot be kept, limits that act and steps without an active limit, as Python says too."""
        both, _, _ = steered
        said = [record.status.endswith("relaxed") for record in both.python.records]
        assert [outcome == RELAXED for outcome in both.outcomes] == said
        assert 50 < sum(said) < 70
        at_rate = [np.isin(np.abs(u - now), (RATE * both.dt)).any() for now, u, _ in both.steps]
        assert sum(said) < sum(at_rate) < 110
        assert sum(report.iterations == 0 for report in both.reports) > 50

    def test_hard_limits_hold_to_the_last_bit(self, steered):
        both, _, _ = steered
        lower, upper = both.python.linear.dynamics.members.input_bounds
        reach = both.python.rate_max * both.dt
        for now, u, wanted in both.steps:
            assert (u >= now - reach).all()
            assert (u <= now + reach).all()
            assert (u >= lower).all()
            assert (u <= upper).all()
            limit = np.isin(wanted, (now - reach, now + reach))
            assert (np.abs(u - wanted)[limit] < 1e-12).all()

    def test_residual_and_shortfall_are_reported(self, mast, steered):
        """Of a problem with relaxed floors and of one without, each as Python judges its own."""
        both, _, _ = steered
        rest = mast[1]
        thrown = random_motion(rest.potential, np.random.default_rng(1), 0.02, 0.5)
        for motion, outcome in (((rest.nodes, np.full_like(rest.nodes, 1e-3)), OK), (thrown, RELAXED)):
            both.reset()
            both.step(0.0, shown(rest, *motion, rest.inputs))
            last, record = both.c.last, both.python.records[-1]
            assert last.outcome == outcome
            assert 0 <= last.kkt < 1e-9
            assert last.relaxed == pytest.approx(record.relaxed, abs=1e-8)
            assert (last.relaxed > 0) == (outcome == RELAXED)

    def test_the_past_changes_rounding_only(self, mast, steered):
        """The active set that a step begins with is a guess, not an answer."""
        both, _, _ = steered
        for at in (1, 5, 20):
            both.reset()
            fresh = both.c.step(both.measurements[at])[1]
            both.c.reset()
            for measurement in both.measurements[:at]:
                both.c.step(measurement)
            assert np.abs(both.c.step(both.measurements[at])[1] - fresh).max() < 1e-9

    def test_a_warm_start_saves_iterations(self, steered):
        """The last active set, one stage on, is nearer than none while the mast swings."""
        both, _, _ = steered
        both.reset()
        warm = 0
        for measurement in both.measurements[20:50]:
            both.c.step(measurement)
            warm += both.c.last.iterations
        cold = 0
        for measurement in both.measurements[20:50]:
            both.c.reset()
            both.c.step(measurement)
            cold += both.c.last.iterations
        assert warm < cold

    def test_where_no_inputs_keep_the_limits_the_last_plan_goes_on(self, mast, tmp_path):
        """Inputs a metre beyond their bounds come back as fast as rates allow, with a plan and without."""
        _, rest, linear = mast
        tc.export_c(predictive(linear), tmp_path)
        c = Compiled(tmp_path / "controller.c", 21)
        far = rest.inputs + 1.0
        back = np.clip(far - RATE * 0.02, *linear.dynamics.members.input_bounds)
        for planned in (False, True):
            outcome, u = c.step(flat(shown(rest, rest.nodes, np.zeros_like(rest.nodes), far)))
            assert outcome == FALLBACK
            assert c.last.kkt < 0
            assert (u == (back if planned else np.minimum(far, linear.dynamics.members.input_bounds[1]))).all()
            c.step(flat(shown(rest, rest.nodes, np.zeros_like(rest.nodes), rest.inputs)))

    def test_stiff_and_soft_tendons(self, tmp_path):
        """Stiffness from 1 to 1e6 N/m in one mast: commands agree where they are decided."""
        stiffness = {"*": 100.0, "t5_*": 1e6, "t6_*": 1.0}
        _, rest, linear = solved(shell_scene(pins=["P1_*_1"], tendons={"stiffness": stiffness, "rest_ratio": 0.8}))
        dt = 0.4 / np.sqrt(max(mode.omega2 for mode in linear.flexible.modes))
        mpc = tc.MPC(linear, horizon=4, dt=dt, tension_min=0.0)
        tc.export_c(mpc, tmp_path)
        c = Compiled(tmp_path / "controller.c", 21)
        for seed in range(5):
            nodes, velocities = random_motion(rest.potential, np.random.default_rng(seed), 1e-4, 1e-2)
            seen = shown(rest, nodes, velocities, rest.inputs)
            outcome, u = c.step(flat(seen))
            assert outcome in (OK, RELAXED)
            assert np.abs(u - mpc.step(0.0, seen)).max() < 1e-9


class Rough(Both):
    """Notes where Python begins a second time, and where C did."""

    def __init__(self, python, c, monkeypatch):
        super().__init__(python, c)
        self.again, self.parted = [], []
        plan = ConstantRates.plan

        def told(rough, *given):
            found = plan(rough, *given)
            self.again.append((len(self.steps), found))
            return found

        monkeypatch.setattr(ConstantRates, "plan", told)

    def step(self, t, measurement):
        known = len(self.again)
        u = super().step(t, measurement)
        if len(self.again) > known:
            wanted = self.again[-1][1]
            self.parted.append(np.abs(self.c.numbers("begun_at", wanted.size) - wanted).max())
        return u


def thrown_about(mast, both):
    """201 steps of the mast."""
    dynamics, rest, _ = mast
    start = random_motion(rest.potential, np.random.default_rng(1), 0.02, 0.5)
    tc.simulate(dynamics, start, controller=both, t_end=4.0, rate_max=RATE)
    return both


@pytest.fixture
def short(mast, tmp_path, monkeypatch):
    """A tenth of the usual work for searches, which begin at the last plan only: half of the steps are bounded."""
    from tensctl.synthesis import qp_primal

    monkeypatch.setattr(qp_primal, "_WORK", 2e6)
    monkeypatch.setattr(qp_primal, "FAR", np.inf)
    tc.export_c(predictive(mast[2]), tmp_path)
    return thrown_about(mast, Both(predictive(mast[2]), Compiled(tmp_path / "controller.c", 21)))


@pytest.fixture
def rough(mast, tmp_path, monkeypatch):
    """As much work for searches that begin again with constant rates; the C source tells from where."""
    from tensctl.synthesis import qp_primal

    monkeypatch.setattr(qp_primal, "_WORK", 2e6)
    tc.export_c(predictive(mast[2], tension_min=3.0), tmp_path)
    with (tmp_path / "controller.c").open("a") as source:
        source.write("const double *begun_at(void);\nconst double *begun_at(void) { return self.guess; }\n")
    c = Compiled(tmp_path / "controller.c", 21)
    return thrown_about(mast, Rough(predictive(mast[2], tension_min=3.0), c, monkeypatch))


class TestBounded:
    def test_it_ends_where_python_does(self, short):
        """With the same command, and as far from the optimum; C bounds the dual search too, and one is cut more."""
        reports, records = short.reports, short.python.records
        said = np.array([record.status.endswith("bounded") for record in records])
        bounded, apart = np.array(short.outcomes) == BOUNDED, np.array(short.differences)
        assert (bounded[said]).all()
        assert bounded.sum() <= said.sum() + 1
        assert 50 < said.sum() < 150
        assert apart[said == bounded].max() < 1e-9
        kkt = np.array([[report.kkt, record.kkt] for report, record in zip(reports, records, strict=True)])
        assert np.allclose(kkt[said, 0], kkt[said, 1], rtol=1e-6)
        assert (kkt[bounded, 0] > 1e-9).all()
        assert (kkt[~bounded] < 1e-9).all()

    def test_far_from_the_optimum_it_begins_again_where_python_does(self, rough):
        """With rates that are constant in halves of the horizon, to the same commands."""
        assert len(rough.parted) >= 3
        assert max(rough.parted) < 1e-9
        assert max(rough.differences) < 1e-9
        said = [status.endswith("bounded") for status in rough.statuses]
        assert [outcome == BOUNDED for outcome in rough.outcomes] == said
        turns = np.abs(np.diff(rough.again[-1][1].reshape(HORIZON, -1), n=2, axis=0)).max(axis=1) > 1e-9
        assert turns.tolist() == [False, True, False]

    def test_hard_limits_hold(self, short):
        lower, upper = short.python.linear.dynamics.members.input_bounds
        for now, u, _ in short.steps:
            assert (u >= np.maximum(now - RATE * short.dt, lower)).all()
            assert (u <= np.minimum(now + RATE * short.dt, upper)).all()

    def test_more_changes_come_nearer(self, mast, tmp_path):
        """`max_iterations` bounds each of at most five searches; where floors give way the optimum is far for a few."""
        _, rest, linear = mast
        nodes, velocities = random_motion(rest.potential, np.random.default_rng(1), 0.02, 0.5)
        residuals = []
        for most in (1, 50, 1000):
            (tmp_path / str(most)).mkdir()
            tc.export_c(predictive(linear), tmp_path / str(most), max_iterations=most)
            c = Compiled(tmp_path / str(most) / "controller.c", 21)
            outcome, _ = c.step(flat(shown(rest, nodes, velocities, rest.inputs)))
            assert c.last.iterations <= 5 * most
            assert outcome == (BOUNDED if most < 1000 else RELAXED)
            residuals.append(c.last.kkt)
        assert residuals[2] < 1e-9 < residuals[1] < residuals[0]


def test_a_delay_is_foreseen(mast, tmp_path):
    """Commands that act half a period late, 201 steps: the state is predicted to then with the command under way."""
    dynamics, rest, linear = mast
    fast = {"tension_min": 2.0, "rate_max": 1.0}
    late = predictive(linear, delay=0.01, **fast)
    made = tc.export_c(late, tmp_path)
    both = Both(late, Compiled(tmp_path / "controller.c", 21))
    start = random_motion(rest.potential, np.random.default_rng(1), 0.003, 0.05)
    tc.simulate(dynamics, start, controller=both, t_end=4.0, rate_max=fast["rate_max"])
    assert len(both.differences) == 201
    assert max(both.differences) < 1e-9
    assert {OK, RELAXED} == set(both.outcomes)
    commands = np.array([u for _, u, _ in both.steps])
    assert (np.abs(np.diff(commands, axis=0)) <= fast["rate_max"] * both.dt * (1 + 1e-12)).all()
    prompt = predictive(linear, **fast).step(0.0, shown(rest, *start, rest.inputs))
    assert np.abs(prompt - commands[0]).max() > 1e-4
    assert "#define TENSCTL_DELAY 0.01" in made.header


class Faulty(Both):
    """Samples that tell nothing on the way: numbers that are missing, a rod twice as long, and inputs unknown."""

    def step(self, t, measurement):
        nodes, velocities, inputs = (x.copy() for x in (measurement.nodes, measurement.velocities, measurement.inputs))
        k = len(self.steps)
        if k in (0, 5, 6, 7):
            nodes[4] = np.nan
        if k == 9:
            velocities[11, 2] = np.inf
        if k == 12:
            nodes[5] += nodes[5] - nodes[4]
        if k in (7, 15, 16):
            inputs[::2] = np.nan
        return super().step(t, Measurement(nodes, velocities, measurement.lengths, measurement.tensions, inputs))


@pytest.mark.parametrize("delay", [0.0, 0.01])
def test_what_tells_nothing_lets_the_plan_go_on(mast, tmp_path, delay):
    """As in Python, also before the first plan; inputs that are not measured are those of the last command."""
    dynamics, rest, linear = mast
    late = predictive(linear, delay=delay)
    tc.export_c(late, tmp_path)
    both = Faulty(late, Compiled(tmp_path / "controller.c", 21))
    start = random_motion(rest.potential, np.random.default_rng(1), 0.01, 0.2)
    tc.simulate(dynamics, start, controller=both, t_end=0.6, rate_max=RATE)
    assert max(both.differences) < 1e-9
    nothing = [status == "no measurement" for status in both.statuses]
    assert [outcome == REFUSED for outcome in both.outcomes] == nothing
    assert np.flatnonzero(nothing).tolist() == [0, 5, 6, 7, 9, 12]
    commands = np.array([u for _, u, _ in both.steps])
    assert (commands[0] == rest.inputs).all()
    assert np.abs(np.diff(commands[4:8], axis=0)).max() > 1e-3


@pytest.mark.parametrize("kind", ["lqr", "mpc", "sensors"])
def test_commands_are_numbers_whatever_is_measured(mast, tmp_path, kind):
    """Each number of a measurement in turn is none, too large, or beyond all structures; commands keep their limits.

    What is no number is forgotten; what is one is believed, and remembered by an estimate.
    """
    dynamics, rest, linear = mast
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)
    good = flat(shown(rest, rest.nodes, np.zeros_like(rest.nodes), rest.inputs))
    if kind == "sensors":
        controller = tc.OutputMPC(linear, eyes, horizon=2, tension_min=FLOOR)
        good = np.concatenate([eyes.of(rest), rest.inputs])
    else:
        controller = tc.lqr(linear) if kind == "lqr" else tc.MPC(linear, horizon=2, tension_min=FLOOR)
    tc.export_c(controller, tmp_path)
    c, (lower, upper) = Compiled(tmp_path / "controller.c", 21), linear.dynamics.members.input_bounds
    for size in (np.nan, -np.inf, 1e300, 1e39):
        c.reset()
        for at in range(good.size):
            bad = good.copy()
            bad[at] = size
            u = c.step(bad)[1]
            assert ((u >= lower) & (u <= upper)).all()
        if size != 1e39:
            for _ in range(40):
                u = c.step(good)[1]
            assert np.abs(u - rest.inputs).max() < 1e-3


class TestFeedback:
    @pytest.mark.parametrize("name", CHARTS)
    def test_every_chart(self, name, tmp_path):
        """States of pinned, free, planar and jointed structures: the gain sees the same in C."""
        _, rest, linear = solved(CHARTS[name])
        lqr = tc.lqr(linear, dt=0.02, stabilisable_only=True)
        tc.export_c(lqr, tmp_path)
        c, rng = Compiled(tmp_path / "controller.c", len(linear.inputs)), np.random.default_rng(3)
        for reach in (0.0, 1e-9, 0.05, 0.3):
            nodes, velocities = random_motion(rest.potential, rng, reach, 1.0)
            inputs = rest.inputs + 0.01 * rng.standard_normal(rest.inputs.size)
            seen = shown(rest, nodes, velocities, inputs)
            outcome, u = c.step(flat(seen))
            wanted = lqr.step(0.0, seen)
            assert outcome == OK
            assert np.abs(u - wanted).max() < 1e-12 * max(np.abs(wanted).max(), 1.0)

    def test_a_free_structure_that_has_turned(self, free, tmp_path, rng):
        """Half a turn and ten metres away: the frame takes both back."""
        from support import rotation

        _, rest, linear = free
        lqr = tc.lqr(linear)
        tc.export_c(lqr, tmp_path)
        c = Compiled(tmp_path / "controller.c", len(linear.inputs))
        nodes, velocities = random_motion(rest.potential, rng, 0.05, 0.5)
        here = c.step(flat(shown(rest, nodes, velocities, rest.inputs)))[1]
        for turn in (np.diag([-1.0, -1.0, 1.0]), rotation(rng), rotation(rng)):
            seen = shown(rest, nodes @ turn.T + 10.0, velocities @ turn.T + 3.0, rest.inputs)
            u = c.step(flat(seen))[1]
            assert np.abs(u - lqr.step(0.0, seen)).max() < 1e-11
            assert np.abs(u - here).max() < 1e-11

    def test_floors_of_rest_lengths_hold(self, mast, tmp_path):
        _, rest, linear = mast
        lqr = tc.lqr(linear)
        tc.export_c(lqr, tmp_path)
        c = Compiled(tmp_path / "controller.c", 21)
        nodes, velocities = random_motion(rest.potential, np.random.default_rng(4), 0.3, 30.0)
        seen = shown(rest, nodes, velocities, rest.inputs)
        u, upper = c.step(flat(seen))[1], linear.dynamics.members.input_bounds[1]
        assert (u <= upper).all()
        assert (u == upper).sum() == (lqr.step(0.0, seen) == upper).sum() > 3

    @pytest.mark.parametrize("order", [None, 30])
    def test_lqg(self, mast, tmp_path, order):
        """Estimates of full and reduced order, over 100 noisy samples."""
        dynamics, rest, linear = mast
        eyes = tc.sensors(dynamics.structure, lengths=1e-3, tensions={"t5_*": 0.05}, seed=7)
        design = tc.lqg(linear, eyes, dt=0.02, order=order)
        tc.export_c(design, tmp_path)
        both = Both(design, Compiled(tmp_path / "controller.c", 21))
        tc.simulate(dynamics, random_motion(rest.potential, np.random.default_rng(1), 0.01, 0.1), controller=both,
                    t_end=2.0, rate_max=RATE)  # fmt: skip
        assert len(both.differences) == 101
        assert max(both.differences) < 1e-11


class TestAlone:
    """What the source asks of the machine that runs it."""

    def test_nothing_is_allocated(self, steered, tmp_path):
        """Every allocator is renamed at link time to one that nobody has: the program links only if none is called."""
        folder = steered[2]
        (tmp_path / "main.c").write_text(
            '#include "controller.h"\nint main(void) { static double m[TENSCTL_MEASUREMENT], u[TENSCTL_INPUTS];\n'
            "return tensctl_step(m, u) + (int)tensctl_last().iterations; }\n"
        )
        (tmp_path / "other.c").write_text("#include <stdlib.h>\nint main(void) { return malloc(9) == 0; }\n")
        renamed = [f"-Wl,--wrap={name}" for name in ALLOCATORS]
        assert links([tmp_path / "main.c", folder / "controller.c"], tmp_path / "main", f"-I{folder}", *renamed)
        assert not links([tmp_path / "other.c"], tmp_path / "other", *renamed)

    def test_only_the_mathematics_of_c_is_included(self, steered):
        made = steered[1]
        lines = [line for line in made.source.splitlines() if line.startswith("#include")]
        assert lines == ['#include "controller.h"', "#include <math.h>", "#include <string.h>"]
        assert "#include" not in made.header

    def test_tables_read_back_as_they_were(self, steered):
        """Decimals of the source are the same doubles."""
        made = steered[1]
        table = next(table for table in made.tables if table.name == "slope_from")
        body = table.declaration.split("{")[1].split("}")[0]
        assert np.array_equal(np.array([float(word) for word in body.split(",")]), table.values.ravel())


class TestWhatIsRefused:
    def test_drag_on_a_free_structure(self, tmp_path):
        _, _, linear = solved(shell_scene(drag={"coefficient": 0.1}))
        with pytest.raises(OutputError, match="rigid-body rates"):
            tc.export_c(tc.lqr(linear), tmp_path)

    def test_a_continuous_lqg(self, mast, tmp_path):
        dynamics, _, linear = mast
        with pytest.raises(OutputError, match="continuous time"):
            tc.export_c(tc.lqg(linear, tc.sensors(dynamics.structure, lengths=1e-3)), tmp_path)

    @pytest.mark.parametrize("bound", [0, 2.5])
    def test_a_bound_that_is_none(self, mast, tmp_path, bound):
        with pytest.raises(OutputError, match="max_iterations"):
            tc.export_c(tc.lqr(mast[2]), tmp_path, max_iterations=bound)

    def test_a_place_that_is_none(self, mast, tmp_path):
        for path in (tmp_path / "nowhere" / "controller.c", tmp_path / "controller.txt"):
            with pytest.raises(OutputError, match="cannot be written"):
                tc.export_c(tc.lqr(mast[2]), path)

    def test_a_thing_that_is_no_controller(self, tmp_path):
        with pytest.raises(OutputError, match="int has no form in C; give an LQR"):
            tc.export_c(3, tmp_path)

    def test_a_scene_that_leaves_open_which(self):
        with pytest.raises(SceneError, match="more than one of"):
            design(shell_scene(lqr={}, mpc={}))
        with pytest.raises(SceneError, match="none of"):
            design(shell_scene())


def test_the_command_line_writes_both_files(tmp_path):
    scene = network_scene(
        {"o": [0, 0, 0], "head": [1.0, 0.2, 0.1], "a": [-1.0, 0, 0], "b": [2, 1, 0], "c": [2, -1, 1]},
        {"rod": ["o", "head"]}, {"t1": ["head", "a"], "t2": ["head", "b"], "t3": ["head", "c"]}, ["o", "a", "b", "c"],
        lqr={"dt": 0.02}, tendons={"stiffness": 100.0, "rest_ratio": 0.7},
    )  # fmt: skip
    (tmp_path / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    assert main(["export", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "loop.c")]) == 0
    Compiled(tmp_path / "loop.c", 3)
    assert '#include "loop.h"' in (tmp_path / "loop.c").read_text(encoding="utf-8")
