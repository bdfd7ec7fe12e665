"""Where the predictions of a predictive controller and the structure parted company, in one sentence."""

from __future__ import annotations

import numpy as np

from tensctl.simulation.run import Run


def parting_told(run: Run) -> str | None:
    """The first such step with its tendon, and how many there are; None without any."""
    steps = np.flatnonzero(run.parted >= 0)
    if not steps.size:
        return None
    first, many = steps[0], f"{steps.size} of {run.parted.size} steps"
    tendon = run.structure.tendon_labels[run.parted[first]]
    return (
        f"the linear prediction and the structure part company at {run.sample_time[first]:.4g} s: tendon {tendon} has "
        f"{run.margin_gap[first]:.3g} N less than was predicted a period before; so at {many}. A higher "
        "mpc.tension_min or a shorter mpc.dt leaves more room."
    )
