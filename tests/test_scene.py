"""What a scene accepts, what it says to what it refuses, and that it spells itself completely."""

import json
import math
import pickle
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tensctl.errors import SceneError
from tensctl.scene import NetworkRecipe, PrismRecipe, Ratio, Scene, ShellRecipe, load_scene

EXAMPLE = Path(__file__).parents[1] / "examples" / "shell_3_1.toml"
SHELL = {"kind": "shell", "n": 3, "m": 1}
NETWORK = {
    "kind": "network",
    "nodes": {"a": [0, 0, 0], "b": [0, 0, 1], "c": [1, 0, 0]},
    "rods": {"r": ["a", "b"]},
    "tendons": {"t": ["a", "c"], "cable": ["a", "b", "c"]},
}
PUSH = {"node": "P4_1_1", "force": [5, 0, 0], "from": 1, "to": 2}


def scene(**sections) -> Scene:
    return Scene(**{"structure": SHELL} | sections)


def refusal(**sections) -> str:
    with pytest.raises(SceneError) as caught:
        scene(**sections)
    return str(caught.value)


def shell_refusal(**keys) -> str:
    return refusal(structure=SHELL | keys)


class TestAccepted:
    def test_example_file(self):
        example = load_scene(EXAMPLE)
        assert example.structure == ShellRecipe(n=3, m=1, pins=["P1_*_1"])
        assert example.simulation.push[0].force == (5.0, 0.0, 0.0)
        assert (example.simulation.push[0].start, example.simulation.push[0].stop) == (5.0, 5.1)
        assert example.gravity is None

    def test_defaults(self):
        least = scene()
        assert (least.rods.mass, least.tendons.stiffness, least.tendons.rest_ratio) == (1.0, 100.0, 0.8)
        assert least.tendons.EA is least.tendons.rest_length is None
        assert least.actuators.tendons == ("*",)
        stages = (
            "equilibrium",
            "linearize",
            "controllability",
            "lqr",
            "mpc",
            "target",
            "simulation",
            "report",
        )
        assert all(getattr(least, stage) is None for stage in stages)

    def test_an_empty_section_asks_for_its_stage(self):
        asked = scene(mpc={}, lqr={}, report={}, controllability={})
        assert asked.mpc.horizon == 20
        assert asked.lqr.input_weight == 1.0
        assert None not in (asked.report, asked.controllability)

    def test_reserved_words_have_python_names(self):
        assert scene(structure=SHELL | {"class": 2}).structure.cls == 2
        assert scene(structure=SHELL | {"cls": 2}).structure.cls == 2
        push = {"node": "a", "force": [0, 0, 1], "start": 1, "stop": 2}
        assert scene(simulation={"t_end": 3, "push": [push]}).simulation.push[0].stop == 2.0

    def test_numpy_passes_for_numbers_and_lists(self):
        given_by_numpy = scene(
            structure=SHELL | {"n": np.int64(4), "radius": np.float32(0.5)},
            tendons={"stiffness": {"*": np.array(3.0)}},
            gravity={"g": np.array([0.0, 0.0, -1.6])},
            loads={"P1_*": np.ones(3)},
        )
        written_out = scene(
            structure=SHELL | {"n": 4, "radius": 0.5},
            tendons={"stiffness": {"*": 3.0}},
            gravity={"g": [0, 0, -1.6]},
            loads={"P1_*": [1, 1, 1]},
        )
        assert given_by_numpy == written_out
        assert type(given_by_numpy.structure.n) is int
        assert type(given_by_numpy.structure.radius) is float

    def test_object_with_a_recipe(self):
        class Built:
            def as_recipe(self):
                return NETWORK

        assert scene(structure=Built()).structure == NetworkRecipe(**NETWORK)

    def test_coefficient_or_ratio(self):
        assert scene(tendons={"damping": {"ratio": 1}}).tendons.damping == Ratio(1.0)
        assert scene(tendons={"damping": {"t1_*": 1}}).tendons.damping == {"t1_*": 1.0}
        assert scene(drag={"coefficient": {"ratio": 0.1}}).drag.coefficient == Ratio(0.1)
        assert scene(drag={"coefficient": 0.1}).drag.coefficient == 0.1

    def test_alternatives_have_no_default_beside_them(self):
        tendons = scene(tendons={"EA": 50, "rest_length": {"*": 1.5}}).tendons
        assert tendons.stiffness is tendons.rest_ratio is None
        assert (tendons.EA, tendons.rest_length) == (50.0, {"*": 1.5})

    def test_prism_twists_to_where_it_holds_prestress(self):
        prism = scene(structure={"kind": "prism", "n": 3}).structure
        assert prism == PrismRecipe(n=3, twist=math.pi / 2 + math.pi / 3)

    def test_null_is_not_given(self):
        assert scene(lqr=None, tendons={"EA": 3.0, "stiffness": None}).tendons.stiffness is None

    def test_slack_at_first_is_allowed(self):
        assert scene(tendons={"rest_ratio": 1.7}).tendons.rest_ratio == 1.7

    def test_frozen(self):
        with pytest.raises(ValueError, match="frozen"):
            scene().title = "other"

    def test_survives_pickling(self):
        example = load_scene(EXAMPLE)
        assert pickle.loads(pickle.dumps(example)) == example

    def test_replaced_is_checked(self):
        example = load_scene(EXAMPLE)
        assert example.replaced(title="other").title == "other"
        assert example.title != "other"
        with pytest.raises(SceneError, match=r"expected a section \[mpc\]"):
            example.replaced(mpc=None)


SENTENCES = [
    ({"structure": None}, "structure is missing; expected a table."),
    ({"structure": {"n": 3}}, 'structure.kind is missing; expected "shell", "prism", "network" or "planar".'),
    ({"structure": {"kind": "dome"}}, 'structure.kind is "dome"; expected "shell", "prism", "network" or "planar".'),
    ({"rods": 3}, "rods is 3; expected a table with the keys mass, radius, EI."),
    ({"rods": {"mass": 0}}, "rods.mass is 0; expected a finite number > 0 (kg)."),
    ({"rods": {"mass": {"r1_*": -2.5}}}, 'rods.mass."r1_*" is -2.5; expected a finite number > 0 (kg).'),
    ({"tendons": {"stiffness": -3}}, "tendons.stiffness is -3; expected a finite number > 0 (N/m)."),
    ({"tendons": {"stifness": 3}}, "tendons.stifness is no key of a scene; did you mean stiffness?"),
    (
        {"tendons": {"stiffness": 1, "EA": 2}},
        "tendons.EA is given beside stiffness; expected only one of the two.",
    ),
    (
        {"tendons": {"rest_ratio": 1, "rest_length": 2}},
        "tendons.rest_length is given beside rest_ratio; expected only one of the two.",
    ),
    ({"tendons": {"damping": {"ratio": -1}}}, "tendons.damping.ratio is -1; expected a finite number >= 0."),
    (
        {"loads": {"P1": [0, math.inf, 0]}},
        "loads.P1 is [0, inf, 0]; expected a list of 3 finite numbers (N).",
    ),
    (
        {"actuators": {"floor": 1}},
        "actuators.floor is 1; expected a finite number > 0 and < 1 (of the rest length).",
    ),
    (
        {"linearize": {"outputs": ["angle"]}},
        'linearize.outputs[0] is "angle"; expected "nodes", "velocities", "lengths", "tensions", or some of these by '
        'label such as "nodes:P4_*".',
    ),
    (
        {"linearize": {"outputs": ["nodes"] * 2}},
        'linearize.outputs is ["nodes", "nodes"]; expected each output once.',
    ),
    (
        {"mpc": {"model": "nonlinear", "solver": "piqp"}},
        'mpc.model is "nonlinear"; solver, feedback and follow are for "linear", so leave them out.',
    ),
    ({"mpc": {"iterations": 3}}, 'mpc.iterations is 3; only model = "nonlinear" repeats its steps.'),
    ({"mpc": {"horizon": 0}}, "mpc.horizon is 0; expected a whole number >= 1 (control periods)."),
    (
        {"mpc": {"solver": "qp"}},
        'mpc.solver is "qp"; expected "auto", "dual", "primal", "daqp", "osqp", "piqp" or "clarabel".',
    ),
    (
        {"target": {}},
        "target names no shape; expected height_scale, twist, tip, tilt or nodes, or [[target.waypoint]].",
    ),
    (
        {"target": {"tilt": 1}},
        "target.tilt is 1; expected a list of finite numbers (rad, of the top ring's normal towards x and y).",
    ),
    ({"sweep": {}}, "sweep is planned, but not supported yet."),
    ({"lgr": {}}, "lgr is no key of a scene; did you mean lqr?"),
    (
        {"controllability": {"grid": 1}},
        "controllability.grid is no key of a scene; expected one of horizon, place, redundancy, move.",
    ),
    (
        {"simulation": {"t_end": 1, "controller": "lqr"}},
        'simulation.controller is "lqr"; expected a section [lqr] in the scene, or another controller.',
    ),
    (
        {"simulation": {"t_end": 1, "push": [PUSH, PUSH | {"to": 0.5}]}},
        "simulation.push[1].to is 0.5; expected a time after from = 1.0 (s).",
    ),
    (
        {"simulation": {"t_end": 1, "push": [{"node": "a"}]}},
        "simulation.push[0].force is missing; expected a list of 3 finite numbers (N).",
    ),
    (
        {"simulation": {"t_end": 1, "push": [PUSH | {"start": 1}]}},
        "simulation.push[0].from is given twice, as from and as start.",
    ),
    ({"title": 3}, "title is 3; expected text in quotes."),
]


@pytest.mark.parametrize(("sections", "sentence"), SENTENCES, ids=[sentence.split(" ")[0] for _, sentence in SENTENCES])
def test_refused_in_one_sentence(sections, sentence):
    assert refusal(**sections) == sentence


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"n": 2}, "structure.n is 2; expected a whole number >= 3."),
        ({"m": 0}, "structure.m is 0; expected a whole number >= 1."),
        ({"class": 3}, "structure.class is 3; expected 1 or 2."),
        ({"class": True}, "structure.class is true; expected 1 or 2."),
        ({"primal": 1}, "structure.primal is 1; expected true or false."),
        ({"radius": 0.0}, "structure.radius is 0.0; expected a finite number > 0 (m)."),
        ({"pins": "P1"}, 'structure.pins is "P1"; expected a list of node labels such as ["P1_*_1"]'),
        (
            {"pins": {"P1_1_1": "xyy"}},
            'structure.pins.P1_1_1 is "xyy"; expected some of the letters in "xyz".',
        ),
        ({"kind": "flat"}, 'structure.kind is "flat"; expected "shell", "prism", "network" or "planar".'),
    ],
)
def test_shell_refused(keys, words):
    assert shell_refusal(**keys).startswith(words)


def planar_refusal(**keys):
    recipe = {"kind": "planar", "nodes": {"a": [0, 0], "b": [1, 0]}, "rods": {"r": ["a", "b"]}, "tendons": {}}
    return refusal(structure=recipe | keys)


def test_planar_refused():
    assert planar_refusal(nodes={"a": [0, 0, 0]}) == (
        "structure.nodes.a is [0, 0, 0]; expected a list of 2 finite numbers (m)."
    )
    assert planar_refusal(pins={"a": "z"}) == 'structure.pins.a is "z"; expected some of the letters in "xy".'


@pytest.mark.parametrize("value", [True, "3", 3.0, 3.5, math.nan, None, [3], np.bool_(True)], ids=repr)
def test_what_is_no_whole_number(value):
    assert shell_refusal(n=value).startswith("structure.n is ")


@pytest.mark.parametrize("value", [False, "1", math.nan, -math.inf, [1.0], np.array([1.0, 2.0]), 10**400, 1j], ids=repr)
def test_what_is_no_number(value):
    assert "; expected a finite number (m)" in shell_refusal(overlap=value)


@pytest.mark.parametrize("value", [1e101, -1e300, 10**400], ids=repr)
def test_what_is_too_large_to_be_meant(value):
    assert shell_refusal(overlap=value).endswith("; expected a finite number (m), 1e+100 in size at most.")


@pytest.mark.parametrize("name", ["a.b", "a*", "", "a b", "ratio", "[a]"])
def test_names_that_would_confuse_patterns_and_labels(name):
    assert "structure.nodes" in refusal(structure=NETWORK | {"nodes": {name: [0, 0, 0]}})


def test_long_values_are_cut_short():
    assert len(refusal(title=["a" * 1000] * 1000)) < 150


class TestFiles:
    def write(self, tmp_path, name, text):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path / name

    def sentence(self, path):
        with pytest.raises(SceneError) as caught:
            load_scene(path)
        return str(caught.value).replace(str(path), "FILE")

    def test_json_and_toml_are_one_schema(self, tmp_path):
        content = tomllib.loads(EXAMPLE.read_text(encoding="utf-8"))
        assert load_scene(self.write(tmp_path, "scene.json", json.dumps(content))) == load_scene(EXAMPLE)

    def test_missing(self, tmp_path):
        assert self.sentence(tmp_path / "x.toml") == "FILE does not exist; expected a scene file, TOML or JSON."

    def test_folder(self, tmp_path):
        assert self.sentence(tmp_path) == "FILE cannot be read: Is a directory."

    def test_no_toml(self, tmp_path):
        path = self.write(tmp_path, "x.toml", "title = 'a'\nn == 3\n")
        assert self.sentence(path) == "FILE is no valid TOML: Invalid value (at line 2, column 4)."

    def test_no_json(self, tmp_path):
        path = self.write(tmp_path, "x.json", '{"title": }')
        assert "FILE is no valid JSON: Expecting value: line 1 column 11" in self.sentence(path)

    def test_json_with_a_key_twice(self, tmp_path):
        path = self.write(tmp_path, "x.json", '{"rods": {"mass": 1, "mass": 2}}')
        assert self.sentence(path) == 'FILE is no valid JSON: the key "mass" appears twice in one table.'

    def test_json_list(self, tmp_path):
        assert "FILE: the file holds [1]" in self.sentence(self.write(tmp_path, "x.json", "[1]"))

    def test_json_nested_too_deeply(self, tmp_path):
        path = self.write(tmp_path, "x.json", "[" * 200_000)
        assert self.sentence(path) == "FILE is no valid JSON: it is nested too deeply."

    def test_bytes(self, tmp_path):
        (tmp_path / "x.toml").write_bytes(b"\x89PNG")
        assert self.sentence(tmp_path / "x.toml") == "FILE is no text in UTF-8 (byte 0); expected TOML or JSON."

    def test_wrong_value_names_the_file(self, tmp_path):
        path = self.write(tmp_path, "x.toml", '[structure]\nkind = "shell"\nn = 2\nm = 1\n')
        assert self.sentence(path) == "FILE: structure.n is 2; expected a whole number >= 3."


positive = st.floats(1e-6, 1e6)
number = st.floats(-1e6, 1e6)
vector = st.lists(number, min_size=3, max_size=3)
name = st.from_regex(r"[A-Za-z0-9_+-]{1,6}", fullmatch=True).filter(lambda text: text != "ratio")
pattern = st.text(min_size=1, max_size=6).filter(lambda text: text != "ratio")
tables = st.dictionaries(pattern, positive, max_size=3)
per_member = positive | tables
ratio = st.builds(lambda x: {"ratio": x}, positive)
ends = st.dictionaries(name, st.lists(name, min_size=2, max_size=3), max_size=3)
axes = st.sampled_from(["x", "yx", "zxy"])
pins = st.lists(pattern, max_size=3) | st.dictionaries(pattern, axes, max_size=3)
shells = st.fixed_dictionaries(
    {"kind": st.just("shell"), "n": st.integers(3, 50), "m": st.integers(1, 50)},
    optional={"class": st.sampled_from([1, 2]), "primal": st.booleans(), "overlap": number, "pins": pins},
)
networks = st.fixed_dictionaries(
    {
        "kind": st.just("network"),
        "nodes": st.dictionaries(name, vector, max_size=3),
        "rods": ends,
        "tendons": ends,
    },
    optional={"pins": pins},
)
plane_pins = st.lists(pattern, max_size=3) | st.dictionaries(pattern, st.sampled_from(["x", "yx"]), max_size=3)
planes = st.fixed_dictionaries(
    {
        "kind": st.just("planar"),
        "nodes": st.dictionaries(name, st.lists(number, min_size=2, max_size=2), max_size=3),
        "rods": ends,
        "tendons": ends,
    },
    optional={"pins": plane_pins},
)
tendons = st.fixed_dictionaries(
    {}, optional={"EA": per_member, "rest_length": per_member, "damping": per_member | ratio}
)
pushes = st.builds(
    lambda node, force, start, length: {"node": node, "force": force, "from": start, "to": start + length},
    pattern, vector, positive, positive,
)  # fmt: skip
simulations = st.fixed_dictionaries({"t_end": positive}, optional={"push": st.lists(pushes, max_size=3)})
scenes = st.fixed_dictionaries(
    {"structure": shells | networks | planes},
    optional={
        "title": st.text(),
        "rods": st.fixed_dictionaries({}, optional={"mass": per_member}),
        "tendons": tendons,
        "gravity": st.fixed_dictionaries({"g": number | vector}),
        "loads": st.dictionaries(pattern, vector, max_size=3),
        "drag": st.fixed_dictionaries({"coefficient": positive | ratio}),
        "linearize": st.fixed_dictionaries(
            {
                "outputs": st.permutations(["nodes", "lengths", "tensions:t5_*"]),
                "mix": st.just({"up": {"P4_1_1_z": 0.5}}),
            }
        ),
        "lqr": st.just({}),
        "mpc": st.just({}),
        "report": st.just({}),
        "simulation": simulations,
    },
)


@settings(deadline=None)
@given(scenes)
def test_spelled_scene_loads_as_an_equal_one(sections):
    asked = Scene(**sections)
    again = Scene(**tomllib.loads(asked.to_toml()))
    assert again == asked
    for first, second in ((asked.rods.mass, again.rods.mass), (asked.loads, again.loads)):
        if isinstance(first, dict):
            assert list(first) == list(second), "order of patterns decides which wins"


@settings(deadline=None)
@given(scenes)
def test_spelled_scene_says_every_default(sections):
    asked = Scene(**sections)
    spelled = tomllib.loads(asked.to_toml())
    assert {key for key, value in asked.entries() if value is not None} == spelled.keys()
    for key, section in asked.entries():
        if hasattr(section, "entries"):
            assert {name for name, value in section.entries() if value is not None} == spelled[key].keys()
