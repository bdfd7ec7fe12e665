"""Static reach of a cyclically symmetric structure: what tendons push and hold, harmonic by harmonic.

    eta_k = Omega_k^-2 B_k u_k at rest;   rank B = sum_k rank B_k over all n harmonics

as in `analysis.reach`; singular values of the whole B are those of its blocks, each as often as its harmonic.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Inexact

from tensctl.analysis.scaling import input_sizes
from tensctl.analysis.verdict import Verdict, decide
from tensctl.errors import LinearizationError
from tensctl.linear import HarmonicModel


@dataclass(frozen=True, eq=False)
class HarmonicReach:
    """Rank of what tendons push and hold, and what is outside of it.

    Attributes
    ----------
    linear : HarmonicModel
    """

    linear: HarmonicModel

    @cached_property
    def _scaled(self) -> list[np.ndarray]:
        """B of each harmonic, every column over the largest that it could be."""
        sizes = self._sizes
        return [block.drive / own for block, own in zip(self.linear.blocks, sizes, strict=True)]

    @cached_property
    def _sizes(self) -> list[np.ndarray]:
        mapped = self.linear.map
        return [input_sizes(self.linear, mapped.first(block.k)) for block in self.linear.blocks]

    @cached_property
    def _svds(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        return [np.linalg.svd(drive) for drive in self._scaled]

    @cached_property
    def values(self) -> tuple[Float[np.ndarray, " _"], ...]:
        """Singular values by harmonic."""
        return tuple(svd[1] for svd in self._svds)

    @cached_property
    def verdicts(self) -> tuple[tuple[Verdict, ...], ...]:
        """Whether each singular value is more than rounding, by harmonic."""
        largest = max((own.max(initial=0.0) for own in self.values), default=0.0)
        return tuple(tuple(decide(value, largest) for value in own) for own in self.values)

    @property
    def ranks(self) -> tuple[int, ...]:
        """Directions that are pushed and held for certain, by harmonic."""
        return tuple(own.count("yes") for own in self.verdicts)

    @property
    def rank(self) -> int:
        """Those of the whole structure."""
        return self._whole(self.ranks)

    @property
    def undecided(self) -> int:
        """Directions on which double precision does not decide."""
        return self._whole([own.count("undecided") for own in self.verdicts])

    @property
    def freedoms(self) -> int:
        """Flexible degrees of freedom."""
        return self._whole([block.omega2.size for block in self.linear.blocks])

    @property
    def inputs(self) -> int:
        """Inputs of the whole structure."""
        return self.linear.nu

    @property
    def missing(self) -> tuple[Inexact[np.ndarray, "modes _"], ...]:
        """Orthonormal motions that no tendon pushes, in the modes of each harmonic."""
        return tuple(svd[0][:, rank:] for svd, rank in zip(self._svds, self.ranks, strict=True))

    @property
    def idle(self) -> tuple[Inexact[np.ndarray, "inputs _"], ...]:
        """Shortenings that move nothing and change the prestress only, by harmonic; unit columns."""
        parts = zip(self._svds, self.ranks, self._sizes, strict=True)
        found = [svd[2][rank:].conj().T / sizes[:, None] for svd, rank, sizes in parts]
        return tuple(own / np.linalg.norm(own, axis=0) for own in found)

    def _whole(self, counts) -> int:
        return sum(block.copies * count for block, count in zip(self.linear.blocks, counts, strict=True))

    def verify(self, tol: float = 1e-9) -> None:
        """Check that what is missing gets no acceleration, and what is idle gives none.

        Raises
        ------
        LinearizationError
            With the part that is left over.
        """
        size = max((own.max(initial=0.0) for own in self.values), default=0.0) or 1.0
        parts = zip(self._scaled, self._sizes, self.missing, self.idle, strict=True)
        left = max(
            max(
                np.abs(missing.conj().T @ drive).max(initial=0.0),
                np.abs((drive * sizes) @ idle).max(initial=0.0) / max(sizes.max(initial=0.0), 1e-300),
            )
            for drive, sizes, missing, idle in parts
        )
        if not self.undecided and left > tol * size:
            raise LinearizationError(
                f"directions outside of the range are reached by {left / size:.1e} of the largest drive."
            )

    def __str__(self) -> str:
        """The rank and where it is missed, in sentences."""
        lines = [f"static reach: rank {self.rank} of {self.freedoms} flexible freedoms, {self.inputs} inputs"]
        if self.undecided:
            lines.append(f"  {self.undecided} more cannot be told from rounding")
        for block, rank in zip(self.linear.blocks, self.ranks, strict=True):
            if rank < block.omega2.size:
                lines.append(
                    f"  harmonic {block.k}, x {block.copies}: {block.omega2.size - rank} of {block.omega2.size} "
                    "directions of motion lengthen no actuated tendon at first order"
                )
        if self.rank < self.inputs:
            lines.append(f"  inputs that move nothing and change the prestress only: {self.inputs - self.rank}")
        return "\n".join(lines)
