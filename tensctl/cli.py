"""The command line: one scene in, a structure, a model, a run or a report out.

Every fault that a user can mend is one line on the error stream and exit code 2. Rooms are imported inside
the commands, so that `--help` and a mistyped scene answer at once.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, Parameter

from tensctl import __version__
from tensctl.errors import TensctlError

if TYPE_CHECKING:
    from tensctl.scene import Scene

USER_FAULT = 2
INTERRUPTED = 130  # 128 + SIGINT, as shells have it

app = App(
    name="tensctl",
    help="Control design for tensegrity structures: one scene in, a controlled structure and its report out.",
    version=__version__,
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
SceneFile = Annotated[Path, Parameter(help="Scene file, TOML or JSON.")]
Out = Annotated[Path, Parameter(name=["--out", "-o"])]
Flag = Annotated[bool, Parameter(negative="")]


@app.command
def run(scene: SceneFile, /, *, out: Out | None = None, quiet: Flag = False) -> None:
    """Go through every stage that the scene asks for, and write the results.

    Parameters
    ----------
    out
        Folder for the results; out/<name of the scene file> by default.
    quiet
        Say nothing but where the results are.
    """
    asked = _load(scene)
    from tensctl.pipeline import run as run_scene
    from tensctl.progress import Progress

    folder = Path("out") / scene.stem if out is None else out
    run_scene(asked, folder, progress=Progress(quiet=quiet))
    print(f"results: {folder}")


@app.command
def resume(
    out: Annotated[Path, Parameter(help="Folder that tensctl run was given.")], /, *, quiet: Flag = False
) -> None:
    """Go on with a run that was stored while it went on (simulation.store = true) and was cut short.

    Parameters
    ----------
    quiet
        Say nothing but where the results are.
    """
    from tensctl.pipeline import go_on
    from tensctl.progress import Progress

    go_on(out, progress=Progress(quiet=quiet))
    print(f"results: {out}")


@app.command
def check(scene: SceneFile, /) -> None:
    """Read the scene, build its structure and say what it has; compute nothing."""
    asked = _load(scene)
    from tensctl.structure import build_members, build_structure

    structure = build_structure(asked)
    if asked.mpc is not None:
        from tensctl.pipeline.feedback import check_mpc

        check_mpc(asked, structure)
    counts = {
        "nodes": len(structure.nodes),
        "rods": len(structure.rods),
        "tendons": len(structure.tendons),
        "inputs": build_members(asked, structure).gearing.size,
    }
    if asked.title:
        print(asked.title)
    for name, count in counts.items():
        print(f"{name:8}{count:6}")


@app.command
def explain(scene: SceneFile, /) -> None:
    """Say which terms the model has or leaves out, and why; which stages are gone through; how controllers are made."""
    asked = _load(scene)
    from tensctl.model import build_dynamics

    print(build_dynamics(asked).explain())
    from tensctl.pipeline import needed

    for words, kind in (("asked for", True), ("gone through for these", None), ("left out at no cost", False)):
        names = [name for name, there in needed(asked).items() if there is kind]
        if names or kind is not None:
            print(f"stages {words}: {', '.join(names) or 'none'}")
    if any(section is not None for section in (asked.lqr, asked.lqg, asked.mpc)):
        from tensctl.pipeline import foretold

        for controller, said in foretold(asked).items():
            print(f"{controller}: {said}")


@app.command
def controllability(scene: SceneFile, /, *, out: Out | None = None) -> None:
    """Say which tendons move what, and what no tendon moves.

    Parameters
    ----------
    out
        File for the same as JSON; the tables are printed in any case.
    """
    asked = _load(scene)
    from tensctl.pipeline import study

    found = study(asked)
    print(found)
    if out is not None:
        from tensctl.analysis.record import write_record

        write_record(found, out)
        print(f"written: {out}")


@app.command
def survey(scene: SceneFile, /) -> None:
    """Plan the way to the scene's target and say what the structure is like along it; simulate nothing."""
    asked = _load(scene)
    from tensctl import synthesis
    from tensctl.model import build_dynamics

    path = synthesis.plan_shape(asked)
    print(path.description)
    print(synthesis.survey(path, build_dynamics(asked)))


@app.command
def accuracy(scene: SceneFile, /, *, out: Out | None = None) -> None:
    """Measure error against run time for the scene's own motion, and of solvers where it has [mpc].

    Parameters
    ----------
    out
        Folder for accuracy.json and accuracy.svg, solvers.json and solvers.svg; tables are printed in any case.
    """
    asked = _load(scene)
    from tensctl.accuracy import work_precision

    measured = work_precision(asked)
    print(measured.table())
    if out is not None:
        from tensctl.report.plot_accuracy import write_accuracy

        write_accuracy(measured, out)
    if asked.mpc is not None and asked.mpc.model == "linear":
        from tensctl.pipeline import measure_solvers

        solvers = measure_solvers(asked)
        print(f"\nsolvers of [mpc]\n{solvers.table()}")
        if out is not None:
            from tensctl.report.plot_solver_accuracy import write_solvers

            write_solvers(solvers, out)
    if out is not None:
        print(f"written: {out}")


@app.command
def export(scene: SceneFile, /, *, out: Out) -> None:
    """Write the linear model as a .mat file, the structure as a MuJoCo model (.xml), or the controller as C (.c).

    Parameters
    ----------
    out
        File to write; .xml is MuJoCo's MJCF, .c the controller with its header beside it, anything else a MATLAB file.
    """
    asked = _load(scene)
    if out.suffix == ".c":
        from tensctl.codegen import export_c
        from tensctl.pipeline import design

        export_c(design(asked), out)
    else:
        from tensctl.interop import write_mat, write_mjcf

        write = write_mjcf if out.suffix == ".xml" else write_mat
        write(asked, out)
    print(f"written: {out}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0, 2 for a user's fault, 130 when interrupted."""
    try:
        app(
            sys.argv[1:] if arguments is None else arguments,
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
    except (TensctlError, CycloptsError) as error:
        return _fault(str(error))
    except OSError as error:
        if error.filename is None:
            raise
        return _fault(f"{error.filename}: {error.strerror}.")
    except KeyboardInterrupt:
        print("tensctl: interrupted", file=sys.stderr)
        return INTERRUPTED
    return 0


def _load(path: Path) -> Scene:
    from tensctl.scene import load_scene

    return load_scene(path)


def _fault(sentence: str) -> int:
    print(f"tensctl: {' '.join(sentence.split())}", file=sys.stderr)
    return USER_FAULT
