"""One call from a scene to its files: what is asked for is done and written, and nothing half-done is left behind."""

import json
from pathlib import Path

import control
import numpy as np
import pytest
import xarray as xr
from support import network_scene, shell_scene

import tensctl as tc

EXAMPLE = Path(__file__).parents[1] / "examples" / "shell_3_1.toml"
MAST = {"pins": ["P1_*_1"]}
PUSH = {"node": "P4_1_1", "force": [5.0, 0.0, 0.0], "from": 0.1, "to": 0.2}


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The example's every stage, but for a small rise and a short run: results and folder."""
    scene = tc.load_scene(EXAMPLE).replaced(
        mpc={"horizon": 8, "tension_min": 0.1, "rate_max": 0.5},
        target={"height_scale": 1.02, "duration": 0.5},
        simulation={"t_end": 1.0, "controller": "mpc", "push": [PUSH]},
    )
    folder = tmp_path_factory.mktemp("short") / "out"
    return tc.run(scene, folder), folder


@pytest.fixture(scope="module")
def summary(short):
    return json.loads((short[1] / "summary.json").read_text(encoding="utf-8"))


def test_writes_three_files(short):
    visible = {path.name for path in short[1].iterdir() if not path.name.startswith(".")}
    assert visible == {"summary.json", "run.nc", "report.html"}
    assert list(short[1].parent.iterdir()) == [short[1]]


def test_says_what_it_has_in_a_line(short):
    assert repr(short[0]).startswith("Results(scene, equilibrium, dynamics, linear, study, path, ")
    assert len(repr(short[0])) < 200


class TestSummary:
    def test_has_every_stage(self, summary):
        stages = ("structure", "equilibrium", "linear", "controllability", "lqr", "target", "mpc", "simulation")
        assert summary.keys() == {"title", "version", "seconds", *stages, "sanity", "actuators"}
        assert summary["version"] == tc.__version__

    def test_structure(self, summary):
        wanted = {"nodes": 12, "rods": 6, "tendons": 24, "inputs": 21, "degrees_of_freedom": 21}
        assert summary["structure"] == wanted

    def test_equilibrium(self, summary, mast):
        found, rest = summary["equilibrium"], mast[1]
        assert found["energy_J"] == pytest.approx(rest.energy, rel=1e-12)
        assert found["residual"] < 1e-12
        assert found["stable"] == "yes"
        assert found["lowest_tension_N"] == pytest.approx(rest.tensions.min(), rel=1e-10)

    def test_linear_and_controllability(self, summary):
        assert summary["linear"]["states"] == 42
        assert len(summary["linear"]["frequencies_Hz"]) == 21
        assert summary["controllability"]["controllable_modes"] == list(range(21))

    def test_certificates(self, summary):
        assert summary["lqr"]["riccati_residual"] < 1e-12
        assert summary["lqr"]["slowest_pole"] < 0
        assert summary["mpc"]["worst_kkt"] < 1e-6
        assert summary["mpc"]["hard_limit_violations"] == 0
        assert summary["mpc"]["cvxpy_cost_difference"] < 1e-7
        assert summary["mpc"]["cvxpy_input_difference_m"] < 1e-7
        assert sum(summary["mpc"]["statuses"].values()) == 51
        assert summary["simulation"]["rod_length_drift"] < 1e-12

    def test_target(self, summary, short):
        run, path, target = short[0].run, short[0].path, summary["target"]
        away = max(np.linalg.norm(n - path.nodes_at(t), axis=1).max() for n, t in zip(run.nodes, run.time, strict=True))
        assert summary["simulation"]["farthest_from_path_m"] == pytest.approx(away, rel=1e-12)
        assert target["height_wanted_m"] == pytest.approx(1.02 * target["height_before_m"], rel=1e-10)
        assert target["fastest_reference_m_per_s"] < 0.5


def test_actuators(short, summary):
    """Of the run, whose push does work too; the report has a line for each."""
    found, demand = summary["actuators"], short[0].demand
    assert found["of"] == "run"
    assert not found["only_actuators_work"]
    assert len(found["actuators"]) == 21
    assert found["peak_supply_W"] == demand.peak_supply[0] > 0
    page = (short[1] / "report.html").read_text(encoding="utf-8")
    table = page[page.index('<section id="actuators"') : page.index('<section id="sanity"')]
    assert all(f">{label}<" in table for label in demand.labels)
    assert "Of its limit" not in table


@pytest.fixture(scope="module")
def dataset(short):
    with xr.open_dataset(short[1] / "run.nc", engine="h5netcdf") as dataset:
        return dataset.load()


class TestNetCDF:
    def test_has_the_run(self, short, dataset):
        run = short[0].run
        for name in ("nodes", "velocities", "lengths", "tensions", "rest_lengths", "inputs", "solve_time", "kkt"):
            assert (dataset[name].values == getattr(run, name)).all()
        assert (dataset.time.values == run.time).all()
        assert (dataset.status.values == run.status).all()

    def test_labels(self, short, dataset):
        structure = short[0].dynamics.structure
        assert tuple(dataset.node.values) == structure.node_labels
        assert tuple(dataset.tendon.values) == structure.tendon_labels
        assert tuple(dataset.input.values) == short[0].dynamics.input_labels
        assert list(dataset.axis.values) == ["x", "y", "z"]
        k = structure.node_labels.index("P4_1_1")
        assert float(dataset.nodes.sel(node="P4_1_1", axis="z")[-1]) == short[0].run.nodes[-1, k, 2]

    def test_units(self, dataset):
        units = {name: dataset[name].attrs["units"] for name in dataset if "units" in dataset[name].attrs}
        assert units == {
            "nodes": "m", "velocities": "m/s", "lengths": "m", "tensions": "N", "rest_lengths": "m", "inputs": "m",
            "solve_time": "s", "relaxed": "N", "margin_gap": "N",
        }  # fmt: skip
        assert dataset.time.attrs["units"] == "s"

    def test_tensions_follow_from_lengths(self, dataset):
        stretch = dataset.lengths - dataset.rest_lengths
        assert float(np.abs(dataset.tensions - (100 * stretch).clip(min=0)).max()) < 1e-11

    def test_save_where_it_cannot(self, short, tmp_path):
        with pytest.raises(tc.OutputError, match="cannot be written"):
            short[0].run.save(tmp_path / "no" / "such" / "run.nc")


STAGES = ("linear", "study", "path", "lqr", "mpc", "run", "certificate", "demand")


class TestOnlyWhatIsAsked:
    @pytest.mark.parametrize(
        ("sections", "built", "written"),
        [
            ({}, set(), {"summary.json"}),
            ({"linearize": {}}, {"linear"}, {"summary.json"}),
            ({"controllability": {}}, {"linear", "study"}, {"summary.json"}),
            ({"lqr": {}}, {"linear", "lqr"}, {"summary.json"}),
            ({"simulation": {"t_end": 0.1}}, {"run"}, {"summary.json", "run.nc"}),
            ({"report": {}}, set(), {"summary.json", "report.html"}),
            (
                {"lqr": {}, "simulation": {"t_end": 0.1, "controller": "lqr"}},
                {"linear", "lqr", "run", "demand"},
                {"summary.json", "run.nc"},
            ),
            ({"target": {"height_scale": 1.02}}, {"path", "demand"}, {"summary.json"}),
        ],
        ids=["nothing", "linear", "controllability", "lqr", "simulation", "report", "lqr run", "path"],
    )
    def test_stages(self, tmp_path, sections, built, written):
        results = tc.run(shell_scene(**MAST, **sections), tmp_path / "out")
        assert {name for name in STAGES if getattr(results, name) is not None} == built
        assert {p.name for p in (tmp_path / "out").iterdir() if not p.name.startswith(".")} == written
        summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
        assert ("simulation" in summary) == ("run" in built)
        assert ("lqr" in summary) == ("lqr" in built)
        assert ("actuators" in summary) == ("demand" in built)

    def test_outputs_are_those_asked_for(self, tmp_path):
        results = tc.run(shell_scene(**MAST, linearize={"outputs": ["lengths"]}), tmp_path / "out")
        assert results.linear.outputs[0] == "l_t1_1_1"
        assert isinstance(results.linear.to_statespace(), control.StateSpace)

    def test_free_run_starts_from_the_scene_s_nodes(self, tmp_path):
        results = tc.run(shell_scene(simulation={"t_end": 0.1}), tmp_path / "out")
        assert np.abs(results.run.nodes[0] - results.dynamics.structure.nodes).max() < 1e-15


class TestErrors:
    @pytest.fixture
    def earlier(self, tmp_path):
        """A folder with an earlier result and a note beside it."""
        folder = tmp_path / "out"
        tc.run(shell_scene(**MAST, simulation={"t_end": 0.1}), folder)
        (folder / "note.txt").write_text("mine", encoding="utf-8")
        return folder

    def contents(self, folder):
        return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    @pytest.mark.parametrize(
        ("sections", "error", "sentence"),
        [
            ({"tendons": {"rest_ratio": 1.2}}, tc.EquilibriumError, "every tendon is slack at rest"),
            ({"target": {"height_scale": 9.0}}, tc.SynthesisError, "ask for less"),
            (
                {"lqr": {}, "actuators": {"tendons": ["t5_1_1"]}},
                tc.SynthesisError,
                "neither damped nor driven",
            ),
            ({"loads": {"P9_*": [0, 0, 1]}}, tc.StructureError, "loads"),
            ({"mpc": {"dt": 1.0}}, tc.SynthesisError, "is too long for mode"),
        ],
    )
    def test_leave_an_earlier_result_as_it_was(self, earlier, sections, error, sentence):
        before = self.contents(earlier)
        with pytest.raises(error, match=sentence):
            tc.run(shell_scene(**MAST, **sections), earlier)
        assert self.contents(earlier) == before
        assert list(earlier.parent.iterdir()) == [earlier]

    def test_leave_no_new_folder(self, tmp_path):
        with pytest.raises(tc.EquilibriumError):
            tc.run(shell_scene(tendons={"rest_ratio": 1.2}), tmp_path / "new")
        assert list(tmp_path.iterdir()) == []

    def test_next_result_replaces_the_earlier(self, earlier):
        tc.run(shell_scene(**MAST, title="second"), earlier)
        assert json.loads((earlier / "summary.json").read_text(encoding="utf-8"))["title"] == "second"
        assert not (earlier / "run.nc").exists()
        assert (earlier / "note.txt").read_text(encoding="utf-8") == "mine"

    def test_unstable_rest_is_refused_for_control_but_can_be_watched(self, tmp_path):
        """A rod pulled over its pin by its longest tendon, with a softer one on each side."""

        def balanced(**sections):
            nodes = {"o": [0, 0, 0], "head": [1, 0, 0], "far": [-1, 0, 0], "left": [1, 2, 0], "right": [1, -2, 0]}
            ties = {name: ["head", name] for name in ("far", "left", "right")}
            stiffness = {"*": 1.0, "far": 100.0}
            pins = ["o", "far", "left", "right"]
            return network_scene(
                nodes, {"rod": ["o", "head"]}, ties, pins, tendons={"stiffness": stiffness}, **sections
            )

        watched = tc.run(balanced(simulation={"t_end": 0.1}), tmp_path / "watched")
        assert watched.equilibrium.stable is tc.Stability.NO
        with pytest.raises(tc.EquilibriumError, match="the equilibrium is unstable: its smallest eigenvalue is -"):
            tc.run(balanced(lqr={}), tmp_path / "controlled")


def test_full_example_ends_within_a_millimetre(tmp_path):
    """The mast stands 20 % taller, is pushed, and comes back; every limit is kept, every check is passed."""
    from tensctl.pipeline.case import checks

    results = tc.run(tc.load_scene(EXAMPLE), tmp_path / "out")
    run, mpc, wanted = results.run, results.mpc, results.path.target
    assert np.linalg.norm(run.nodes[-1] - wanted.nodes, axis=1).max() < 1e-3
    heights = [
        np.mean([nodes[run.structure.node_labels.index(f"P4_{i}_1"), 2] for i in (1, 2, 3)])
        for nodes in (run.nodes[0], run.nodes[-1])
    ]
    assert heights[1] == pytest.approx(1.2 * heights[0], abs=1e-3)
    before_push, pushed = (run.distance_to(wanted.nodes)[int(np.abs(run.time - t).argmin())] for t in (5.0, 5.1))
    assert pushed > before_push + 0.01
    members = results.dynamics.members
    assert (run.rest_lengths >= members.floors).all()
    assert np.abs(np.diff(run.rest_lengths, axis=0) / np.diff(run.time)[:, None]).max() <= 0.5 * (1 + 1e-9)
    assert run.rod_drift < 1e-12
    assert len(mpc.records) == 501
    assert all(check.ok for check in checks(results))
