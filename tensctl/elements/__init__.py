"""The physics, stated once: what a rod and a tendon store, pull and how they move."""

from tensctl.elements.assembly import TendonTerms, scatter_blocks, tendon_terms
from tensctl.elements.cables import CableTerms, length_map, unit_vectors
from tensctl.elements.gaps import RodGaps, rod_gaps
from tensctl.elements.jointed import JointedManifold
from tensctl.elements.manifold import RodManifold
from tensctl.elements.potential import Potential, PotentialPoint
from tensctl.elements.rod import Hold, rod_acceleration, rod_energy
from tensctl.elements.spread_mass import spread
from tensctl.elements.tendon import tendon_energy, tendon_statics, tendon_tension

__all__ = [
    "CableTerms",
    "Hold",
    "JointedManifold",
    "Potential",
    "PotentialPoint",
    "RodGaps",
    "RodManifold",
    "TendonTerms",
    "length_map",
    "rod_acceleration",
    "rod_energy",
    "rod_gaps",
    "scatter_blocks",
    "spread",
    "tendon_energy",
    "tendon_statics",
    "tendon_tension",
    "tendon_terms",
    "unit_vectors",
]
