"""Solvers of a scene's own predictive controller, measured on the problems of its closed loop."""

from __future__ import annotations

from dataclasses import replace

from tensctl.pipeline.clock import Clock
from tensctl.pipeline.results import Results
from tensctl.scene import AccuracyStage


def solvers_measured(results: Results, clock: Clock) -> Results:
    """Run the scene under its predictive controller, and measure every solver on problems of that run.

    Start and loads are those of `[simulation]`, whatever controls it there; without the section the structure is
    released from its initial nodes for `accuracy.t_end`.
    """
    from tensctl.accuracy import solver_precision
    from tensctl.simulation.asked import loads_of, start_of
    from tensctl.synthesis import MPC

    scene, mpc = results.scene, results.mpc
    assert isinstance(mpc, MPC)
    measured = AccuracyStage() if scene.accuracy is None else scene.accuracy
    start, pushes, t_end = results.structure.nodes, [], measured.t_end
    if scene.simulation is not None:
        asked = scene.simulation.model_copy(update={"controller": "mpc"})
        start, pushes = start_of(asked, mpc.linear.dynamics, results.equilibrium), loads_of(asked)
        t_end = asked.t_end
    with clock.stage("solvers"):
        found = solver_precision(mpc, start, t_end=t_end, pushes=pushes, budget=measured.budget)
    return replace(results, solvers=found)
