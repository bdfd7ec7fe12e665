"""What a path is like on the way: how stiff, how taut, how clear and how well driven each planned equilibrium is.

frequency   lowest of the flexible modes, Hz
stiffness   1 / largest eigenvalue of a node's 3 x 3 static compliance, N/m: the softest node in its softest direction
tension     lowest, N, at rest and as the path moves through, with the rods' inertia
clearance   least distance of two rods' surfaces, m
drive       least gain of a flexible mode over the largest (`analysis.modal`): 0 where one is driven by no input
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.analysis import controllability
from tensctl.linear import linearize
from tensctl.model import Dynamics
from tensctl.scene.given import check_kind
from tensctl.statics import Equilibrium, compliance
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.rod_room import nearest
from tensctl.threads import one_blas_thread


@dataclass(frozen=True)
class Station:
    """One planned equilibrium.

    Attributes
    ----------
    time : float, s
        When the path is there.
    frequency : float, Hz
    stiffness : float, N/m
    softest : str
        The node that has it.
    tension : float, N
        Lowest at rest, of tendons that are not between two pinned nodes.
    slackest : str
        The tendon that has it.
    moving_tension : float, N
        Lowest as the path moves through; negative where a motion is too fast for the prestress.
    clearance : float, m
        Infinite without a pair of rods.
    nearest : str
        The two rods.
    drive : float
    undriven : int
        Flexible modes that no input drives.
    """

    time: float
    frequency: float
    stiffness: float
    softest: str
    tension: float
    slackest: str
    moving_tension: float
    clearance: float
    nearest: str
    drive: float
    undriven: int


@dataclass(frozen=True, eq=False)
class PathSurvey:
    """Every planned equilibrium of a path; prints as a table.

    Attributes
    ----------
    stations : tuple of Station
        First to last; `survey.of("frequency")` is one number of all.
    """

    stations: tuple[Station, ...]

    def of(self, name: str) -> Float[np.ndarray, " k"]:
        """One number of every station, by the name of its attribute."""
        return np.array([getattr(station, name) for station in self.stations])

    @property
    def time(self) -> Float[np.ndarray, " k"]:
        """When the path is at each station, s."""
        return self.of("time")

    def worst(self, name: str) -> Station:
        """The station where a number is least."""
        return self.stations[int(self.of(name).argmin())]

    def __str__(self) -> str:
        """The table as aligned text."""
        head = (
            f"{'time, s':>8}{'lowest mode, Hz':>17}{'softest node, N/m':>28}{'lowest tension, N':>28}"
            f"{'moving':>9}{'nearest rods, m':>29}{'drive':>9}"
        )
        return "\n".join([head, *(_row(station) for station in self.stations)])


def _row(s: Station) -> str:
    drive = f"{s.drive:9.2g}" + (f" ({s.undriven} undriven)" if s.undriven else "")
    return (
        f"{s.time:8.3f}{s.frequency:17.4f}{s.stiffness:16.2f} {s.softest:<11}{s.tension:16.3f} {s.slackest:<11}"
        f"{s.moving_tension:9.3f}{s.clearance:11.4f} {s.nearest:<17}{drive}"
    )


@one_blas_thread()
def survey(path: ShapePath, dynamics: Dynamics) -> PathSurvey:
    """Look over every planned equilibrium of a path.

    Parameters
    ----------
    path : ShapePath
    dynamics : Dynamics
        Of the path's scene.

    Raises
    ------
    EquilibriumError
        Where a motion has no stiffness.
    """
    check_kind(ShapePath, path=path)
    check_kind(Dynamics, dynamics=dynamics)
    times = path.time
    return PathSurvey(tuple(_station(path, dynamics, e, t) for e, t in zip(path.equilibria, times, strict=True)))


def _station(path: ShapePath, dynamics: Dynamics, rest: Equilibrium, time: float) -> Station:
    linear = linearize(dynamics, rest, outputs=(), on_boundary="taut")
    modes = [mode for mode in controllability(linear).modes if mode.kind == "flexible"]
    gains = np.array([mode.gain for mode in modes])
    stiffness, softest = _softest(rest)
    kept = np.flatnonzero(~rest.structure.grounded_tendons)
    slackest = int(kept[rest.tensions[kept].argmin()])
    clearance, pair = nearest(rest)
    return Station(
        time=float(time),
        frequency=min((mode.frequency for mode in modes), default=0.0),
        stiffness=stiffness,
        softest=softest,
        tension=float(rest.tensions[slackest]),
        slackest=rest.structure.tendon_labels[slackest],
        moving_tension=float(path.tensions_at(time)[kept].min()),
        clearance=clearance,
        nearest=pair,
        drive=float(gains.min(initial=np.inf) / gains.max(initial=1e-300)) if modes else 0.0,
        undriven=sum(mode.verdict == "no" for mode in modes),
    )


def _softest(rest: Equilibrium) -> tuple[float, str]:
    """Least stiffness of a node, N/m, and which node it is."""
    whole = compliance(rest)
    count = len(rest.nodes)
    blocks = whole.reshape(count, 3, count, 3)[np.arange(count), :, np.arange(count)]
    largest = np.linalg.eigvalsh((blocks + blocks.transpose(0, 2, 1)) / 2)[:, -1]
    node = int(largest.argmax())
    return float(1 / largest[node]), rest.structure.node_labels[node]
