"""How a structure is steered: Riccati equations, LQR, shape paths and predictive control."""

from tensctl.synthesis.condensed import Condensed, condense
from tensctl.synthesis.harmonic_kalman import HarmonicKalman, harmonic_kalman
from tensctl.synthesis.harmonic_lqg import HarmonicLQG, harmonic_lqg
from tensctl.synthesis.harmonic_lqr import HarmonicLQR, harmonic_lqr
from tensctl.synthesis.harmonic_lqr_sampled import HarmonicSampledLQR
from tensctl.synthesis.harmonic_truncate import HarmonicReduced, harmonic_truncate
from tensctl.synthesis.harmonic_weights import harmonic_weights
from tensctl.synthesis.lqg import LQG, lqg
from tensctl.synthesis.lqr import LQR, lqr
from tensctl.synthesis.lqr_sampled import SampledLQR
from tensctl.synthesis.lqr_scheduled import ScheduledLQR, scheduled_lqr
from tensctl.synthesis.mpc import MPC
from tensctl.synthesis.mpc_output import OutputMPC
from tensctl.synthesis.mpc_weights import Weights
from tensctl.synthesis.nonlinear_mpc import NonlinearMPC, NonlinearRecord
from tensctl.synthesis.pace import too_quick
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.plan import plan_shape
from tensctl.synthesis.riccati import Riccati, care, dare
from tensctl.synthesis.sensors import Reading, Sensors, sensors
from tensctl.synthesis.signal import Courses
from tensctl.synthesis.stabilisable import LeftOut
from tensctl.synthesis.step_record import StepRecord
from tensctl.synthesis.survey import PathSurvey, Station, survey
from tensctl.synthesis.target import Feature, Linear, Twist, shell_height, shell_rings
from tensctl.synthesis.tilt import Tilt
from tensctl.synthesis.truncate import ReducedModel, truncate
from tensctl.synthesis.weights import Cost, weights

__all__ = [
    "LQG",
    "LQR",
    "MPC",
    "Condensed",
    "Cost",
    "Courses",
    "Feature",
    "HarmonicKalman",
    "HarmonicLQG",
    "HarmonicLQR",
    "HarmonicReduced",
    "HarmonicSampledLQR",
    "LeftOut",
    "Linear",
    "NonlinearMPC",
    "NonlinearRecord",
    "OutputMPC",
    "PathSurvey",
    "Reading",
    "ReducedModel",
    "Riccati",
    "SampledLQR",
    "ScheduledLQR",
    "Sensors",
    "ShapePath",
    "Station",
    "StepRecord",
    "Tilt",
    "Twist",
    "Weights",
    "care",
    "condense",
    "dare",
    "harmonic_kalman",
    "harmonic_lqg",
    "harmonic_lqr",
    "harmonic_truncate",
    "harmonic_weights",
    "lqg",
    "lqr",
    "plan_shape",
    "scheduled_lqr",
    "sensors",
    "shell_height",
    "shell_rings",
    "survey",
    "too_quick",
    "truncate",
    "weights",
]
