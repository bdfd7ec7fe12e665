"""From a scene to its results, stage by stage; only what the scene asks for is done."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tensctl.atomic import replaced_folder
from tensctl.errors import EquilibriumError, OutputError, SceneError, SimulationError
from tensctl.pipeline.clock import Clock
from tensctl.pipeline.motion import demanded, is_driven, simulated
from tensctl.pipeline.results import Results
from tensctl.pipeline.solvers import solvers_measured
from tensctl.pipeline.unfinished import Unfinished
from tensctl.progress import Progress
from tensctl.scene import Scene
from tensctl.scene.given import check_kind, place
from tensctl.statics import Equilibrium, Stability, find_equilibrium

if TYPE_CHECKING:
    from tensctl.accuracy import SolverPrecision
    from tensctl.analysis import Study
    from tensctl.synthesis import LQG, LQR, MPC, SampledLQR, ScheduledLQR


def run(scene: Scene, out: str | Path, *, progress: Progress | None = None) -> Results:
    """Do every stage that a scene asks for and write the results to a folder.

    Parameters
    ----------
    scene : Scene
    out : path
        Folder for `summary.json`, `run.nc` (with a simulation) and `report.html` (with a report). An earlier result
        there is replaced only when everything has been written.
    progress : Progress, optional
        Who is told; nobody by default.

    Returns
    -------
    Results

    Raises
    ------
    TensctlError
        One sentence that says what cannot be done and what to try.
    """
    check_kind(Scene, error=SceneError, scene=scene)
    out = place("out", out, "a folder", OutputError)
    unfinished = Unfinished.under(out)
    if _stores(scene):
        unfinished.refuse_if_begun()
    return _run(scene, out, Clock(progress, unfinished))


def go_on(out: str | Path, *, progress: Progress | None = None) -> Results:
    """Go on with a run that `run` stored and did not end, and write the results as if it had never stopped.

    The stages before the run are gone through again, from the scene that was kept with it; the run itself goes on from
    its last chunk, to the same last bit on the same machine with the same libraries.

    Raises
    ------
    TensctlError
        When the folder holds no unfinished run, and as `run`.
    """
    unfinished = Unfinished.under(out)
    return _run(unfinished.scene(), out, Clock(progress, unfinished))


def _run(scene: Scene, out: str | Path, clock: Clock) -> Results:
    with replaced_folder(out) as folder:
        results = _compute(scene, clock)
        _write(results, folder, clock)
    if _stores(scene) and clock.unfinished is not None:
        clock.unfinished.remove()
    return results


def study(scene: Scene) -> Study:
    """What the tendons of a scene can do, and nothing else: what `tensctl controllability` prints."""
    asked = {} if scene.controllability is None else scene.controllability
    later = dict.fromkeys(("lqr", "lqg", "mpc", "target", "simulation", "accuracy", "report"))
    found = _compute(scene.replaced(**later, controllability=asked), Clock()).study
    assert found is not None
    return found


def design(scene: Scene) -> LQR | SampledLQR | ScheduledLQR | LQG | MPC:
    """The controller that a scene runs, and nothing else: what `tensctl export SCENE -o FILE.c` writes.

    It is the one that `simulation.controller` names, or the only one that the scene has a section for. LQR and LQG
    are designed the dense way: C source holds their matrices. With a target the LQR is scheduled along the path to it.

    Raises
    ------
    SceneError
        When the scene leaves open which.
    """
    named = _controller(scene)
    asked = [name for name in ("lqr", "lqg", "mpc") if getattr(scene, name) is not None]
    if named == "none" and len(asked) != 1:
        given = "none of" if not asked else "more than one of"
        raise SceneError(
            f"the scene has {given} [lqr], [lqg] and [mpc]; give one section, or name one in simulation.controller."
        )
    name = asked[0] if named == "none" else named
    later: dict[str, Any] = dict.fromkeys(("controllability", "simulation", "accuracy", "report"))
    for section in ("lqr", "lqg"):
        stage = getattr(scene, section)
        later[section] = None if stage is None else stage.model_copy(update={"way": "dense"})
    clock = Clock()
    results = _compute(scene.replaced(**later), clock)
    if name == "lqr" and results.path is not None:
        results, name = _scheduled(results, clock), "scheduled"
    found = getattr(results, name)
    assert found is not None
    return found


def needed(scene: Scene) -> dict[str, bool | None]:
    """Every stage, and whether it is asked for; None where another stage needs it."""
    others = {"equilibrium": True, "linearize": _needs_linear(scene)}
    return {name: asked or (None if others.get(name) else False) for name, asked in scene.stages.items()}


def foretold(scene: Scene) -> dict[str, str]:
    """How the controllers of a scene would be made, by section, and why; nothing is designed.

    With a target that is decided by the shape that is planned; what the shape at rest says of it is told.
    """
    from tensctl.pipeline.feedback import check_mpc
    from tensctl.pipeline.outlook import lqg_told, lqr_told, mpc_told

    later = ("controllability", "lqr", "lqg", "sensors", "mpc", "target", "simulation", "accuracy", "report")
    clock = Clock()
    linear = _linearize(_model(_compute(scene.replaced(**dict.fromkeys(later)), clock), clock), clock).linear
    assert linear is not None
    check_mpc(scene, linear.dynamics.structure)
    said = {"LQR": lqr_told(scene, linear), "LQG": lqg_told(scene, linear), "MPC": mpc_told(scene, linear)}
    return {name: words for name, words in said.items() if words is not None}


def measure_solvers(scene: Scene) -> SolverPrecision:
    """Error against run time of every solver for a scene's own predictive controller, and nothing else.

    Raises
    ------
    SceneError
        A scene without `[mpc]`, or with one whose matrices no solver can be set up for.
    """
    if scene.mpc is None:
        raise SceneError("the scene has no [mpc], so no solver is asked for anything; add the section.")
    if not _linear_mpc(scene):
        raise SceneError('mpc.model is "nonlinear"; solvers are measured on the problems of model = "linear".')
    later = dict.fromkeys(("controllability", "lqr", "lqg", "sensors", "simulation", "accuracy", "report"))
    found = solvers_measured(replace(_compute(scene.replaced(**later), Clock()), scene=scene), Clock()).solvers
    assert found is not None
    return found


def _stores(scene: Scene) -> bool:
    return scene.simulation is not None and scene.simulation.store


def _compute(scene: Scene, clock: Clock) -> Results:
    with clock.stage("equilibrium"):
        equilibrium = _held(find_equilibrium(scene), scene)
    results = Results(scene, equilibrium)
    if scene.mpc is not None:
        from tensctl.pipeline.feedback import check_mpc

        check_mpc(scene, equilibrium.structure)
    for asked, stage in (
        (_needs_linear(scene) or scene.simulation is not None or scene.target is not None, _model),
        (_needs_linear(scene), _linearize),
        (scene.controllability is not None, _controllability),
        (scene.target is not None, _plan),
        (scene.target is not None, _survey),
        (scene.lqr is not None, _lqr),
        (scene.target is not None and _controller(scene) == "lqr", _scheduled),
        (scene.lqg is not None, _lqg),
        (scene.mpc is not None, _mpc),
        (scene.simulation is not None, simulated),
        (scene.simulation is not None, _inspect),
        (scene.target is not None or is_driven(scene), demanded),
        (scene.mpc is not None and _controller(scene) == "mpc", _certify),
        (scene.accuracy is not None, _measure),
        (scene.accuracy is not None and _linear_mpc(scene), solvers_measured),
    ):
        if asked:
            results = stage(results, clock)
    return results


def _model(results: Results, clock: Clock) -> Results:
    from tensctl.model import build_dynamics

    with clock.stage("model"):
        return replace(results, dynamics=build_dynamics(results.scene))


def _controller(scene: Scene) -> str:
    return "none" if scene.simulation is None else scene.simulation.controller


def _linear_mpc(scene: Scene) -> bool:
    return scene.mpc is not None and scene.mpc.model == "linear"


def _needs_linear(scene: Scene) -> bool:
    return any(part is not None for part in (scene.linearize, scene.controllability, scene.lqr, scene.lqg, scene.mpc))


def _held(equilibrium: Equilibrium, scene: Scene) -> Equilibrium:
    """Refuse a structure that has collapsed, unless the scene only wants to watch it move."""
    if equilibrium.stable is Stability.NO_PRESTRESS:
        raise EquilibriumError(
            "every tendon is slack at rest: the rest lengths are so long that nothing is taut; "
            "shorten them (tendons.rest_ratio or tendons.rest_length)."
        )
    if equilibrium.stable is Stability.NO and (_needs_linear(scene) or scene.target is not None):
        raise EquilibriumError(
            f"the equilibrium is unstable: its smallest eigenvalue is {equilibrium.smallest:.3g} rad^2/s^2; "
            "shorten the rest lengths, or start from another shape."
        )
    return equilibrium


def _linearize(results: Results, clock: Clock) -> Results:
    from tensctl.linear import Mix, linearize

    assert results.dynamics is not None
    asked = results.scene.linearize
    with clock.stage("linear model"):
        if asked is None:
            return replace(results, linear=linearize(results.dynamics, results.equilibrium, outputs=()))
        mixes = () if asked.mix is None else (Mix(asked.mix),)
        outputs = (*asked.outputs, *mixes)
        linear = linearize(results.dynamics, results.equilibrium, outputs=outputs, on_boundary=asked.on_boundary)
    return replace(results, linear=linear)


def _controllability(results: Results, clock: Clock) -> Results:
    from tensctl.analysis import Study

    assert results.linear is not None
    with clock.stage("controllability"):
        return replace(results, study=Study.of(results.linear, results.scene.controllability))


def _plan(results: Results, clock: Clock) -> Results:
    from tensctl.synthesis import plan_shape

    with clock.stage("shape path"):
        return replace(results, path=plan_shape(results.scene, start=results.equilibrium))


def _survey(results: Results, clock: Clock) -> Results:
    from tensctl.synthesis import survey

    assert results.path is not None
    assert results.dynamics is not None
    with clock.stage("path survey"):
        found = survey(results.path, results.dynamics)
    return replace(results, survey=found)


def _at_target(results: Results):
    """The linear model about the wanted equilibrium."""
    from tensctl.linear import linearize

    assert results.linear is not None
    assert results.dynamics is not None
    if results.path is None:
        return results.linear
    return linearize(results.dynamics, results.wanted, outputs=())


def _lqr(results: Results, clock: Clock) -> Results:
    from tensctl.pipeline.way import lqr_of

    assert results.scene.lqr is not None
    with clock.stage("LQR"):
        found, way = lqr_of(results.scene.lqr, _at_target(results))
    return replace(results, lqr=found, lqr_way=way)


def _scheduled(results: Results, clock: Clock) -> Results:
    from tensctl.pipeline.feedback import design_lqr
    from tensctl.synthesis import scheduled_lqr

    asked = results.scene.lqr
    assert asked is not None
    assert results.path is not None
    assert results.dynamics is not None
    with clock.stage("LQR along the path"):
        found = scheduled_lqr(results.path, results.dynamics, lambda linear: design_lqr(asked, linear))
    return replace(results, scheduled=found)


def _lqg(results: Results, clock: Clock) -> Results:
    from tensctl.pipeline.way import lqg_of

    assert results.scene.lqg is not None
    assert results.scene.sensors is not None
    with clock.stage("LQG"):
        found, way = lqg_of(results.scene.lqg, results.scene.sensors, _at_target(results))
    return replace(results, lqg=found, lqg_way=way)


def _mpc(results: Results, clock: Clock) -> Results:
    from tensctl.pipeline.feedback import design_mpc, design_output_mpc, nonlinear_mpc

    asked, seen = results.scene.mpc, results.scene.sensors
    assert asked is not None
    if asked.model == "nonlinear":
        assert results.dynamics is not None
        with clock.stage("MPC set-up"):
            return replace(results, mpc=nonlinear_mpc(asked, results.dynamics, results.path or results.equilibrium))
    with clock.stage("MPC set-up"):
        if asked.feedback == "states":
            return replace(results, mpc=design_mpc(asked, _at_target(results), results.path))
        assert seen is not None
        assert results.linear is not None
        return replace(results, mpc=design_output_mpc(asked, seen, results.linear, results.path))


def _inspect(results: Results, clock: Clock) -> Results:
    from tensctl.simulation import inspect_run
    from tensctl.simulation.asked import loads_of
    from tensctl.simulation.warn import nearer_than

    assert results.run is not None
    assert results.dynamics is not None
    assert results.scene.simulation is not None
    with clock.stage("sanity"):
        sanity = inspect_run(results.dynamics, results.run, pushes=loads_of(results.scene.simulation))
    target = results.scene.target
    near = None if target is None or target.clearance is None else nearer_than(sanity, target.clearance)
    for sentence in (*sanity.warnings, *(() if near is None else (near,))):
        clock.progress.warn(sentence)
    return replace(results, sanity=sanity)


def _certify(results: Results, clock: Clock) -> Results:
    from tensctl.pipeline.certificate import certify
    from tensctl.simulation.parted import parting_told

    assert results.mpc is not None
    assert results.run is not None
    parting = parting_told(results.run)
    if parting is not None:
        clock.progress.warn(parting)
    with clock.stage("MPC against cvxpy"):
        return replace(results, certificate=certify(results.mpc, results.run))


def _measure(results: Results, clock: Clock) -> Results:
    """Error against run time; without a reference to trust, the other results stand and the report says why."""
    from tensctl.accuracy import WorkPrecision, work_precision

    asked = results.scene.accuracy
    assert asked is not None
    try:
        with clock.stage("accuracy"):
            measured = work_precision(results.scene)
    except SimulationError as error:
        clock.progress.warn(f"accuracy: {error}")
        measured = WorkPrecision((), asked.t_end, float("inf"), wanted=asked.error, failure=str(error))
    return replace(results, accuracy=measured)


def _write(results: Results, folder: Path, clock: Clock) -> None:
    from tensctl.pipeline.summary import summarise

    if results.run is not None:
        with clock.stage("run.nc"):
            results.run.save(folder / "run.nc")
    if results.scene.report is not None:
        from tensctl.pipeline.case import to_case
        from tensctl.report import write_report

        with clock.stage("report"):
            write_report(to_case(results, clock.seconds), folder / "report.html")
    text = json.dumps(summarise(results, clock.seconds), indent=2, allow_nan=False)
    (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
