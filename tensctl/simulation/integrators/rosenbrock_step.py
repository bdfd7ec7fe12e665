"""One Rosenbrock step: Jacobian, stages, and states between its ends.

For z' = w, w' = g(z, w, t)/M a stage's 2n equations reduce to n, with M, C and K of `blocks`:

    (s^2 M + s C + K) u_z = M (r_w + s r_z) + C r_z,   u_w = s u_z - r_z,   s = 1/(h gamma)

Springs and dampers stay on or off within a step, so the step has its full order.
"""

from __future__ import annotations

from tensctl.jit import bare
from tensctl.simulation.drive import drive_at, drive_rate
from tensctl.simulation.integrators.block_lu import factor_blocks, solve_blocks
from tensctl.simulation.integrators.blocks import add_damping, assemble, rod_slopes, tendon_slopes
from tensctl.simulation.integrators.chart import accelerate, centre_chart, place_ends
from tensctl.simulation.integrators.frozen import force_rates, freeze, frozen_forces, sides
from tensctl.simulation.integrators.stiff_layout import unpacked


@bare
def turn_by_time(data, drive, t, frame, y, place, speed, rest, rest_rate, on, load_rate, force, by_time):
    """Fill the derivative of accelerations by time alone, (5 nr,), at the centre of the chart."""
    drive_rate(drive, t, rest_rate, load_rate)
    force_rates(data, place, rest, rest_rate, on, load_rate, force)
    accelerate(data, frame, y, place, speed, force, by_time)


@bare
def linearise(task, t, q, v, margin):
    """Centre the chart at a state, freeze tendons as they are, take the slopes; how many tendons changed over."""
    data, plan, drive, _, room = unpacked(task)
    frame, y, place, speed, force, rest, on = (
        room.frame, room.y, room.place, room.speed, room.force, room.rest, room.on
    )  # fmt: skip
    centre_chart(data, q, v, frame, y)
    place_ends(data, frame, y, place, speed)
    if drive.ramped or drive.swept:
        drive_at(drive, t, rest, room.load)
    sides(data, place, speed, rest, plan.decay, 0.0, room.side)
    changed = freeze(room.side, margin, on)
    tendon_slopes(data, plan, frame, y, place, speed, rest, on, room.pull, room.turn, room.press)
    if drive.ramped or drive.swept:
        turn_by_time(
            data, drive, t, frame, y, place, speed, rest, room.rest_rate, on, room.load_rate, force, room.by_time
        )  # fmt: skip
    frozen_forces(data, place, speed, rest, on, room.load, force)
    rod_slopes(data, place, speed, force, room.own)
    accelerate(data, frame, y, place, speed, force, room.start)
    return changed


@bare
def stages(task, t, h):
    """All stages of a step from the chart's centre; leaves the new state in `end`, the error in the last row of U.

    Returns whether the matrix could be factored and all stages are in the chart, and whether a tendon should have
    changed over at one of them.
    """
    data, plan, drive, table, room = unpacked(task)
    s, size, half, last = 1.0 / (h * table.gamma), room.y.size, room.start.size, table.d.size - 1
    y, end, right, U, A, lu = room.y, room.end, room.right, room.U, room.A, plan.elimination
    assemble(data, plan, room.frame, s, room.on, room.pull, room.turn, room.press, room.own, A)
    if not factor_blocks(lu.order, lu.start, lu.lower, lu.upper, lu.target_start, lu.targets, A):
        return False, False
    crossed, moved = False, drive.ramped or drive.swept
    for i in range(last + 1):
        for k in range(size):
            end[k] = y[k]
        for j in range(i):
            a, u = table.a[i, j], U[j]
            if a != 0.0:
                for k in range(size):
                    end[k] += a * u[k]
        for k in range(half):
            right[k] = end[half + k]
        if i == 0:
            for k in range(half):
                right[half + k] = room.start[k]
        else:
            if moved:
                drive_at(drive, t + table.times[i] * h, room.rest, room.load)
            if not place_ends(data, room.frame, end, room.place, room.speed):
                return False, crossed
            left = frozen_forces(data, room.place, room.speed, room.rest, room.on, room.load, room.force)
            crossed = crossed or left
            accelerate(data, room.frame, end, room.place, room.speed, room.force, right[half:])
        if moved:
            d = table.d[i] * h
            for k in range(half):
                right[half + k] += d * room.by_time[k]
        for j in range(i):
            c, u = table.C[i, j] / h, U[j]
            for k in range(size):
                right[k] += c * u[k]
        x = U[i]
        for k in range(half):
            x[k] = plan.mass[k] * (right[half + k] + s * right[k])
        add_damping(data, plan, room.on, room.pull, right[:half], x[:half])
        solve_blocks(lu.order, lu.start, lu.rows, lu.lower, lu.upper, A, x[:half].reshape(lu.order.size, 5))
        for k in range(half):
            x[half + k] = s * x[k] - right[k]
    for k in range(size):
        end[k] += U[last, k]
    return True, crossed


@bare
def within(H, x, y, end, U, out):
    """Fill `out` with the dense output a part x into the step from y to `end`."""
    for k in range(y.size):
        bend = 0.0
        for p in range(H.shape[0] - 1, -1, -1):
            row = 0.0
            for i in range(H.shape[1]):
                row += H[p, i] * U[i, k]
            bend = row + x * bend
        out[k] = (1.0 - x) * y[k] + x * (end[k] + (1.0 - x) * bend)
