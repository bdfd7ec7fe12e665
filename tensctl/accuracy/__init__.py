"""How far to trust it: error against run time for the user's own scene."""

from tensctl.accuracy.work_precision import Attempt, WorkPrecision, work_precision

__all__ = ["Attempt", "WorkPrecision", "work_precision"]
