"""What is built: nodes, rods, tendons and the ground, from a recipe or by hand."""

from tensctl.structure.build import build_structure
from tensctl.structure.cables import refuse_cables
from tensctl.structure.gearing import Gearing
from tensctl.structure.labels import by_label, matches, select
from tensctl.structure.members import Law, Members, build_members, nodal_weight
from tensctl.structure.network import network, planar
from tensctl.structure.pins import refuse_partial
from tensctl.structure.prism import prism
from tensctl.structure.shell import shell
from tensctl.structure.structure import Structure, lengths

__all__ = [
    "Gearing",
    "Law",
    "Members",
    "Structure",
    "build_members",
    "build_structure",
    "by_label",
    "lengths",
    "matches",
    "network",
    "nodal_weight",
    "planar",
    "prism",
    "refuse_cables",
    "refuse_partial",
    "select",
    "shell",
]
