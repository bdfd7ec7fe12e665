"""The stages that move the structure, in one go or taken up again after a break, and tell what actuators give."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tensctl.pipeline.clock import Clock
from tensctl.pipeline.results import Results

if TYPE_CHECKING:
    from tensctl.scene import Scene
    from tensctl.simulation import Run


def simulated(results: Results, clock: Clock) -> Results:
    """The run that the scene asks for."""
    from tensctl.simulation import control_steps, simulate
    from tensctl.simulation.asked import loads_of, schedule_of, start_of

    asked, dynamics = results.scene.simulation, results.dynamics
    assert asked is not None
    assert dynamics is not None
    regulator = results.lqr if results.scheduled is None else results.scheduled
    controller = {"none": None, "lqr": regulator, "lqg": results.lqg, "mpc": results.mpc}[asked.controller]
    steps = 1 if controller is None else control_steps(asked.t_end, controller.dt or asked.t_end)
    with clock.stage("simulation"):
        progress = clock.progress.track(steps, "closed loop")

        def whole(store: Path | None = None) -> Run:
            return simulate(
                dynamics,
                start_of(asked, dynamics, results.equilibrium),
                controller=controller,
                t_end=asked.t_end,
                rate_max=None if results.scene.mpc is None else results.scene.mpc.rate_max,
                pushes=loads_of(asked),
                schedule=schedule_of(asked),
                method=asked.method,
                tol=asked.tol,
                store=store,
                chunk=asked.chunk,
                progress=progress,
            )

        if asked.store and clock.unfinished is not None:
            run = clock.unfinished.run(results.scene, dynamics, controller, progress, whole)
        else:
            run = whole()
    return replace(results, run=run)


def is_driven(scene: Scene) -> bool:
    """Whether a controller or a schedule moves rest lengths in the run."""
    asked = scene.simulation
    return asked is not None and (asked.controller != "none" or bool(asked.schedule))


def demanded(results: Results, clock: Clock) -> Results:
    """What actuators have to give in the run that they drive, or along the path where none is driven."""
    from tensctl.simulation import actuator_demand
    from tensctl.simulation.asked import loads_of

    asked = results.scene.simulation
    with clock.stage("actuators"):
        if is_driven(results.scene):
            assert results.run is not None
            assert asked is not None
            demand = actuator_demand(results.run, results.dynamics, pushes=loads_of(asked))
        else:
            assert results.path is not None
            demand = actuator_demand(results.path)
    if demand.stalls:
        clock.progress.warn(demand.stalls)
    results = replace(results, demand=demand)
    if results.overpowered:
        clock.progress.warn(results.overpowered)
    return results
