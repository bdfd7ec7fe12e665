"""Why no tensions fit: one sentence of what was asked, what is possible and what to try."""

from __future__ import annotations

import numpy as np

from tensctl.statics.prestress.program import Program, largest_minimum

_NONE = 1e-9


def explain(program: Program) -> str:
    """The sentence for a program whose bounds cannot be met."""
    acting = program.matrix.acting_tendons
    floor = float(program.lower[acting].max(initial=0.0))
    asked = f"no prestress holds these nodes with {_bounds(program)}"
    crossed = np.flatnonzero(program.bounds[0] > program.bounds[1])
    if crossed.size:
        label = program.matrix.structure.tendon_labels[int((program.groups == crossed[0]).argmax())]
        return f"tension_min exceeds tension_max at tendon {label} (or within its group); no tension lies between."
    loaded = bool(program.load.any())
    # Without loads a self-stress has any size, so only its largest smallest tension relative to its largest counts.
    upper = program.upper if loaded or np.isfinite(program.upper).any() else np.full(acting.size, max(floor, 1.0))
    unbounded = Program(program.matrix, program.loads, np.full(acting.size, -np.inf), upper, program.groups)
    found = largest_minimum(unbounded, cap=max(floor, 1.0))
    if found is None:
        return (
            f"{asked}: the loads cannot be balanced by any tensions and rod forces there, because a mechanism or a "
            "rigid-body motion gives way to them; pin a node or change the loads."
        )
    reached, tensions = found[0], found[1].tensions
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
