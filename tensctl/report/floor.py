"""What became of the tension floor: what the structure saw, and where the controller had to let the floor give way."""

from dataclasses import dataclass

import numpy as np

from tensctl.report.case import RELAXED_MORE_THAN, Case
from tensctl.report.numbers import number, plural


@dataclass(frozen=True)
class FloorStory:
    """The floor's fate in one run.

    Attributes
    ----------
    floor, least : float
        Least tension asked for, least tension that came about, N.
    tendon : str
        Label of the tendon that had it.
    time : float
        When, s.
    times, times_below : int
        Recorded times, and those at which a tendon was below the floor.
    steps, relaxed : int
        Control steps, and those at which the controller planned with a lower floor.
    relaxed_most : float
        How much lower at most, N.
    """

    floor: float
    least: float
    tendon: str
    time: float
    times: int
    times_below: int
    steps: int
    relaxed: int
    relaxed_most: float

    @property
    def kept(self) -> bool:
        """True when no recorded tension was below the floor."""
        return self.times_below == 0

    def told(self) -> str:
        """The story in two sentences: what happened, and what the controller knew of it."""
        least = f"Least tension: {number(self.least, 3)} N in {self.tendon} at {number(self.time, 3)} s"
        below = f"below the floor at {self.times_below} of {plural(self.times, 'recorded time')}"
        happened = f"{least}; {'never below the floor' if self.kept else below}."
        if not self.steps:
            return happened
        if not self.relaxed:
            return f"{happened} The controller planned with the whole floor at every step."
        steps = f"{self.relaxed} of {plural(self.steps, 'step')}"
        lower = f"by at most {number(self.relaxed_most, 3)} N"
        return f"{happened} Ticks: the controller had to plan with a lower floor at {steps}, {lower}."


def floor_story(case: Case) -> FloorStory | None:
    """None without a run or without a floor."""
    run = case.run
    floor = None if case.limits is None else case.limits.tension_min
    if run is None or floor is None or not np.isfinite(run.tensions).any():
        return None
    floored = None if case.limits is None else case.limits.floored
    floored = np.arange(run.tensions.shape[1]) if floored is None else floored
    watched = run.tensions[:, floored]
    moment, place = np.unravel_index(np.nanargmin(watched), watched.shape)
    tendon = floored[place]
    below = (watched < floor - RELAXED_MORE_THAN).any(axis=1)
    return FloorStory(
        floor=floor,
        least=float(run.tensions[moment, tendon]),
        tendon=case.structure.tendon_labels[int(tendon)],
        time=float(run.time[moment]),
        times=len(run.time),
        times_below=int(np.count_nonzero(below)),
        steps=len(run.relaxed),
        relaxed=int(np.count_nonzero(run.relaxed > RELAXED_MORE_THAN)),
        relaxed_most=float(np.max(run.relaxed, initial=0.0)),
    )
