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
    WaveRequest,
)
from tensctl.scene.tables import Ratio
from tensctl.scene.target import TargetStage, WantedShape, Waypoint

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
    "WantedShape",
    "WaveRequest",
    "Waypoint",
    "load_scene",
]
