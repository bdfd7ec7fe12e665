"""Many variations of one structure at once: parameter sweeps and Monte Carlo.

What members share is made once: topology, the kernel's layout, the bound on frequencies, which scales with stiffness
over mass, omega_k^2 <= omega^2 max(k_k/k) / min(m_k/m). Members run in threads outside Python's lock, each on its own,
so results are those of single runs, bit for bit, whatever the number of workers.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.scene.given import argument, check_kind, real
from tensctl.scene.values import Number
from tensctl.simulation.integrators import Method
from tensctl.simulation.run import Run
from tensctl.simulation.simulate import simulate

if TYPE_CHECKING:
    import xarray

# Scenes want these > 0, and so does a batch.
_POSITIVE = ("stiffness", "rest_lengths", "mass")


@dataclass(frozen=True, eq=False)
class Variations:
    """What differs from member to member; what is None is that of the structure.

    Attributes
    ----------
    stiffness : (b, nt) N/m, or N for law EA
    rest_lengths, damping : (b, nt) m, N s/m
    mass : (b, nr) kg
    forces : (b, N, 3) N
        All constant nodal forces, weight included.
    nodes, velocities : (b, N, 3) m, m/s
        Where members start; the structure's own nodes, at rest, by default.
    """

    stiffness: Float[np.ndarray, "b tendons"] | None = None
    rest_lengths: Float[np.ndarray, "b tendons"] | None = None
    damping: Float[np.ndarray, "b tendons"] | None = None
    mass: Float[np.ndarray, "b rods"] | None = None
    forces: Float[np.ndarray, "b nodes 3"] | None = None
    nodes: Float[np.ndarray, "b nodes 3"] | None = None
    velocities: Float[np.ndarray, "b nodes 3"] | None = None

    @property
    def given(self) -> dict[str, np.ndarray]:
        """Those that vary."""
        named = {field.name: getattr(self, field.name) for field in fields(self)}
        return {
            name: real(f"{name} of the variations", array, "one row of numbers a member", SimulationError)
            for name, array in named.items()
            if array is not None
        }


@dataclass(frozen=True, eq=False)
class Batch:
    """Runs of all members.

    Attributes
    ----------
    time : (t,) s
    nodes, velocities : (b, t, N, 3) m, m/s; NaN for a member that failed
    lengths, tensions : (b, t, nt) m, N
    failures : (b,) str
        Why a member failed; empty when it did not.
    runs : (b,) Run or None
    """

    time: Float[np.ndarray, " t"]
    nodes: Float[np.ndarray, "b t nodes 3"]
    velocities: Float[np.ndarray, "b t nodes 3"]
    lengths: Float[np.ndarray, "b t tendons"]
    tensions: Float[np.ndarray, "b t tendons"]
    failures: tuple[str, ...]
    runs: tuple[Run | None, ...]

    def to_dataset(self) -> xarray.Dataset:
        """All runs as one xarray dataset with a `member` coordinate; members that failed are NaN."""
        import xarray as xr

        good = [k for k, run in enumerate(self.runs) if run is not None]
        parts = [
            run.to_dataset()[["nodes", "velocities", "lengths", "tensions"]] for run in self.runs if run is not None
        ]
        whole = xr.concat(parts, dim=xr.DataArray(good, dims="member", name="member"))
        return whole.reindex(member=np.arange(len(self.runs)))


def simulate_many(
    dynamics: Dynamics,
    variations: Variations,
    *,
    timepts: Sequence[float] | np.ndarray,
    method: Method = "auto",
    tol: float = 1e-10,
    workers: int | None = None,
) -> Batch:
    """Run every variation of a structure from its start, without a controller.

    Parameters
    ----------
    dynamics : Dynamics
        The nominal model.
    variations : Variations
        One row a member.
    timepts : (t,) s
        Times to record; members run to the last.
    method, tol
        As `simulate` has them.
    workers : int, optional
        Threads; as many as there are processors by default.

    Returns
    -------
    Batch
        A member that fails says why in `failures` and stops no other.

    Raises
    ------
    SimulationError
        Variations of no member, of shapes that do not fit the structure, or of values that no member can have.
    """
    check_kind(Dynamics, error=SimulationError, dynamics=dynamics)
    check_kind(Variations, error=SimulationError, variations=variations)
    if workers is not None:
        workers = argument("workers", workers, Number("threads", least=0, whole=True), SimulationError)
    given = variations.given
    count = _count(dynamics, given)
    times = real("timepts", timepts, "finite times in ascending order, s,", SimulationError)
    _ = (
        dynamics.kernel,
        dynamics.fastest_rate,
    )  # made once, here: threads that ask at the same time would each make them

    def member(k: int) -> Run | str:
        row = {name: array[k] for name, array in given.items()}
        start = (
            row.pop("nodes", dynamics.structure.nodes),
            row.pop("velocities", np.zeros_like(dynamics.structure.nodes)),
        )
        try:
            return simulate(dynamics.varied(**row), start, timepts=times, method=method, tol=tol)
        except SimulationError as error:
            return str(error)

    with ThreadPoolExecutor(workers or os.cpu_count() or 1) as pool:
        found = list(pool.map(member, range(count)))
    return _gathered(dynamics, times, found)


def _count(dynamics: Dynamics, given: dict[str, np.ndarray]) -> int:
    structure = dynamics.structure
    by_node = structure.nodes.shape
    by_tendon = (len(structure.tendons),)
    wanted = {
        "stiffness": by_tendon, "rest_lengths": by_tendon, "damping": by_tendon, "mass": (len(structure.rods),),
        "forces": by_node, "nodes": by_node, "velocities": by_node,
    }  # fmt: skip
    if not given:
        raise SimulationError("the variations vary nothing; give stiffness, rest_lengths, mass, nodes, ...")
    counts = {len(array) if array.ndim else 0 for array in given.values()}
    for name, array in given.items():
        if array.shape[1:] != wanted[name] or array.ndim == 0:
            raise SimulationError(
                f"{name} of the variations have shape {array.shape}; one row {wanted[name]} a member is expected."
            )
        _check_values(name, array)
    if len(counts) > 1:
        sizes = ", ".join(f"{name} {len(array)}" for name, array in given.items())
        raise SimulationError(f"the variations have different numbers of members ({sizes}); one number is expected.")
    return counts.pop()


def _check_values(name: str, array: np.ndarray) -> None:
    """Refuse what no member can have; where members start is judged member by member."""
    low, fine = array.min(initial=np.inf), np.isfinite(array).all()
    if name in _POSITIVE and not (fine and low > 0):
        raise SimulationError(f"{name} of the variations go down to {low:g}; finite numbers > 0 are expected.")
    if name == "damping" and not (fine and low >= 0):
        raise SimulationError(f"damping of the variations goes down to {low:g}; finite numbers >= 0 are expected.")
    if name == "forces" and not fine:
        raise SimulationError("forces of the variations have entries that are no finite numbers.")


def _gathered(dynamics: Dynamics, times: np.ndarray, found: list[Run | str]) -> Batch:
    structure = dynamics.structure
    count, nodes, tendons = len(found), (times.size, *structure.nodes.shape), (times.size, len(structure.tendons))
    arrays = {
        name: np.full((count, *shape), np.nan)
        for name, shape in (("nodes", nodes), ("velocities", nodes), ("lengths", tendons), ("tensions", tendons))
    }
    for k, run in enumerate(found):
        if isinstance(run, Run):
            for name, array in arrays.items():
                array[k] = getattr(run, name)
    return Batch(
        time=times,
        **arrays,
        failures=tuple(run if isinstance(run, str) else "" for run in found),
        runs=tuple(run if isinstance(run, Run) else None for run in found),
    )
