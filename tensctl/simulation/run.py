"""A recorded run: what moved, what pulled, what was commanded."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from tensctl.errors import OutputError, SimulationError
from tensctl.scene.given import place
from tensctl.simulation.journal import mend
from tensctl.structure import Structure

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, eq=False)
class Run:
    """Everything recorded of one simulation; the same names stand in the netCDF file.

    Attributes
    ----------
    structure : Structure
    time : (t,) s
    nodes, velocities : (t, N, 3) m, m/s
    lengths, tensions, rest_lengths : (t, nt) m, N, m
    inputs : (t, nu) m
        Rest-length changes as they were.
    input_labels : tuple of str
    status : (t,) str
        What the controller said last; empty without one.
    sample_time, solve_time, kkt, relaxed, margin_gap : (s,) s, s, -, N, N
        One entry a control step of a controller that solves problems, as `StepRecord` has them.
    parted : (s,) int
        Tendon at which its prediction and the structure part company there, -1 for none.
    method : str
        Integrator.
    why : str
        Why it was taken.
    evaluations : int
        Right-hand sides computed.
    switches : int
        How often a tendon went slack or taut (counted by the splitting integrator).
    local_errors : float, m
        Sum of the errors that an adaptive integrator estimated of its steps: about how far places may be off at most,
        while motions that start near each other stay near; nan where steps are not judged.
    commands : (t, nu) m, or None
        Rest-length changes as commanded, where actuators lag.
    """

    structure: Structure
    time: Float[np.ndarray, " t"]
    nodes: Float[np.ndarray, "t nodes 3"]
    velocities: Float[np.ndarray, "t nodes 3"]
    lengths: Float[np.ndarray, "t tendons"]
    tensions: Float[np.ndarray, "t tendons"]
    rest_lengths: Float[np.ndarray, "t tendons"]
    inputs: Float[np.ndarray, "t inputs"]
    input_labels: tuple[str, ...]
    status: np.ndarray
    sample_time: Float[np.ndarray, " s"]
    solve_time: Float[np.ndarray, " s"]
    kkt: Float[np.ndarray, " s"]
    relaxed: Float[np.ndarray, " s"]
    margin_gap: Float[np.ndarray, " s"]
    parted: Int[np.ndarray, " s"]
    method: str
    evaluations: int
    switches: int
    why: str = ""
    local_errors: float = np.nan
    commands: Float[np.ndarray, "t inputs"] | None = None

    @property
    def rod_drift(self) -> float:
        """Largest relative change of a rod's length over the run."""
        ends = self.nodes[:, self.structure.rods]
        lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
        return float(np.abs(lengths / self.structure.rod_lengths - 1).max(initial=0.0))

    @property
    def bounded(self) -> np.ndarray:
        """Of each control step, whether the work of its solver was over before the optimum, (s,) bool.

        What was said is known at recorded times; a step between them goes by the next one.
        """
        rows = np.searchsorted(np.round(self.time, 12), np.round(self.sample_time, 12))
        said = self.status[np.minimum(rows, self.time.size - 1)].astype(str)
        return np.char.endswith(said, " bounded")

    def distance_to(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, " t"]:
        """Largest distance of any node to the wanted ones at each time, m."""
        return np.linalg.norm(self.nodes - nodes, axis=2).max(axis=1)

    def verify(self, tol: float = 1e-12) -> None:
        """Check that rods kept their lengths and that no tendon pushed.

        Raises
        ------
        SimulationError
            With the largest misfit.
        """
        if not self.rod_drift <= tol:
            raise SimulationError(f"a rod's length drifted by {self.rod_drift:.1e} of itself; {tol:.0e} is expected.")
        if self.tensions.min(initial=0.0) < 0:
            raise SimulationError(f"a tendon pushed with {-self.tensions.min():.3g} N; tensions are >= 0.")

    def to_dataset(self) -> xarray.Dataset:
        """The run as an xarray dataset with labelled nodes and tendons, and units."""
        import xarray as xr

        by_tendon = ("time", "tendon")
        variables = {
            "nodes": (("time", "node", "axis"), self.nodes, {"units": "m"}),
            "velocities": (("time", "node", "axis"), self.velocities, {"units": "m/s"}),
            "lengths": (by_tendon, self.lengths, {"units": "m"}),
            "tensions": (by_tendon, self.tensions, {"units": "N"}),
            "rest_lengths": (by_tendon, self.rest_lengths, {"units": "m"}),
            "inputs": (("time", "input"), self.inputs, {"units": "m", "long_name": "rest-length change, > 0 shortens"}),
            "status": ("time", self.status.astype(object), {"long_name": "solver status"}),
            "solve_time": ("sample", self.solve_time, {"units": "s"}),
            "kkt": ("sample", self.kkt, {"long_name": "recomputed KKT residual"}),
            "relaxed": ("sample", self.relaxed, {"units": "N", "long_name": "tension floor given way by"}),
            "margin_gap": ("sample", self.margin_gap, {"units": "N", "long_name": "predicted less measured tension"}),
            "parted": ("sample", self.parted, {"long_name": "tendon that prediction was wrong of, -1 for none"}),
            "structure": ((), json.dumps(self.structure.as_recipe()), {"long_name": "a scene's [structure], as JSON"}),
        }
        if self.commands is not None:
            said = {"units": "m", "long_name": "commanded rest-length change"}
            variables["commands"] = (("time", "input"), self.commands, said)
        coordinates = {
            "time": ("time", self.time, {"units": "s"}),
            "node": list(self.structure.node_labels),
            "axis": ["x", "y", "z"],
            "tendon": list(self.structure.tendon_labels),
            "input": list(self.input_labels),
            "sample": ("sample", self.sample_time, {"units": "s"}),
        }
        attributes = {
            "method": self.method,
            "why": self.why,
            "evaluations": self.evaluations,
            "switches": self.switches,
            "local_errors": self.local_errors,
        }
        return xr.Dataset(variables, coordinates, attributes)

    def save(self, path: str | Path) -> Path:
        """Write the run as netCDF.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        path = place("path", path, 'a file such as "run.nc"', OutputError)
        try:
            mend(path)
            self.to_dataset().to_netcdf(path, engine="h5netcdf")
        except OSError as error:
            raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from None
        return path

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a run that `save` wrote, or `simulate` with `store`: whole, or up to its last chunk.

        Raises
        ------
        SimulationError
            When the file holds no run.
        """
        from tensctl.simulation.read import read_run

        return read_run(place("path", path, "a file of Run.save or of simulate(..., store=...)", SimulationError))
