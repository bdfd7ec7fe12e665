"""Why no tensions fit: one sentence of what was asked, what is possible and what to try."""

from __future__ import annotations

import numpy as np

from tensctl.statics.prestress.optimum import contradiction, load_left_over
from tensctl.statics.prestress.program import Program
from tensctl.statics.prestress.vertex import largest_vertex

# Over the floor or one newton: a smallest tension, or a part of the loads, that counts as none.
_NONE = 1e-9
# Distance to the dual bound up to which a figure is given; it is printed with four digits.
_TOLD = 1e-6


def explain(program: Program) -> str:
    """The sentence for a program whose bounds cannot be met; that they cannot is proven before."""
    acting = program.matrix.acting_tendons
    floor = float(program.lower[acting].max(initial=0.0))
    asked = f"no prestress holds these nodes with {_bounds(program)}"
    crossed = np.flatnonzero(program.bounds[0] > program.bounds[1])
    if crossed.size:
        label = program.matrix.structure.tendon_labels[int((program.groups == crossed[0]).argmax())]
        return f"tension_min exceeds tension_max at tendon {label} (or within its group); no tension lies between."
    if contradiction(program, load_left_over(program)) > _NONE:
        return (
            f"{asked}: the loads cannot be balanced by any tensions and rod forces there, because a mechanism or a "
            "rigid-body motion gives way to them; pin a node or change the loads."
        )
    loaded = bool(program.load.any())
    # Without loads a self-stress has any size, so only its largest smallest tension relative to its largest counts.
    upper = program.upper if loaded or np.isfinite(program.upper).any() else np.full(acting.size, max(floor, 1.0))
    unbounded = Program(program.matrix, program.loads, np.full(acting.size, -np.inf), upper, program.groups)
    vertex = largest_vertex(unbounded, cap=max(floor, 1.0))
    if vertex is None or vertex.misfit > _TOLD:
        return f"{asked}; lower tension_min, raise tension_max, change the loads, or move the nodes (nearest_shape)."
    reached, tensions = vertex.reached, vertex.found.tensions
    if abs(reached) <= _NONE * max(floor, 1.0) and not loaded:
        names = _named(program, acting & (tensions <= _NONE * max(floor, 1.0)))
        return (
            f"{asked}: no self-stress pulls in every tendon, and the largest smallest tension that can be reached is "
            f"0 N ({names}); move the nodes (nearest_shape finds the nearest that can be held) or leave tendons out."
        )
    return (
        f"{asked}: the largest smallest tension that can be reached is {_number(reached)} N; "
        "lower tension_min, raise tension_max, change the loads, or move the nodes (nearest_shape)."
    )


def _bounds(program: Program) -> str:
    acting = program.matrix.acting_tendons
    low, high = program.lower[acting], program.upper[acting]
    text = f"every tension >= {_number(low.min(initial=np.inf))} N"
    if low.size and low.min() < low.max():
        text = f"tensions >= tension_min ({_number(low.min())} to {_number(low.max())} N)"
    if np.isfinite(high).any():
        text += f" and <= {_number(high[np.isfinite(high)].max())} N"
    tied = program.tie.shape[1]
    return text + (f" in {tied} groups of equal tension" if tied < low.size else "")


def _named(program: Program, which: np.ndarray) -> str:
    labels = [program.matrix.structure.tendon_labels[t] for t in np.flatnonzero(which)]
    return ", ".join(labels[:3]) + (f" and {len(labels) - 3} more" if len(labels) > 3 else "") + " stay without"


def _number(value: float) -> str:
    return f"{value:.4g}"
