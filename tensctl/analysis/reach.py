"""Driven is not held: what tendons push at once, and what they hold when nothing moves any more.

    eta'' = -Omega^2 eta + B u,   B = Phi'G          pushed at once: the range of B
    at rest  eta = Omega^-2 B u                      held: Omega^-2 times the same range

Both have the rank of B. A direction m with m'B = 0 gets no acceleration from any tendon: it lengthens none of them to
first order, and is reached through inertia and prestress alone, when modes mix it with others. At an unloaded
prestressed equilibrium B (T/k) = 0: one direction of u changes nothing but the prestress.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tensctl.analysis.scaling import input_sizes
from tensctl.analysis.verdict import Verdict, decide
from tensctl.errors import LinearizationError
from tensctl.linear import LinearModel

# Parts of a mode's energy that are worth a word, how many of them, and up to how many directions.
_NOTABLE = 1e-3
_SHOWN = 3
_FEW = 3


@dataclass(frozen=True, eq=False)
class Reach:
    """Rank of what tendons push and hold, and what is outside of it.

    Attributes
    ----------
    linear : LinearModel
        Its flexible modes are looked at; a free structure's rigid-body motions are neither pushed nor held.
    """

    linear: LinearModel

    @cached_property
    def drive(self) -> Float[np.ndarray, "modes nu"]:
        """Rows B of the flexible modes: acceleration per metre of shortening."""
        flexible = self.linear.flexible
        unsorted = np.empty_like(flexible.B)
        unsorted[flexible.order] = flexible.B
        half = len(flexible.modes)
        return unsorted[half : 2 * half]

    @cached_property
    def _svd(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.linalg.svd(self.drive / input_sizes(self.linear.flexible))

    @property
    def values(self) -> Float[np.ndarray, " k"]:
        """Singular values of B, every column over the largest that it could be."""
        return self._svd[1]

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Whether each singular value is more than rounding."""
        return tuple(decide(value, self.values.max(initial=0.0)) for value in self.values)

    @property
    def rank(self) -> int:
        """Directions that are pushed and held for certain."""
        return self.verdicts.count("yes")

    @property
    def undecided(self) -> int:
        """Directions on which double precision does not decide."""
        return self.verdicts.count("undecided")

    @property
    def freedoms(self) -> int:
        """Flexible degrees of freedom."""
        return self.drive.shape[0]

    @property
    def inputs(self) -> int:
        """Acting tendons."""
        return self.drive.shape[1]

    @property
    def missing(self) -> Float[np.ndarray, "modes k"]:
        """Orthonormal motions that no tendon pushes, in mass-normalised modes."""
        return self._svd[0][:, self.rank :]

    @property
    def idle(self) -> Float[np.ndarray, "nu k"]:
        """Shortenings, m, that move nothing and change the prestress only; unit columns."""
        found = self._svd[2][self.rank :].T / input_sizes(self.linear.flexible)[:, None]
        return found / np.linalg.norm(found, axis=0)

    @property
    def shares(self) -> Float[np.ndarray, " modes"]:
        """Part of each flexible mode's kinetic energy that moves in directions which no tendon pushes, 0 to 1."""
        return (self.missing**2).sum(axis=1)

    def verify(self, tol: float = 1e-9) -> None:
        """Check that what is missing gets no acceleration, and what is idle gives none.

        Raises
        ------
        LinearizationError
            With the part that is left over.
        """
        size = np.linalg.norm(self.drive, 2) if self.drive.size else 0.0
        left = max(
            np.abs(self.missing.T @ (self.drive / input_sizes(self.linear.flexible))).max(initial=0.0),
            np.abs(self.drive @ self.idle).max(initial=0.0) / (size or 1.0),
        )
        if not self.undecided and left > tol:
            raise LinearizationError(f"directions outside of the range are reached by {left:.1e} of the largest drive.")

    def __str__(self) -> str:
        """The rank and what it means, in sentences."""
        lines = [f"static reach: rank {self.rank} of {self.freedoms} flexible freedoms, {self.inputs} inputs"]
        if self.undecided:
            lines.append(f"  {self.undecided} more cannot be told from rounding")
        if self.rank < self.freedoms:
            lines.append("  driven is not held: " + self.outside)
        if self.rank < self.inputs:
            lines.append(
                f"  inputs that move nothing and change the prestress only: {self.inputs - self.rank} of {self.inputs} "
                "directions"
            )
        return "\n".join(lines)

    @property
    def outside(self) -> str:
        """What is not held, and in which modes it moves."""
        count, modes, shares = self.freedoms - self.rank, self.linear.flexible.modes, self.shares
        if count > _FEW:
            return (
                f"{count} directions of motion lengthen no actuated tendon at first order; inertia and prestress reach "
                "what is driven of them."
            )
        said = ", ".join(
            f"{100 * shares[k]:.3g} % of mode {modes[k].index} ({modes[k].frequency:.4g} Hz)"
            for k in np.argsort(-shares, kind="stable")[:_SHOWN]
            if shares[k] > _NOTABLE
        )
        one = count == 1
        it = "it" if one else "them"
        return (
            f"{'one direction' if one else f'{count} directions'} of motion {'lengthens' if one else 'lengthen'} no "
            f"actuated tendon at first order, so no tendon accelerates or holds {it}: only inertia and prestress reach "
            f"{it}. Kinetic energy in {it}: {said}."
        )
