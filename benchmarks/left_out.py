"""What leaving out saves: the model of each scene beside the full model with the same coefficients at zero.

    python benchmarks/left_out.py          # a line a scene
    python benchmarks/left_out.py --docs   # also renews docs/left_out.md

The full model has every term that any scene can have, with its coefficients as numbers: tendons with k, EA and dampers,
drag, a load and a disturbance on every node, an input on every tendon, and pinned rods as free rods whose ground
reaction is a multiplier. It is built here from the elements; the product has no such model. Instructions are CasADi's
(`n_instructions`), times those of CasADi's virtual machine over 1000 states in one call and of the compiled kernels.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import casadi as ca
import numpy as np
import page
from left_out_time import time_rows
from step_cost import right_hand_side

import tensctl as tc
from tensctl.elements import Hold, rod_acceleration
from tensctl.jit import jit
from tensctl.model.constraints import Constraints
from tensctl.model.joint_kernel import constrain
from tensctl.model.kernel import accelerations

_PUSH = {"node": "P4_1_1", "force": [5.0, 0.0, 0.0], "from": 0.0, "to": 0.1}
ADDED = {
    "plain": {},
    "gravity": {"gravity": {"g": 9.8}},
    "loads": {"loads": {"P4_*": [0.5, 0.0, -1.0]}},
    "drag": {"drag": {"coefficient": 0.3}},
    "dampers": {"tendons": {"damping": 2.0}},
    "pins": {"structure": {"pins": ["P1_*_1"]}},
    "pushes": {"simulation": {"t_end": 1.0, "push": [_PUSH]}},
    "EA": {"tendons": {"EA": 100.0}},
}
"""Sections beside the plain (3,1) shell; each row adds one, the last has all but EA."""
_STATES = 1000
_REPEATS = 20
# Where arrays lie in memory can cost half of the time: they are made anew so often, and the least time counts.
_ROUNDS = 10


def scene_with(*names: str) -> tc.Scene:
    """The (3,1) shell with some of `ADDED`."""
    sections: dict[str, dict] = {"structure": {"kind": "shell", "n": 3, "m": 1}}
    for name in names:
        for section, given in ADDED[name].items():
            sections[section] = sections.get(section, {}) | given
    return tc.Scene(**sections)


@dataclass(frozen=True, eq=False)
class Full:
    """The full model as a function of q, v (6 nr), u (nt), w (3 N) and every coefficient."""

    f: ca.Function
    numbers: tuple[np.ndarray, ...]


def full_model(dynamics: tc.Dynamics) -> Full:
    """Everything there is, on the structure of a scene."""
    structure, members = dynamics.structure, dynamics.members
    rods, tendons, nodes = len(structure.rods), len(structure.tendons), len(structure.nodes)
    sizes = {"q": 6 * rods, "v": 6 * rods, "u": tendons, "w": 3 * nodes}
    coefficients = {"k": tendons, "EA": tendons, "L": tendons, "c": tendons, "drag": 1, "load": 3 * nodes, "m": rods}
    s = {name: ca.SX.sym(name, size) for name, size in (sizes | coefficients).items()}
    places = _ends(structure.rods, s["q"], nodes)
    speeds = _ends(structure.rods, s["v"], nodes)
    forces = [s["load"][3 * i : 3 * i + 3] + s["w"][3 * i : 3 * i + 3] - s["drag"] * speeds[i] for i in range(nodes)]
    for t, (a, b) in enumerate(structure.tendons):
        pull = _pull(places[b] - places[a], speeds[b] - speeds[a], s, t)
        forces[a], forces[b] = forces[a] + pull, forces[b] - pull
    parts = []
    for r, ((a, b), hold) in enumerate(zip(structure.rods, dynamics.potential.manifold.hold, strict=True)):
        own = slice(6 * r, 6 * r + 6)
        parts.append(_acceleration(s["q"][own], s["v"][own], forces[a], forces[b], s["m"][r], hold))
    given = list(s.values())
    zero, by_strain = np.zeros(tendons), members.law == "EA"
    numbers = (
        zero if by_strain else members.stiffness, members.stiffness if by_strain else zero, members.rest_lengths,
        dynamics.damping, np.array([dynamics.drag]), members.forces.ravel(), members.mass,
    )  # fmt: skip
    return Full(ca.Function("full", given, [ca.vertcat(*parts)]), numbers)


def _ends(rods: np.ndarray, q: ca.SX, nodes: int) -> list[ca.SX]:
    result = [ca.SX.zeros(3)] * nodes
    for r, (a, b) in enumerate(rods):
        first, second = q[6 * r : 6 * r + 3], q[6 * r + 3 : 6 * r + 6]
        result[a], result[b] = (first - second) / 2, (first + second) / 2
    return result


def _pull(d: ca.SX, rate: ca.SX, s: dict[str, ca.SX], t: int) -> ca.SX:
    length, rest = ca.norm_2(d), s["L"][t] - s["u"][t]
    elastic = s["k"][t] * (length - rest) + s["EA"][t] * (length / rest - 1)
    tension = ca.fmax(0.0, elastic + s["c"][t] * ca.dot(d, rate) / length)
    return ca.if_else(length > rest, tension, 0.0) / length * d


def _acceleration(q: ca.SX, v: ca.SX, f1: ca.SX, f2: ca.SX, m: ca.SX, hold: int) -> ca.SX:
    """A free rod's acceleration with the ground's reactions on its held ends as multipliers."""
    free = rod_acceleration(Hold.FREE)
    if hold == Hold.FREE:
        return ca.vertcat(*free(q[3:], v[3:], f1, f2, m))
    if hold == Hold.FIXED:
        return ca.SX.zeros(6)
    reaction, sign = ca.SX.sym("reaction", 3), -1 if hold == Hold.TAIL else 1
    ends = (f1 + reaction, f2) if hold == Hold.TAIL else (f1, f2 + reaction)
    a1, a2 = free(q[3:], v[3:], *ends, m)
    held = a1 + sign * a2
    matrix, rest = ca.jacobian(held, reaction), ca.substitute(held, reaction, ca.SX.zeros(3))
    return ca.substitute(ca.vertcat(a1, a2), reaction, -ca.solve(matrix, rest))


def states(dynamics: tc.Dynamics) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and velocities of random rigid motions near the scene's own nodes, (1000, N, 3)."""
    rng, manifold = np.random.default_rng(4), dynamics.potential.manifold
    pairs = []
    for _ in range(_STATES):
        nodes = manifold.retract(dynamics.structure.nodes, 0.2 * rng.standard_normal(manifold.size))
        pairs.append((nodes, (manifold.tangent(nodes) @ rng.standard_normal(manifold.size)).reshape(-1, 3)))
    nodes, velocities = zip(*pairs, strict=True)
    return np.stack(nodes), np.stack(velocities)


def row(name: str, scene: tc.Scene) -> list[str]:
    """Both models of one scene."""
    dynamics = tc.build_dynamics(scene)
    full, f = full_model(dynamics), dynamics.f
    nodes, velocities = states(dynamics)
    x = np.stack([dynamics.pack(*pair) for pair in zip(nodes, velocities, strict=True)], axis=1)
    q = np.stack([dynamics.rod_coordinates(p).ravel() for p in nodes], axis=1)
    v = np.stack([dynamics.rod_coordinates(p).ravel() for p in velocities], axis=1)
    columns = [np.zeros((f.size1_in(i), _STATES)) for i in (1, 2)]
    zeros = [np.zeros((full.f.size1_in(i), _STATES)) for i in (2, 3)]
    numbers = [np.repeat(number[:, None], _STATES, axis=1) for number in full.numbers]
    small, small_time = timed(f, [x, *columns])
    large, large_time = timed(full.f, [q, v, *zeros, *numbers])
    keep = np.concatenate([np.isin(np.arange(6), _kept(hold)) for hold in dynamics.potential.manifold.hold])
    own = small[x.shape[0] // 2 :]
    gap = np.abs(own - large[keep]).max() / np.abs(large).max()
    lean, whole = kernel_times(dynamics, q[:, 0].reshape(-1, 6).copy(), v[:, 0].reshape(-1, 6).copy())
    terms = dynamics.explain().terms
    counted = [sum(term.operations or 0 for term in terms if term.included is there) for there in (True, False)]
    return [
        name, f"{counted[0]} / {sum(counted)}", f"{f.n_instructions()} / {full.f.n_instructions()}",
        f"{1e6 * small_time:.2f} / {1e6 * large_time:.2f}", f"{large_time / small_time:.2f}x",
        f"{1e6 * lean:.3f} / {1e6 * whole:.3f}", f"{whole / lean:.2f}x", f"{gap:.0e}",
    ]  # fmt: skip


def _kept(hold: int) -> tuple[int, ...]:
    """Coordinates of a rod that the scene's own model has."""
    return {Hold.FREE: (0, 1, 2, 3, 4, 5), Hold.FIXED: ()}.get(Hold(hold), (3, 4, 5))


def timed(f: ca.Function, given: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """Values at every state, and the least time a state, s."""
    found, best = np.empty(0), np.inf
    for _ in range(_ROUNDS):
        mapped, arguments = f.map(_STATES), [ca.DM(part) for part in given]
        found = np.asarray(mapped(*arguments))
        best = min(best, _least(lambda: mapped(*arguments)) / _STATES)  # noqa: B023
    return found, best


def _least(call: Callable[[], object]) -> float:
    best = np.inf
    for _ in range(_REPEATS):
        began = time.process_time()
        call()
        best = min(best, time.process_time() - began)
    return best


@jit
def _with_everything(data, q, v, rest, external, count):
    result = np.zeros_like(q)
    for _ in range(count):
        accelerations(data, q, v, rest, external, result)
    return result[0, 3]


def kernel_times(dynamics: tc.Dynamics, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
    """Time of the kernel that the scene takes, and of the one with dampers and drag in it, s."""
    count, kernel, members = 20_000, dynamics.kernel, dynamics.members
    given = (members.rest_lengths, members.forces, count)
    _with_everything(kernel, q, v, *given[:2], 1)
    load = members.forces.ravel()
    right_hand_side(kernel, q, members.rest_lengths, load, 1)
    whole = _least(lambda: _with_everything(kernel, q, v, *given)) / count
    lean = (
        whole
        if dynamics.damped
        else _least(lambda: right_hand_side(kernel, q, members.rest_lengths, load, count)) / count
    )
    return lean, whole


def structural_rows() -> list[list[str]]:
    """What a structure does not have: cables, joints, the third dimension; each beside the model that has it."""
    plain = tc.build_dynamics(scene_with())
    q, rest = plain.rod_coordinates(plain.structure.nodes), plain.members.rest_lengths
    v, count = 0.3 * np.random.default_rng(5).standard_normal(q.shape), 20_000
    kernels = plain.kernel, plain.kernel._replace(cables=True)
    found = [np.zeros_like(q), np.zeros_like(q)]
    for kernel, result in zip(kernels, found, strict=True):
        accelerations(kernel, q, v, rest, plain.members.forces, result)
        _with_everything(kernel, q, v, rest, plain.members.forces, 1)
    lean, whole = (
        _least(lambda kernel=kernel: _with_everything(kernel, q, v, rest, plain.members.forces, count)) / count
        for kernel in kernels
    )
    gap = np.abs(found[0] - found[1]).max() / np.abs(found[1]).max()
    cables = [
        "no cables, (3,1) shell",
        "-",
        f"{1e6 * lean:.3f} / {1e6 * whole:.3f}",
        f"{whole / lean:.2f}x",
        f"{gap:.0e}",
    ]
    return [cables, _joints_row(), _planar_row()]


def _joints_row() -> list[str]:
    """The mast with its base pinned, and as free rods whose ends joints hold to the ground: multipliers of 9 rows."""
    free, pinned = tc.build_dynamics(scene_with()), tc.build_dynamics(scene_with("pins"))
    jointed = replace(free)
    jointed.__dict__["constraints"] = _held_by_rows(pinned)
    nodes, velocities = states(pinned)
    cost, found = [], []
    for dynamics in (pinned, jointed):
        x = np.stack([dynamics.pack(*pair) for pair in zip(nodes, velocities, strict=True)], axis=1)
        value, spent = timed(dynamics.f, [x, *(np.zeros((dynamics.f.size1_in(i), _STATES)) for i in (1, 2))])
        terms = dynamics.explain().terms
        cost.append((sum(term.operations or 0 for term in terms if term.included), spent))
        found.append(np.stack([dynamics.unpack(column)[1] for column in value.T[:50]]))
    gap = np.abs(found[0] - found[1]).max() / np.abs(found[1]).max()
    lean, whole = _joint_times(pinned, nodes[0], velocities[0]), _joint_times(jointed, nodes[0], velocities[0])
    gap = max(gap, np.abs(lean[1] - whole[1]).max() / np.abs(whole[1]).max())
    times = (
        f"{1e6 * cost[0][1]:.2f} / {1e6 * cost[1][1]:.2f}; kernel {1e6 * lean[0]:.3f} / {1e6 * whole[0]:.3f}",
        f"{cost[1][1] / cost[0][1]:.2f}x; kernel {whole[0] / lean[0]:.2f}x",
    )
    return ["no joints, (3,1) mast on its pins", f"{cost[0][0]} / {cost[1][0]} (`explain`)", *times, f"{gap:.0e}"]


def _held_by_rows(pinned: tc.Dynamics) -> Constraints:
    """Pins as rows of joints on the coordinates of rod ends."""
    structure = pinned.structure
    rod, side = np.nonzero(structure.held.all(axis=1)[structure.rods])
    first = (6 * rod[:, None] + 3 * side[:, None] + np.arange(3)).ravel()
    target = structure.nodes[structure.rods[rod, side]].ravel()
    return Constraints.profiled(first, np.full(first.size, -1), target)


@jit
def _with_joints(data, q, v, rest, external, result, count):
    values, mu = np.zeros(data.place[-1]), np.zeros(data.first.size)
    for _ in range(count):
        result[:] = 0.0
        accelerations(data, q, v, rest, external, result)
        if mu.size > 0:
            constrain(data, q, result, values, mu)


def _joint_times(dynamics: tc.Dynamics, nodes: np.ndarray, velocities: np.ndarray) -> tuple[float, np.ndarray]:
    """Time of one right-hand side of the kernel, s, and its accelerations."""
    q, v, members = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities), dynamics.members
    given = (dynamics.kernel, q, v, members.rest_lengths, members.forces, np.zeros_like(q))
    _with_joints(*given, 1)
    count = 20_000
    return _least(lambda: _with_joints(*given, count)) / count, given[-1]


def _planar_row() -> list[str]:
    """A square of two rods in its plane, and the same in space."""
    flat = {"a": [0.0, 0.0], "b": [1.0, 1.0], "c": [1.0, 0.0], "d": [0.0, 1.0]}
    rods = {"ab": ["a", "b"], "cd": ["c", "d"]}
    tendons = {"1": ["a", "c"], "2": ["c", "b"], "3": ["b", "d"], "4": ["d", "a"]}
    space = {name: [*place, 0.0] for name, place in flat.items()}
    both = [
        tc.build_dynamics(tc.Scene(structure={"kind": kind, "nodes": nodes, "rods": rods, "tendons": tendons}))
        for kind, nodes in (("planar", flat), ("network", space))
    ]
    rng = np.random.default_rng(6)
    rates = rng.standard_normal((_STATES, 4, 3)) * [1.0, 1.0, 0.0]
    times, speeds = [], []
    for dynamics in both:
        x = np.stack([dynamics.pack(dynamics.structure.nodes, rate) for rate in rates], axis=1)
        columns = [np.zeros((dynamics.f.size1_in(i), _STATES)) for i in (1, 2)]
        value, spent = timed(dynamics.f, [x, *columns])
        times.append(spent)
        speeds.append(np.stack([dynamics.unpack(column)[1] for column in value.T[:50]]))
    gap = np.abs(speeds[0] - speeds[1]).max() / np.abs(speeds[1]).max()
    small, large = (dynamics.f.n_instructions() for dynamics in both)
    cost = f"{1e6 * times[0]:.2f} / {1e6 * times[1]:.2f}"
    return ["no third dimension, two rods", f"{small} / {large}", cost, f"{times[1] / times[0]:.2f}x", f"{gap:.0e}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--docs", action="store_true", help="renew docs/left_out.md")
    asked = parser.parse_args()
    rows = [row(name if name == "plain" else f"+ {name}", scene_with(name)) for name in ADDED]
    rows.append(row("+ all but EA", scene_with(*(name for name in ADDED if name != "EA"))))
    head = [
        "(3,1) shell", "operations by `explain`: in / all", "instructions: scene / full", "CasADi, us: scene / full",
        "saved", "kernel, us: scene / full", "saved", "largest difference",
    ]  # fmt: skip
    made = page.table(head, rows)
    head = ["what is left out", "instructions: without / with", "us: without / with", "saved", "largest difference"]
    structural = page.table(head, structural_rows())
    head = ["what is left out", "forces", "us: without / with", "saved", "largest difference"]
    changing = page.table(head, time_rows())
    print(f"{made}\n\n{structural}\n\n{changing}")
    if asked.docs:
        page.write("left_out.md", {"left out": made, "structure": structural, "time": changing})


if __name__ == "__main__":
    main()
