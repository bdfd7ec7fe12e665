"""The command line answers a user's fault with one line and exit code 2."""

import ast
import subprocess
import sys
from types import ModuleType

import pytest

import tensctl
from tensctl.cli import main
from tensctl.errors import OutputError

SCENE = '[structure]\nkind = "shell"\nn = 3\nm = 1\n'


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "mast.toml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def pipeline(monkeypatch):
    """A pipeline that notes what it is asked and does what its `act` says."""

    class Pipeline(ModuleType):
        def run(self, scene, out, *, progress):
            self.asked = (scene, out, progress)
            self.act()

        def act(self):
            pass

    stand_in = Pipeline("tensctl.pipeline")
    monkeypatch.setitem(sys.modules, "tensctl.pipeline", stand_in)
    return stand_in


def fault(capsys, *arguments) -> str:
    assert main([str(argument) for argument in arguments]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1, "one line"
    return said.err


@pytest.mark.parametrize("command", ["run", "check", "explain", "accuracy"])
def test_missing_file(capsys, tmp_path, command):
    path = tmp_path / "nowhere.toml"
    assert fault(capsys, command, path) == f"tensctl: {path} does not exist; expected a scene file, TOML or JSON.\n"


def test_wrong_value(capsys, scene):
    scene.write_text(SCENE.replace("n = 3", "n = 2"))
    assert fault(capsys, "check", scene) == f"tensctl: {scene}: structure.n is 2; expected a whole number >= 3.\n"


def test_no_toml(capsys, scene):
    scene.write_text(SCENE + "n n\n")
    assert "no valid TOML" in (said := fault(capsys, "run", scene))
    assert "(at line 5, column 3)" in said


def test_no_json(capsys, tmp_path):
    (tmp_path / "x.json").write_text("{]")
    assert "no valid JSON: Expecting property name" in (said := fault(capsys, "run", tmp_path / "x.json"))
    assert "line 1 column 2" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["check", "SCENE", "--verbos"], "--verbos"),
        (["chek", "SCENE"], 'Did you mean "check"?'),
        (["check"], "SCENE requires an argument"),
        (["check", "SCENE", "another"], "another"),
        (["export", "SCENE"], "--out requires an argument"),
        (["run", "SCENE", "-o"], "requires an argument"),
    ],
)
def test_wrong_use(capsys, scene, arguments, words):
    assert words in fault(capsys, *(scene if word == "SCENE" else word for word in arguments))


def test_error_of_a_room(capsys, scene, pipeline):
    def refuse():
        raise OutputError("out cannot be written: permission\ndenied.")

    pipeline.act = refuse
    assert fault(capsys, "run", scene) == "tensctl: out cannot be written: permission denied.\n"


def test_error_of_the_machine(capsys, scene, pipeline, tmp_path):
    pipeline.act = lambda: (tmp_path / "no" / "folder").write_text("")
    assert fault(capsys, "run", scene) == f"tensctl: {tmp_path / 'no' / 'folder'}: No such file or directory.\n"


def test_fault_of_tensctl_keeps_its_traceback(scene, pipeline):
    pipeline.act = lambda: [][0]
    with pytest.raises(IndexError):
        main(["run", str(scene)])


def test_interrupted(capsys, scene, pipeline):
    def interrupt():
        raise KeyboardInterrupt

    pipeline.act = interrupt
    assert main(["run", str(scene)]) == 130
    assert capsys.readouterr().err == "tensctl: interrupted\n"


def test_run_hands_over_scene_folder_and_progress(capsys, scene, pipeline, tmp_path):
    assert main(["run", str(scene), "-o", str(tmp_path / "results"), "--quiet"]) == 0
    asked, out, progress = pipeline.asked
    assert asked == tensctl.load_scene(scene)
    assert out == tmp_path / "results"
    with progress.stage("equilibrium"):
        pass
    said = capsys.readouterr()
    assert (said.out, said.err) == (f"results: {tmp_path / 'results'}\n", "")


def test_run_names_its_folder_after_the_scene(scene, pipeline):
    main(["run", str(scene)])
    assert str(pipeline.asked[1]) == "out/mast"


@pytest.mark.parametrize("command", ["run", "check", "explain", "accuracy", "export", "resume"])
def test_help_names_every_command(capsys, command):
    assert main(["--help"]) == 0
    assert command in capsys.readouterr().out
    assert main([command, "--help"]) == 0
    assert ("OUT" if command == "resume" else "SCENE") in capsys.readouterr().out


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"{tensctl.__version__}\n"


def test_as_a_process(tmp_path):
    command = [sys.executable, "-m", "tensctl", "check", str(tmp_path / "nowhere.toml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("tensctl: ")
    assert "Traceback" not in done.stderr


def test_help_loads_no_numerical_library():
    look = "import sys; from tensctl.cli import main; main(['--help']); print([*sys.modules])"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    loaded = ast.literal_eval(done.stdout.splitlines()[-1])
    assert {"numpy", "pydantic"}.isdisjoint(loaded)
    assert "cyclopts" in loaded
