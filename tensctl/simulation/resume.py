"""A run that was cut short goes on from what it stored, as if it had never stopped."""

from __future__ import annotations

from pathlib import Path

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.scene.given import check_kind, place
from tensctl.simulation.checked import check_counter
from tensctl.simulation.controller import Controller, remember
from tensctl.simulation.course import Counter, follow, set_out
from tensctl.simulation.run import Run
from tensctl.simulation.store import Store, read_stored


def resume(
    dynamics: Dynamics,
    store: str | Path,
    *,
    controller: Controller | None = None,
    progress: Counter | None = None,
) -> Run:
    """Go on with a run that was stored, from the end of its last chunk; the file then equals that of a run in one go.

    Parameters
    ----------
    dynamics : Dynamics
        Of the same scene; times, loads, schedule, method and tol are in the file.
    store : path
        What `simulate` was given as `store`.
    controller : optional
        The controller of the run. It offers `state()`, a dict of arrays that holds all that it remembers, and
        `restore(state)`: LQR and MPC do.

    Returns
    -------
    Run
        The last chunk.

    Raises
    ------
    SimulationError
        No stored run, a complete one, one of another structure, or one whose controller cannot go on.
    OutputError
        When the file cannot be written.
    """
    check_kind(Dynamics, error=SimulationError, dynamics=dynamics)
    check_counter(progress)
    path = place("store", store, "what simulate was given as store, a file,", SimulationError)
    stored = read_stored(path, dynamics)
    state, request = stored.state, stored.request
    if (request.period is None) != (controller is None):
        held = "no controller" if request.period is None else "a controller"
        raise SimulationError(f"{path} was recorded with {held}; resume it with the same.")
    moving, course = set_out(dynamics, request, (state["q"], state["v"]), state["start"])
    moving.restore(state, stored.count, stored.status)
    if controller is not None:
        remember(controller, state)
    return follow(moving, course, controller, progress, Store(path, dynamics, request, begun=True), int(state["edge"]))
