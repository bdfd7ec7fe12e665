"""How far to trust it: error against run time for the user's own scene."""

from tensctl.accuracy.result import Attempt, WorkPrecision
from tensctl.accuracy.work_precision import work_precision

__all__ = ["Attempt", "WorkPrecision", "work_precision"]
