"""The motions on which integrators are compared, and references for them made without tensctl's kernels.

A reference integrates [S] Theorem 3.1 in NumPy with the order-8 formula of Dormand and Prince, from one slack-taut
switch to the next with the taut set frozen, so that the right-hand side is analytic in every step. It is made twice,
with steps of a twentieth and a fortieth over the fastest rate, where truncation is below rounding: what changes is its
error.
Stiff damped motions are followed by SciPy's Radau at two tolerances instead.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

import tensctl as tc

END = 1.0
TIMES = np.linspace(0, END, 11)
# References are kept between runs, until this file changes.
_KEPT = Path(__file__).parents[1] / "out" / "references"
# Step of the reference times the fastest rate; half of it the second time.
_STEP = 0.05
# A tendon this close to its rest length, m, that moves outward switches with the one that was located: a symmetric
# motion switches as one.
_BAND = 1e-10


class RightHandSide:
    """y' = f(y) for y = (q1, q2, v1, v2) of free rods, in vectorised NumPy as a user would write it well.

    `taut` freezes which tendons pull; without it each pulls while it is longer than its rest length.
    """

    def __init__(self, dynamics: tc.Dynamics) -> None:
        structure, members = dynamics.structure, dynamics.members
        if structure.pinned.any() or members.law != "k" or dynamics.drag or members.forces.any():
            raise ValueError("references are written for free, unloaded structures of constant stiffness.")
        count = len(structure.tendons)
        incidence = np.zeros((count, len(structure.nodes)))
        incidence[np.arange(count), structure.tendons[:, 0]] = -1
        incidence[np.arange(count), structure.tendons[:, 1]] = 1
        # Sparse products are faster from some hundred tendons on.
        self.C = incidence if count < 100 else sp.csr_array(incidence)
        self.Ct = incidence.T.copy() if count < 100 else sp.csr_array(incidence.T)
        self.tail, self.head = structure.rods.T
        self.rest, self.k, self.c = members.rest_lengths, members.stiffness, dynamics.damping
        self.mass, self.shape, self.damped = members.mass[:, None], structure.nodes.shape, dynamics.damped
        self.taut: np.ndarray | None = None

    def split(self, y: np.ndarray) -> np.ndarray:
        """(4, nr, 3): q1, q2, v1, v2."""
        return y.reshape(4, -1, 3)

    def ends(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Nodes from q1 and q2, or their velocities from v1 and v2."""
        nodes = np.empty(self.shape)
        nodes[self.tail], nodes[self.head] = 0.5 * (first - second), 0.5 * (first + second)
        return nodes

    def stretches(self, y: np.ndarray) -> np.ndarray:
        """Stretch l - L0 of every tendon."""
        q1, q2, _, _ = self.split(y)
        d = self.C @ self.ends(q1, q2)
        return np.sqrt(np.einsum("ti,ti->t", d, d)) - self.rest

    def stretch_rates(self, y: np.ndarray) -> np.ndarray:
        """Rate dl/dt of every tendon."""
        q1, q2, v1, v2 = self.split(y)
        d = self.C @ self.ends(q1, q2)
        return np.einsum("ti,ti->t", d, self.C @ self.ends(v1, v2)) / np.sqrt(np.einsum("ti,ti->t", d, d))

    def __call__(self, t: float, y: np.ndarray) -> np.ndarray:
        """Rates y'; t is there for SciPy."""
        q1, q2, v1, v2 = self.split(y)
        d = self.C @ self.ends(q1, q2)
        length = np.sqrt(np.einsum("ti,ti->t", d, d))
        tension = self.k * (length - self.rest)
        if self.damped:
            rate = np.einsum("ti,ti->t", d, self.C @ self.ends(v1, v2)) / length
            tension = np.maximum(tension + self.c * rate, 0.0)
        tension = np.where(length > self.rest if self.taut is None else self.taut, tension, 0.0)
        force = -(self.Ct @ ((tension / length)[:, None] * d))
        f1, f2 = force[self.tail], force[self.head]
        g = f2 - f1
        square = np.einsum("ri,ri->r", q2, q2)[:, None]
        along = np.einsum("ri,ri->r", q2, g)[:, None] / square
        spin = np.einsum("ri,ri->r", v2, v2)[:, None] / square
        result = np.empty((4, *q1.shape))
        result[0], result[1] = v1, v2
        result[2] = 2 / self.mass * (f1 + f2)
        result[3] = 6 / self.mass * (g - along * q2) - spin * q2
        return result.ravel()


@dataclass(frozen=True)
class Reference:
    """Nodes at the record times, what they may be wrong by, and how often a tendon switched."""

    nodes: np.ndarray
    error: float
    switches: int


@dataclass(frozen=True, eq=False)
class Motion:
    """A structure let go at given nodes and velocities, recorded at TIMES."""

    name: str
    what: str
    dynamics: tc.Dynamics
    nodes: np.ndarray
    velocities: np.ndarray

    @property
    def start(self) -> np.ndarray:
        """The state y of `RightHandSide`."""
        q, v = self.dynamics.rod_coordinates(self.nodes), self.dynamics.rod_coordinates(self.velocities)
        return np.concatenate([part.ravel() for part in (q[:, :3], q[:, 3:], v[:, :3], v[:, 3:])])

    @cached_property
    def reference(self) -> Reference:
        """The reference, made when first asked for (some minutes for the stiff one)."""
        kept = _KEPT / f"{self.name}-{zlib.crc32(Path(__file__).read_bytes()):08x}.npz"
        if kept.exists():
            with np.load(kept) as data:
                return Reference(data["nodes"], float(data["error"]), int(data["switches"]))
        follow = _stiff if self.dynamics.damped else _piecewise
        coarse, _ = follow(self, 1.0)
        fine, switches = follow(self, 0.5)
        found = Reference(fine, distance(fine, coarse), switches)
        kept.parent.mkdir(parents=True, exist_ok=True)
        np.savez(kept, nodes=found.nodes, error=found.error, switches=found.switches)
        return found


def distance(nodes: np.ndarray, others: np.ndarray) -> float:
    """Largest distance of any node at any record time, m."""
    return float(np.linalg.norm(nodes - others, axis=2).max())


def _piecewise(motion: Motion, part: float) -> tuple[np.ndarray, int]:
    """From switch to switch in fixed steps."""
    f, y, t = RightHandSide(motion.dynamics), motion.start, 0.0
    f.taut = f.stretches(y) > 0
    rows, switches, longest = [motion.nodes], 0, part * _STEP / _fastest(motion.dynamics)
    for record in TIMES[1:]:
        while t < record:
            h = min(longest, record - t)
            end = _step(f, y, h)
            h_switch = _first_switch(f, y, end, h)
            if h_switch is None:
                t, y = (record if h == record - t else t + h), end
                continue
            t, y = t + h_switch, _step(f, y, h_switch)
            flips = (np.abs(f.stretches(y)) < _BAND) & (np.where(f.taut, 1, -1) * f.stretch_rates(y) < 0)
            f.taut = f.taut ^ flips
            switches += int(flips.sum())
        q1, q2, _, _ = f.split(y)
        rows.append(f.ends(q1, q2))
    return np.stack(rows), switches


def _fastest(dynamics: tc.Dynamics) -> float:
    """A frequency that none exceeds by much, rad/s: the stiffest node on the lightest rod end (6/m)."""
    members, tendons = dynamics.members, dynamics.structure.tendons
    at_node = np.bincount(tendons.ravel(), np.repeat(members.stiffness, 2))
    return float(np.sqrt(6 * at_node.max() / members.mass.min()))


def _step(f: RightHandSide, y: np.ndarray, h: float) -> np.ndarray:
    """One step of Dormand and Prince's formula of order 8, its table from SciPy."""
    slopes = np.empty((DOP853.n_stages, y.size))
    for s in range(DOP853.n_stages):
        slopes[s] = f(0.0, y + h * (DOP853.A[s, :s] @ slopes[:s]))
    return y + h * (DOP853.B @ slopes)


def _first_switch(f: RightHandSide, y: np.ndarray, end: np.ndarray, h: float) -> float | None:
    """How far into a step the first tendon crosses its rest length against its frozen state; None when none does."""
    sign = np.where(f.taut, 1.0, -1.0)
    g0, g1 = sign * f.stretches(y), sign * f.stretches(end)
    r0, r1 = sign * f.stretch_rates(y), sign * f.stretch_rates(end)
    # A tendon may cross and come back within the step: look at the lowest point of its cubic.
    bottom = np.where((r0 < 0) & (r1 > 0), h * r0 / np.where(r0 == r1, 1.0, r0 - r1), h)
    u = bottom / h
    cubic = (
        (1 + 2 * u) * (1 - u) ** 2 * g0 + u * (1 - u) ** 2 * h * r0 + u**2 * (3 - 2 * u) * g1 - u**2 * (1 - u) * h * r1
    )
    crossing = np.flatnonzero((cubic < 0) & ~((np.abs(g0) < _BAND) & (r0 > 0)))
    found = None
    for k in crossing:

        def inside(tau: float, k=k) -> float:
            return float(sign[k] * f.stretches(_step(f, y, tau))[k])

        first, last = inside(0.0), inside(bottom[k])
        if last >= 0:
            continue
        at = brentq(inside, 0.0, bottom[k], xtol=1e-16, rtol=1e-15) if first > 0 else 0.0
        found = at if found is None else min(found, at)
    return found


def _stiff(motion: Motion, part: float) -> tuple[np.ndarray, int]:
    """Radau IIA of order 5; the stricter tolerance is a thirtieth of the other.

    Refuses motions in which a tendon stops pulling: there tensctl's damper lets go and MuJoCo's pushes, so that the two
    would not be compared on one motion.
    """
    f = RightHandSide(motion.dynamics)
    tol = 3e-11 if part < 1 else 1e-9
    looks = np.union1d(TIMES, np.geomspace(1e-7, END, 300))
    run = solve_ivp(f, (0, END), motion.start, "Radau", looks, rtol=tol, atol=0.1 * tol)
    if min((f.k * f.stretches(y) + f.c * f.stretch_rates(y)).min() for y in run.y.T) <= 0:
        raise ValueError("a tendon of a stiff damped motion stops pulling; start nearer to rest.")
    kept = np.isin(looks, TIMES)
    return np.stack([f.ends(*f.split(y)[:2]) for y in run.y.T[kept]]), 0


def scene(n: int, m: int, **tendons: float) -> tc.Scene:
    """A free Class 1 shell with the defaults of a scene."""
    return tc.Scene(structure=tc.shell(n, m), tendons=tendons)


def released(name: str, what: str, scene: tc.Scene) -> Motion:
    """At rest at the scene's initial nodes."""
    dynamics = tc.build_dynamics(scene)
    nodes = dynamics.structure.nodes
    return Motion(name, what, dynamics, nodes, np.zeros_like(nodes))


def kicked(name: str, what: str, scene: tc.Scene, speed: float) -> Motion:
    """From the equilibrium with random velocities of a given size, m/s."""
    rest = tc.find_equilibrium(scene)
    kick = speed * np.random.default_rng(1).standard_normal(rest.potential.manifold.size)
    return Motion(name, what, tc.build_dynamics(scene), rest.nodes, (rest.point.tangent @ kick).reshape(-1, 3))


MOTIONS = {
    "smooth_3_1": lambda: kicked("smooth_3_1", "(3,1), kicked at rest, taut throughout", scene(3, 1), 0.3),
    "smooth_8_4": lambda: kicked("smooth_8_4", "(8,4), kicked at rest, taut throughout", scene(8, 4), 0.05),
    "switching_3_1": lambda: released("switching_3_1", "(3,1), released from the cylinder", scene(3, 1)),
    "stiff_3_1": lambda: kicked("stiff_3_1", "(3,1), k = 1e4 N/m, kicked", scene(3, 1, stiffness=1e4), 4.8),
    "switching_8_4": lambda: released("switching_8_4", "(8,4), released from the cylinder", scene(8, 4)),
    "damped_3_1": lambda: kicked(
        "damped_3_1", "(3,1), k = 1e6 N/m, c = 5e4 N s/m, kicked", scene(3, 1, stiffness=1e6, damping=5e4), 0.2
    ),
}
"""Makers of motions by name."""
