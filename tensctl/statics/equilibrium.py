"""Where a scene rests: the nodes at which tendons, loads, rods and ground balance ([S] 5.23, [W] section 3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tensctl.elements import Potential, PotentialPoint
from tensctl.errors import EquilibriumError
from tensctl.scene import Scene
from tensctl.scene.given import check_kind, real
from tensctl.statics import balance
from tensctl.statics.definiteness import Definiteness
from tensctl.statics.harmonics import harmonic_definiteness, harmonic_smallest
from tensctl.statics.newton import Newton
from tensctl.statics.search import search
from tensctl.statics.sector import Sector, SectorPoint
from tensctl.statics.soundness import check_sound, unheld
from tensctl.statics.stability import (
    Spectrum,
    Stability,
    eigenvalue_tolerance,
    judge,
    spectrum,
    unknown_force,
    whole_definiteness,
)
from tensctl.statics.symmetry import CyclicSymmetry
from tensctl.structure import Structure, lengths

# Above this residual the nodes are no equilibrium, unless rounding of the nodes alone leaves more than a tenth of it.
_ACCEPTABLE = 1e-9
_ROUNDINGS = 10.0
# Nodes this far from symmetric (over the size) are judged at full size.
_SYMMETRIC = 1e-9
# Up to this many degrees of freedom all modes cost less than 20 ms, and nobody waits for the smallest one.
_ALL_MODES_ARE_CHEAP = 200


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A shape and prestress at rest; all other numbers are recomputed from nodes and rest lengths.

    Attributes
    ----------
    potential : Potential
        Structure, materials and loads.
    nodes : (N, 3) m
    rest_lengths : (nt,) m
        L0 - u of every tendon.
    iterations : int
        Newton steps that found it, in a sector and on the whole structure.
    symmetry : CyclicSymmetry or None
        The symmetry by which it was found in one sector.
    """

    potential: Potential
    nodes: Float[np.ndarray, "nodes 3"]
    rest_lengths: Float[np.ndarray, " tendons"]
    iterations: int
    symmetry: CyclicSymmetry | None = None

    @property
    def way(self) -> str:
        """How it was found, in words."""
        if self.symmetry is None:
            return "whole structure"
        return f"one of {self.symmetry.order} sectors (symmetric to {self.symmetry.mismatch:.0e}), checked on all"

    @property
    def structure(self) -> Structure:
        """The structure that rests."""
        return self.potential.structure

    @cached_property
    def point(self) -> PotentialPoint:
        """The potential and its derivatives at the equilibrium."""
        return self.potential.at(self.nodes, self.rest_lengths)

    @cached_property
    def lengths(self) -> Float[np.ndarray, " tendons"]:
        """Tendon lengths, m."""
        return self.structure.lengths_at(self.nodes)

    @property
    def tensions(self) -> Float[np.ndarray, " tendons"]:
        """Tendon tensions, N, >= 0."""
        return self.point.terms.tensions

    @property
    def inputs(self) -> Float[np.ndarray, " inputs"]:
        """Rest-length change u = L0 - L of the acting tendons, or of the motors that drive them, m, > 0 shortens."""
        return self.potential.members.inputs_of(self.rest_lengths)

    @cached_property
    def rod_forces(self) -> Float[np.ndarray, " rods"]:
        """Axial rod forces, N, > 0 in compression."""
        return balance.rod_forces(self.point)

    @cached_property
    def force_densities(self) -> Float[np.ndarray, " tendons"]:
        """Tension over length of each tendon, gamma of [W], N/m; of a cable over its whole length."""
        return self.tensions / np.where(self.lengths > 0, self.lengths, np.inf)

    @cached_property
    def rod_force_densities(self) -> Float[np.ndarray, " rods"]:
        """Force over length of each rod, lambda of [W], N/m, > 0 in compression."""
        return self.rod_forces / self.structure.rod_lengths

    @property
    def energy(self) -> float:
        """Elastic energy less the work of loads since the initial nodes, J."""
        return self.point.energy

    @cached_property
    def residual(self) -> float:
        """Largest unbalanced nodal force on the manifold over the largest tension or load."""
        return balance.residual(self.point)

    @property
    def attainable(self) -> float:
        """Residual that rounding of the nodes alone leaves."""
        return balance.attainable(self.point)

    @cached_property
    def spectrum(self) -> Spectrum:
        """Modes of vibration about the equilibrium: all up to 2000 degrees of freedom, the lowest 20 beyond."""
        return spectrum(self.point)

    @property
    def omega2(self) -> Float[np.ndarray, " modes"]:
        """Squared natural frequencies, rad^2/s^2, ascending, rigid-body zeros included (see `spectrum`)."""
        return np.sort(self.spectrum.omega2)

    @cached_property
    def smallest(self) -> float:
        """Smallest eigenvalue that is no rigid-body motion, rad^2/s^2."""
        if self._sector is not None and self.potential.manifold.size > _ALL_MODES_ARE_CHEAP:
            return harmonic_smallest(self._sector, self.tolerance)[0]
        if "spectrum" in self.__dict__ or self.potential.manifold.size <= _ALL_MODES_ARE_CHEAP:
            return self.spectrum.smallest
        return spectrum(self.point, 1).smallest

    @cached_property
    def tolerance(self) -> float:
        """Size below which an eigenvalue is rounding, rad^2/s^2."""
        return eigenvalue_tolerance(self.point)

    @cached_property
    def definiteness(self) -> Definiteness:
        """Counts of negative and undecided eigenvalues of the scaled Hessian, from which `stable` follows."""
        return whole_definiteness(self.point) if self._sector is None else self._by_harmonics(self._sector)

    @cached_property
    def stable(self) -> Stability:
        """Yes, no, undecided, or "no prestress"; true only for yes. Of a planar structure it is judged in its plane."""
        return judge(self.point, self.definiteness)

    def _by_harmonics(self, sector: SectorPoint) -> Definiteness:
        return harmonic_definiteness(sector, unknown_force(self.point))

    @cached_property
    def _sector(self) -> SectorPoint | None:
        """The sector's point, if these nodes and rest lengths have the symmetry."""
        if self.symmetry is None or self.symmetry.deviation(self.nodes) > _SYMMETRIC:
            return None
        sector = Sector.of(self.potential, self.symmetry, self.rest_lengths)
        return sector.at(sector.restrict(self.nodes))

    def verify(self, tol: float = _ACCEPTABLE) -> None:
        """Check force balance and rod lengths against the structure.

        Raises
        ------
        EquilibriumError
            With the residual reached.
        """
        if not self.residual <= max(tol, _ROUNDINGS * self.attainable):
            raise EquilibriumError(
                f"the nodes are no equilibrium: {self.residual:.1e} of the largest force is left over, "
                f"at most {tol:.0e} is expected."
            )
        stretch = np.abs(self.structure.rod_lengths - lengths(self.nodes, self.structure.rods)).max(initial=0.0)
        size = self.structure.rod_lengths.max(initial=1.0)
        if stretch > 1e-12 * size:
            raise EquilibriumError(f"a rod changed its length by {stretch:.1e} m; rods are rigid.")


def find_equilibrium(
    scene: Scene, *, start: Float[np.ndarray, "nodes 3"] | None = None, inputs: np.ndarray | None = None
) -> Equilibrium:
    """Find where a scene comes to rest.

    Parameters
    ----------
    scene : Scene
    start : (N, 3) array, m, optional
        Nodes to start from, with the structure's rod lengths; the structure's own nodes by default.
    inputs : (nu,) array, m, optional
        Rest-length change u of the acting tendons; zero by default.

    Returns
    -------
    Equilibrium
        `stable` says whether it holds; with every tendon slack it is "no prestress".

    Raises
    ------
    EquilibriumError
        An argument of another kind, or no balance that is reached, with the residual and what to try.
    """
    check_kind(Scene, error=EquilibriumError, scene=scene)
    if start is not None:
        start = real("start", start, "an (N, 3) array of nodes, m,", EquilibriumError)
    if inputs is not None:
        inputs = real("inputs", inputs, "an array of rest-length changes, (nu,) m,", EquilibriumError)
    return settle(Potential.of(scene), start=start, inputs=inputs, newton=newton_of(scene))


def newton_of(scene: Scene) -> Newton:
    """The settings of a scene's search."""
    settings = scene.equilibrium
    return Newton() if settings is None else Newton(settings.tol, settings.max_iterations)


def settle(
    potential: Potential,
    *,
    start: Float[np.ndarray, "nodes 3"] | None = None,
    inputs: np.ndarray | None = None,
    newton: Newton | None = None,
    symmetric: bool = True,
) -> Equilibrium:
    """`find_equilibrium` for a potential that is already built.

    Parameters
    ----------
    symmetric : bool
        Whether a cyclic symmetry may be used where there is one.
    """
    newton = Newton() if newton is None else newton
    check_sound(potential)
    members = potential.members
    rest = members.rest_lengths.copy() if inputs is None else members.shortened(np.asarray(inputs, float))
    nodes = None if start is None else np.asarray(start, float)
    found = search(potential, nodes, rest, newton, symmetric=symmetric)
    equilibrium = Equilibrium(potential, found.nodes, rest, found.iterations, found.symmetry)
    allowed = max(_ACCEPTABLE, newton.tol, _ROUNDINGS * equilibrium.attainable)
    if not equilibrium.residual <= allowed:
        raise EquilibriumError(
            f"no equilibrium was reached in {found.iterations} steps: {equilibrium.residual:.1e} of the largest force "
            f"is left over; {_what_to_try(equilibrium)}"
        )
    return equilibrium


def _what_to_try(equilibrium: Equilibrium) -> str:
    potential = equilibrium.potential
    if potential.members.forces.any() and not potential.structure.held.any():
        return (
            f"the loads leave {unheld(potential, equilibrium.nodes)} there; "
            "check that loads are held by pins, or add loads that balance them."
        )
    return "check that loads are held by pins, or start nearer to the shape that is meant."
