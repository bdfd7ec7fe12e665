"""What the C source holds of a signal that outputs follow.

A table of knots, where the signal is one; what is wanted is shown with each measurement where it is a function, which C
does not have.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tensctl.codegen.literals import Table
from tensctl.synthesis import MPC
from tensctl.synthesis.mpc_weights import Weighed
from tensctl.synthesis.reference import Reference, outputs_along


def signal_facts(mpc: MPC, reference: Reference, times: np.ndarray, shown: int) -> dict[str, Any]:
    """Facts of a controller's signal; nothing is wanted without one.

    Parameters
    ----------
    mpc : MPC
    reference : Reference
        From which its plans deviate.
    times : (k,) s
        When commands of the samples along it begin to act.
    shown : int
        Numbers that are measured.
    """
    signal, following = mpc.signal, mpc.problem.following
    if signal is None or following is None:
        return {"signal": None, "wanted": 0, "told": 0, "tables": (), "sizes": [], "last": 0}
    weighed, ny = following.weighed, len(signal.labels)
    knots = signal.knots
    facts: dict[str, Any] = {"preview": mpc.preview, "about_path": signal.about_path, "wanted": mpc.horizon * ny}
    tables = () if signal.about_path else (_along(reference, weighed, times),)
    if knots is None:
        told = mpc.horizon * ny if mpc.preview else ny
        sizes = [("OUTPUTS", ny, "that follow what is wanted"), ("SHOWN", shown, "numbers before what is wanted")]
        size = Table("output_size", weighed.sizes, "at which a deviation of each output counts 1")
        says = f"{told} values that are wanted of {', '.join(signal.labels)}, in total" + (
            f", at the ends of the coming {mpc.horizon} periods, one after the other" if mpc.preview else ", now"
        )
        return facts | {
            "signal": "shown", "told": told, "tables": (*tables, size), "sizes": sizes, "last": 0, "says": says,
        }  # fmt: skip
    tables += (
        Table("signal_times", knots, "knots of the signal, s since the first step"),
        Table("signal_values", signal.at(knots) / weighed.sizes, "its values over the sizes of the outputs"),
    )
    sizes = [("OUTPUTS", ny, "that follow the signal"), ("KNOTS", knots.size, "of the signal")]
    last = max(0, int(knots[-1] / mpc.dt) + 2)
    return facts | {"signal": "table", "told": 0, "tables": tables, "sizes": sizes, "last": last}


def _along(reference: Reference, weighed: Weighed, times: np.ndarray) -> Table:
    values = outputs_along(reference, weighed.linear, times) / weighed.sizes
    return Table("course_outputs", values, "outputs of the reference over their sizes, where it is then")
