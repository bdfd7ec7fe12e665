"""The nonlinear program of the nearest shape, as CasADi takes it.

    x = (p of free nodes, omega of tendons, lambda of rods),   f = 1/2 |p - wanted|^2
    g = (balance, (|rod|^2 - L^2)/2,  omega l - T_min,  slope l - shift - omega l,  T_max - omega l)

Force densities make the balance bilinear. On a free structure six of its equations depend on the others; IPOPT takes
that (it perturbs its own system), and the answer's balance is checked at full size afterwards.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import scipy.optimize

from tensctl.elements import Potential
from tensctl.statics.equilibrium import Equilibrium
from tensctl.statics.prestress.law import ceiling_of, tension_of
from tensctl.statics.prestress.matrix import equilibrium_matrix
from tensctl.structure.structure import lengths


def nearest_program(
    potential: Potential, wanted: np.ndarray, limits: tuple[np.ndarray, np.ndarray], start: Equilibrium | None
):
    """The nonlinear program for CasADi, the bounds of its constraints, and a first guess.

    Parameters
    ----------
    wanted : (N, 3) m
    limits : two (nt,) arrays, N
        Smallest and largest tension; the largest may be infinite.
    start : Equilibrium, optional

    Returns
    -------
    problem : dict
        x = nodes that are free, force densities of tendons, force densities of rods; f; g.
    bounds : dict
        lbg and ubg.
    guess : array
    """
    structure, members, (floor, highest) = potential.structure, potential.members, limits
    free, kept = np.flatnonzero(~structure.pinned), ~structure.grounded_tendons
    moving, omega = ca.MX.sym("p", 3, free.size), ca.MX.sym("omega", len(structure.tendons))
    thrust = ca.MX.sym("lambda", len(structure.rods))
    place = np.zeros((free.size, len(structure.nodes)))
    place[np.arange(free.size), free] = 1.0
    held = np.where(structure.pinned[:, None], structure.nodes, 0.0).T
    p = ca.mtimes(moving, ca.sparsify(ca.DM(place))) + held
    pulls, pushes = _incidence(structure.tendons, structure), _incidence(structure.rods, structure)
    d, e = ca.mtimes(p, pulls), ca.mtimes(p, pushes)
    force = ca.mtimes(d * ca.repmat(omega.T, 3, 1), -pulls.T) + ca.mtimes(e * ca.repmat(thrust.T, 3, 1), pushes.T)
    balance = (force + members.forces.T)[:, free.tolist()]
    length = ca.sqrt(ca.sum1(d * d).T)
    tension = omega * length
    rods = (ca.sum1(e * e).T - structure.rod_lengths**2) / 2
    moves = ~structure.pinned[structure.rods].all(axis=1)
    rods = rods[np.flatnonzero(moves).tolist()]
    at, capped = np.flatnonzero(kept).tolist(), np.flatnonzero(kept & np.isfinite(highest)).tolist()
    slope, shift = ceiling_of(members)
    scale = float(np.abs(floor).max(initial=0.0)) or 1.0
    above, below = (tension - floor)[at], (slope * length - shift - tension)[at]
    under = (np.where(np.isfinite(highest), highest, 0.0) - tension)[capped]
    g = ca.vertcat(ca.vec(balance) / scale, rods, ca.vertcat(above, below, under) / scale)
    equal = balance.numel() + rods.numel()
    lower, upper = np.zeros(g.numel()), np.zeros(g.numel())
    upper[equal:] = np.inf
    goal = ca.sumsqr(moving - wanted[free].T) / 2
    problem = {"x": ca.vertcat(ca.vec(moving), omega, thrust), "f": goal, "g": g}
    return problem, {"lbg": lower, "ubg": upper}, _guess(potential, wanted, floor, start)


def _incidence(members: np.ndarray, structure) -> ca.DM:
    """Nodes to member vectors, (N, members): +1 at the head, -1 at the tail."""
    matrix = np.zeros((len(structure.nodes), len(members)))
    matrix[members[:, 1], np.arange(len(members))] += 1.0
    matrix[members[:, 0], np.arange(len(members))] -= 1.0
    return ca.sparsify(ca.DM(matrix))


def _guess(potential: Potential, wanted: np.ndarray, floor: np.ndarray, start: Equilibrium | None) -> np.ndarray:
    """Nodes and force densities to begin with: the start's, or the best fit of balance at the wanted nodes."""
    structure = potential.structure
    nodes = wanted if start is None else start.nodes
    matrix = equilibrium_matrix(structure, nodes)
    length = lengths(nodes, structure.tendons)
    if start is not None:
        tensions, thrust = np.maximum(start.tensions, floor), start.rod_forces
    else:
        low = np.concatenate([2 * floor, np.full(len(structure.rods), -np.inf)])
        load = potential.members.forces.ravel()[matrix.free]
        fit = scipy.optimize.lsq_linear(matrix.full, -load, (low, np.inf)).x
        tensions, thrust = np.split(fit, [length.size])
        tensions = np.clip(tensions, floor, tension_of(potential.members, length, potential.members.floors))
    density = tensions / length
    return np.concatenate([nodes[~structure.pinned].ravel(), density, thrust / lengths(nodes, structure.rods)])
