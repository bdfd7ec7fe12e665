"""What the user asks: TOML or JSON in, one frozen and checked Scene out."""

from tensctl.scene.load import load_scene
from tensctl.scene.physics import Actuators, Drag, Gravity, Rods, Tendons
from tensctl.scene.recipe import NetworkRecipe, PlanarRecipe, PrismRecipe, ShellRecipe
from tensctl.scene.scene import Scene
from tensctl.scene.stages import (
    AccuracyStage,
    ControllabilityStage,
    EquilibriumStage,
    HistoryRequest,
    LinearizeStage,
    LqgStage,
    LqrStage,
    MpcStage,
    PushRequest,
    ReportStage,
    ScheduleRequest,
    SensorsStage,
    SimulationStage,
    TargetStage,
    WaveRequest,
)
from tensctl.scene.tables import Ratio

__all__ = [
    "AccuracyStage",
    "Actuators",
    "ControllabilityStage",
    "Drag",
    "EquilibriumStage",
    "Gravity",
    "HistoryRequest",
    "LinearizeStage",
    "LqgStage",
    "LqrStage",
    "MpcStage",
    "NetworkRecipe",
    "PlanarRecipe",
    "PrismRecipe",
    "PushRequest",
    "Ratio",
    "ReportStage",
    "Rods",
    "Scene",
    "ScheduleRequest",
    "SensorsStage",
    "ShellRecipe",
    "SimulationStage",
    "TargetStage",
    "Tendons",
    "WaveRequest",
    "load_scene",
]
