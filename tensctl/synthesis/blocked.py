"""Which limits keep a shape from coming nearer to what is wanted.

    G d >= h has no solution   <=>   G'y = 0 and h'y = 1 for some y >= 0          (Farkas)

d is the change of rest lengths; rows of G are those of a quadratic program and the limits of its variables. Rows with
y > 0 prove by themselves that nothing leads on, and are found as min |G'y|^2 + (h'y - 1)^2 over y >= 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from tensctl.statics import Equilibrium
from tensctl.synthesis.input_limits import input_reach
from tensctl.synthesis.qp import QP
from tensctl.synthesis.rod_room import pair_named
from tensctl.synthesis.shape_limits import Asked
from tensctl.synthesis.tension_room import limited

# What takes part by less than this part of the largest is rounding.
_PART = 1e-6
# Metres that a node moves for a metre of rest length where the linear model says no more: the softest mode is all but
# gone. At rest it is 2 to 5.
_GIVES_WAY = 1e3


@dataclass(frozen=True, eq=False)
class Block:
    """What stands in the way of an infeasible QP: limits of variables from below and above, and rows.

    Attributes
    ----------
    lower, upper : (nu,)
    rows : (r,)
    """

    lower: Bool[np.ndarray, " nu"]
    upper: Bool[np.ndarray, " nu"]
    rows: Bool[np.ndarray, " r"]


def block_of(qp: QP, now: Float[np.ndarray, " nu"]) -> Block:
    """What stands in the way of an infeasible QP, seen from inputs of now."""
    from scipy.optimize import nnls

    inputs = now.size
    G, values = np.vstack([np.eye(inputs), qp.A]), np.concatenate([now, qp.A @ now])
    below, above = np.isfinite(qp.lower), np.isfinite(qp.upper)
    h = np.concatenate([(qp.lower - values)[below], (values - qp.upper)[above]])
    stacked = np.vstack([G[below], -G[above]])
    weights, _ = nnls(np.vstack([stacked.T, h / np.abs(h).max()]), np.append(np.zeros(inputs), 1.0))
    part = weights > _PART * weights.max(initial=0.0)
    low, high = np.zeros(below.size, bool), np.zeros(above.size, bool)
    low[below], high[above] = np.split(part, [below.sum()])
    return Block(low[:inputs], high[:inputs], (low | high)[inputs:])


def block_said(
    now: Equilibrium, asked: Asked, block: Block, features: int, pairs: Int[np.ndarray, " p"], influence: np.ndarray
) -> str:
    """The same in words; rows are features, floors, stall limits and the given pairs of rods.

    Parameters
    ----------
    influence : (size, nu)
        How far the structure moves, m/m, which tells where it is about to give way.
    """
    moved = np.abs(influence).max(initial=0.0)
    if moved > _GIVES_WAY:
        return f"the structure is about to give way there, and moves {moved:.2g} times as far as a rest length"
    members = now.potential.members
    floored, stalling = ~now.structure.grounded_tendons, limited(now)
    floors, stalls, near = np.split(block.rows[features:], np.cumsum([floored.sum(), stalling.sum()]))
    tendons, motors = np.array(now.structure.tendon_labels), np.array(members.gearing.labels)
    short = block.upper & (members.input_bounds[1] <= input_reach(now.structure, members, asked.u_max))
    kinds = (
        (tendons[floored][floors], "at tension_min"),
        (tendons[stalling][stalls], "at force_max"),
        (motors[(block.lower | block.upper) & ~short], "at u_max"),
        (motors[short], "at the least rest length"),
        ([pair_named(now, pair) for pair in pairs[near]], "at target.clearance"),
    )
    said = [f"{few(names)} {where}" for names, where in kinds if len(names)]
    if not said:
        return "no limit stands in the way, but no rest length moves it farther"
    return " and ".join(said)


def few(names: np.ndarray | list[str]) -> str:
    """The first four."""
    return f"{', '.join(names[:4])}{' ...' * (len(names) > 4)}"
