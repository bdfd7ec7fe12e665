"""tensctl: control design for tensegrity structures, from one scene to a controlled shell and its report.

Public names load on first use: `import tensctl` itself imports none of the numerical libraries.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from tensctl.accuracy import work_precision
    from tensctl.analysis import (
        HarmonicReport,
        ModalReport,
        Move,
        controllability,
        harmonic_controllability,
        harmonic_observability,
        move,
        observability,
    )
    from tensctl.codegen import CSource, export_c
    from tensctl.errors import (
        EquilibriumError,
        LinearizationError,
        OutputError,
        SceneError,
        SimulationError,
        StructureError,
        SynthesisError,
        TensctlError,
    )
    from tensctl.interop.io_system import TensegritySystem, iosystem
    from tensctl.linear import HarmonicModel, LinearModel, Mix, SecondOrder, harmonic_outputs, harmonics, linearize
    from tensctl.model import Dynamics, build_dynamics
    from tensctl.pipeline import run
    from tensctl.scene import Scene, load_scene
    from tensctl.simulation import (
        ActuatorDemand,
        Batch,
        History,
        Kick,
        Measurement,
        Propagator,
        Push,
        Recovery,
        Run,
        Sanity,
        Schedule,
        Variations,
        Wave,
        actuator_demand,
        inspect_run,
        propagator,
        recovery,
        resume,
        simulate,
        simulate_many,
    )
    from tensctl.statics import (
        Equilibrium,
        Stability,
        admissible_prestress,
        compliance,
        find_equilibria,
        find_equilibrium,
        inverse_statics,
        nearest_shape,
        self_stress,
        stability_orders,
    )
    from tensctl.structure import Structure, build_structure, network, planar, prism, shell
    from tensctl.synthesis import (
        LQG,
        LQR,
        MPC,
        HarmonicLQR,
        OutputMPC,
        SampledLQR,
        Sensors,
        ShapePath,
        Weights,
        harmonic_lqr,
        lqg,
        lqr,
        plan_shape,
        sensors,
        truncate,
        weights,
    )

_HOME = {
    "tensctl.accuracy": ("work_precision",),
    "tensctl.analysis": (
        "HarmonicReport",
        "ModalReport",
        "Move",
        "controllability",
        "harmonic_controllability",
        "harmonic_observability",
        "move",
        "observability",
    ),
    "tensctl.codegen": ("CSource", "export_c"),
    "tensctl.errors": (
        "EquilibriumError",
        "LinearizationError",
        "OutputError",
        "SceneError",
        "SimulationError",
        "StructureError",
        "SynthesisError",
        "TensctlError",
    ),
    "tensctl.interop.io_system": ("TensegritySystem", "iosystem"),
    "tensctl.linear": (
        "HarmonicModel",
        "LinearModel",
        "Mix",
        "SecondOrder",
        "harmonic_outputs",
        "harmonics",
        "linearize",
    ),
    "tensctl.model": ("Dynamics", "build_dynamics"),
    "tensctl.pipeline": ("run",),
    "tensctl.scene": ("Scene", "load_scene"),
    "tensctl.simulation": (
        "ActuatorDemand",
        "Batch",
        "History",
        "Kick",
        "Measurement",
        "Propagator",
        "Push",
        "Recovery",
        "Run",
        "Sanity",
        "Schedule",
        "Variations",
        "Wave",
        "actuator_demand",
        "inspect_run",
        "propagator",
        "recovery",
        "resume",
        "simulate",
        "simulate_many",
    ),
    "tensctl.statics": (
        "Equilibrium",
        "Stability",
        "admissible_prestress",
        "compliance",
        "find_equilibria",
        "find_equilibrium",
        "inverse_statics",
        "nearest_shape",
        "self_stress",
        "stability_orders",
    ),
    "tensctl.structure": ("Structure", "build_structure", "network", "planar", "prism", "shell"),
    "tensctl.synthesis": (
        "LQG",
        "LQR",
        "MPC",
        "OutputMPC",
        "HarmonicLQR",
        "SampledLQR",
        "Sensors",
        "ShapePath",
        "Weights",
        "harmonic_lqr",
        "lqg",
        "lqr",
        "plan_shape",
        "sensors",
        "truncate",
        "weights",
    ),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "LQG",
    "LQR",
    "MPC",
    "ActuatorDemand",
    "Batch",
    "CSource",
    "Dynamics",
    "Equilibrium",
    "EquilibriumError",
    "HarmonicLQR",
    "HarmonicModel",
    "HarmonicReport",
    "History",
    "Kick",
    "LinearModel",
    "LinearizationError",
    "Measurement",
    "Mix",
    "ModalReport",
    "Move",
    "OutputError",
    "OutputMPC",
    "Propagator",
    "Push",
    "Recovery",
    "Run",
    "SampledLQR",
    "Sanity",
    "Scene",
    "SceneError",
    "Schedule",
    "SecondOrder",
    "Sensors",
    "ShapePath",
    "SimulationError",
    "Stability",
    "Structure",
    "StructureError",
    "SynthesisError",
    "TensctlError",
    "TensegritySystem",
    "Variations",
    "Wave",
    "Weights",
    "__version__",
    "actuator_demand",
    "admissible_prestress",
    "build_dynamics",
    "build_structure",
    "compliance",
    "controllability",
    "export_c",
    "find_equilibria",
    "find_equilibrium",
    "harmonic_controllability",
    "harmonic_lqr",
    "harmonic_observability",
    "harmonic_outputs",
    "harmonics",
    "inspect_run",
    "inverse_statics",
    "iosystem",
    "linearize",
    "load_scene",
    "lqg",
    "lqr",
    "move",
    "nearest_shape",
    "network",
    "observability",
    "plan_shape",
    "planar",
    "prism",
    "propagator",
    "recovery",
    "resume",
    "run",
    "self_stress",
    "sensors",
    "shell",
    "simulate",
    "simulate_many",
    "stability_orders",
    "truncate",
    "weights",
    "work_precision",
]


def __getattr__(name: str) -> object:
    """Import a public name from its room when it is first asked for (PEP 562)."""
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'tensctl' has no attribute {name!r}")
    value = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
