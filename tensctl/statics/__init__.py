"""Where a structure rests, and whether it stays there."""

from tensctl.statics.equilibrium import Equilibrium, find_equilibrium, settle
from tensctl.statics.newton import Newton
from tensctl.statics.rigid import RigidMotions, mass_centre, rigid_motions
from tensctl.statics.stability import Spectrum, Stability, judge, spectrum

__all__ = [
    "Equilibrium",
    "Newton",
    "RigidMotions",
    "Spectrum",
    "Stability",
    "find_equilibrium",
    "judge",
    "mass_centre",
    "rigid_motions",
    "settle",
    "spectrum",
]
