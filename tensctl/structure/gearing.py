"""Motors and the tendons that they pull: one motor may drive several tendons, a gang.

    u_t = g_t v_j,    L_t = L0_t - u_t

v_j is the shortening that motor j asks for, g_t the gear ratio of tendon t, j its motor; a ratio < 0 lets out what
another takes in. Every acting tendon has exactly one motor. Without gangs v is u.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.errors import StructureError
from tensctl.structure.labels import by_label, matches

Gangs = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class Gearing:
    """Motors by the acting tendons.

    Attributes
    ----------
    motor : (na,) int
        Motor of each acting tendon.
    ratio : (na,)
        Shortening of the tendon per shortening asked of its motor; not 0.
    labels : tuple of str, one a motor
        Name of the gang, or label of the motor's only tendon.
    """

    motor: Int[np.ndarray, " acting"]
    ratio: Float[np.ndarray, " acting"]
    labels: tuple[str, ...]

    @classmethod
    def direct(cls, labels: tuple[str, ...]) -> Gearing:
        """A motor of its own for every tendon."""
        return cls(np.arange(len(labels)), np.ones(len(labels)), labels)

    @property
    def size(self) -> int:
        """Number of motors."""
        return len(self.labels)

    @cached_property
    def plain(self) -> bool:
        """Whether every tendon has a motor of its own, without gears."""
        return np.array_equal(self.motor, np.arange(self.size)) and bool((self.ratio == 1).all())

    @cached_property
    def matrix(self) -> sp.csr_array:
        """Shortening of each acting tendon by each motor, (na, motors)."""
        entries = (self.ratio, (np.arange(self.motor.size), self.motor))
        return sp.csr_array(sp.coo_array(entries, shape=(self.motor.size, self.size)))

    @cached_property
    def largest(self) -> Float[np.ndarray, " motors"]:
        """Largest ratio of each motor, without sign: how fast its fastest tendon moves."""
        largest = np.zeros(self.size)
        np.maximum.at(largest, self.motor, np.abs(self.ratio))
        return largest

    def spread(self, v: Float[np.ndarray, " motors"]) -> Float[np.ndarray, " acting"]:
        """Shortenings of the acting tendons, m."""
        return self.ratio * v[self.motor]

    def gather(self, u: Float[np.ndarray, "*t acting"]) -> Float[np.ndarray, "*t motors"]:
        """What motors stand for shortenings of the acting tendons, m: the nearest, where gangs do not fit exactly."""
        if self.plain:
            return u
        return (u @ self.matrix) / self.squares(np.ones(self.motor.size))

    def squares(self, values: Float[np.ndarray, " acting"]) -> Float[np.ndarray, " motors"]:
        """Sum of ratio^2 times a value over the tendons of each motor: stiffness as the motor feels it."""
        return np.bincount(self.motor, self.ratio**2 * values, self.size)

    def bounds(self, room: Float[np.ndarray, " acting"]) -> tuple[np.ndarray, np.ndarray]:
        """Least and largest v, (motors,) m each, at which no tendon shortens by more than its room."""
        upper, lower = np.full(self.size, np.inf), np.full(self.size, -np.inf)
        pulls = self.ratio > 0
        np.minimum.at(upper, self.motor[pulls], room[pulls] / self.ratio[pulls])
        np.maximum.at(lower, self.motor[~pulls], room[~pulls] / self.ratio[~pulls])
        return lower, upper


def build_gearing(labels: tuple[str, ...], inputs: Int[np.ndarray, " acting"], ratios: np.ndarray, gang: np.ndarray,
                  names: tuple[str, ...]) -> Gearing:  # fmt: skip
    """Motors in the order of their first tendons.

    Parameters
    ----------
    inputs : acting tendons
    ratios, gang : (nt,)
        Gear ratio of every tendon, and the number of its gang, -1 for none.
    names : names of the gangs
    """
    owner = [names[gang[t]] if gang[t] >= 0 else labels[t] for t in inputs]
    found = tuple(dict.fromkeys(owner))
    place = {name: k for k, name in enumerate(found)}
    return Gearing(np.array([place[name] for name in owner], int), ratios[inputs], found)


def read_gangs(labels: tuple[str, ...], gangs: Gangs) -> tuple[np.ndarray, np.ndarray]:
    """Gear ratio of every tendon (1 without a gang) and the number of its gang (-1 for none).

    Raises
    ------
    StructureError
        A gang named like a tendon, a ratio of 0, a tendon in two gangs, or a pattern that names nothing.
    """
    ratios, gang = np.ones(len(labels)), np.full(len(labels), -1)
    for number, (name, table) in enumerate(gangs.items()):
        key = f"actuators.gangs.{name}"
        if name in labels:
            raise StructureError(f"{key} has the label of a tendon; give the gang another name.")
        found = sorted({t for pattern in table for t in matches(labels, pattern, key)})
        taken = [labels[t] for t in found if gang[t] >= 0]
        if taken:
            raise StructureError(f"{key}: tendon {taken[0]} is in two gangs; a tendon has one motor.")
        ratios[found] = by_label([labels[t] for t in found], table, key)
        if not (ratios[found] != 0).all():
            raise StructureError(f"{key}: a ratio is 0, which moves nothing; leave the tendon out of the gang.")
        if not (ratios[found] > 0).any():
            raise StructureError(f"{key}: every ratio is negative; turn all signs, so that u > 0 shortens something.")
        gang[found] = number
    return ratios, gang
