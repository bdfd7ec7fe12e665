"""What leaving out saves along a run: what does not change with time is not evaluated, switches are not looked for.

One second of the taut (3,1) shell by `splitting6`, as it is and with what it lacks at zero: rest lengths that change by
nothing (schedules, speed limit and lag all arrive as that), loads that change by nothing, and a wave of no force. Rows
for `left_out.py`.
"""

from __future__ import annotations

import time

import numpy as np
from motions import MOTIONS

from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators.splitting import Splitting

_REPEATS = 40
_TOL = 1e-8


def time_rows() -> list[list[str]]:
    """A row for each thing that the motion lacks: name, evaluations, time without and with, largest difference."""
    motion = MOTIONS["smooth_3_1"]()
    dynamics = motion.dynamics
    forces = dynamics.layout.spread(dynamics.members.forces)
    plain = Drive.constant(dynamics.members.rest_lengths, forces)
    wave = {
        "wave_node": np.zeros(1, np.int64), "wave_force": np.zeros((1, 3)), "wave_omega": np.ones(1),
        "wave_phase": np.zeros(1),
    }  # fmt: skip
    fuller = {
        "rest lengths that change": plain._replace(ramped=True),
        "loads that change": plain._replace(swept=True),
        "a wave": plain._replace(swept=True, **wave),
    }
    start = dynamics.rod_coordinates(motion.nodes), dynamics.rod_coordinates(motion.velocities)
    lean, own, count = _run(dynamics, start, plain)
    rows = []
    for name, drive in fuller.items():
        whole, found, _ = _run(dynamics, start, drive)
        gap = np.abs(own - found).max() / np.abs(own).max()
        rows.append([name, str(count), f"{1e6 * lean:.0f} / {1e6 * whole:.0f}", f"{whole / lean:.2f}x", f"{gap:.0e}"])
    return rows


def _run(dynamics, start: tuple[np.ndarray, np.ndarray], drive: Drive) -> tuple[float, np.ndarray, int]:
    """Least time of the motion, s, its end, and how many forces it took."""
    plant = Splitting.fitted(dynamics, 6, _TOL, dynamics.fastest_rate)
    times, best, end, count = np.array([0.0, 1.0]), np.inf, start[0], 0
    for _ in range(_REPEATS):
        q, v = start[0].copy(), start[1].copy()
        room, before = (np.empty((2, *q.shape)), np.empty((2, *q.shape))), plant.evaluations
        began = time.process_time()
        plant.march(q, v, times, drive, *room)
        best = min(best, time.process_time() - began)
        end, count = q, plant.evaluations - before
    return best, end, count
