"""Numbers as C has them: the shortest decimals that read back as the same double."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_PER_LINE = 6


@dataclass(frozen=True, eq=False)
class Table:
    """A constant array of the C source, flattened row by row.

    Attributes
    ----------
    name : str
    values : (...)
        Doubles, or whole numbers; limits that there are not are infinite.
    says : str
        What it holds, with units.
    """

    name: str
    values: np.ndarray
    says: str

    @property
    def bytes(self) -> int:
        """Memory that it takes."""
        return (4 if self._whole else 8) * self.values.size

    @property
    def _whole(self) -> bool:
        return self.values.dtype.kind == "i"

    @property
    def declaration(self) -> str:
        """Its definition in C."""
        numbers = [str(value) if self._whole else number(value) for value in self.values.ravel()]
        lines = [", ".join(numbers[k : k + _PER_LINE]) for k in range(0, len(numbers), _PER_LINE)]
        body = ",\n    ".join(lines)
        kind = "int" if self._whole else "double"
        return f"/* {self.says} */\nstatic const {kind} {self.name}[{len(numbers)}] = {{\n    {body}}};"


def number(value: float) -> str:
    """A double as a C literal."""
    return repr(float(value)).replace("inf", "HUGE_VAL")


def lower_triangle(matrix: np.ndarray) -> np.ndarray:
    """Entries on and below the diagonal, row by row."""
    return matrix[np.tril_indices(len(matrix))]
