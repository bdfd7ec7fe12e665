"""Modes that a control period cannot follow: refused, or left out by name with their static answer kept.

Periods so short that rounding hides what a mode does within them are refused as well.

A mode with omega dt >= pi is seen by samples as a slower one. Left out, it stands where forces put it,

    eta_f = Phi_f' G u / omega_f^2,

so tensions and places answer to held rest lengths exactly; its ringing is not modelled.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel

Fast = Literal["refuse", "truncate"]

# Least angle, rad, by which the slowest mode turns within a period. Rounding leaves some 1e-16 over this angle of a
# gain open: for the (3,1) mast 5e-4 at 5e-13 rad, and below 5e-14 rad the Riccati equation has no solution.
_LEAST_TURN = 1e-12


def below_sampling_limit(linear: LinearModel, dt: float, modes: Fast) -> LinearModel:
    """The model as a period dt can follow it; `linear.condensed` lists what was left out.

    Raises
    ------
    SynthesisError
        Modes beyond the Nyquist frequency that are refused, or when no other is there.
    """
    fast = [mode for mode in linear.modes if np.sqrt(max(mode.omega2, 0.0)) * dt >= np.pi]
    if not fast:
        return linear
    fastest = max(fast, key=lambda mode: mode.omega2)
    shorter = f"take dt below {0.5 / fastest.frequency:.2g} s"
    if modes == "refuse":
        raise SynthesisError(
            f"mpc.dt = {dt:g} s is too long for mode {fastest.index} at {fastest.frequency:.3g} Hz; {shorter}"
            f'{_others(len(fast) - 1)}, or leave such modes out by modes = "truncate".'
        )
    if len(fast) == len(linear.modes):
        raise SynthesisError(f"mpc.dt = {dt:g} s is too long for every mode; {shorter} to follow them all.")
    kept = tuple(mode for mode in linear.modes if mode not in fast)
    return replace(linear, modes=kept, condensed=(*linear.condensed, *fast))


def refuse_short(scales: Float[np.ndarray, " modes"], dt: float) -> None:
    """Refuse a period, s, within which rounding hides the slowest of some modes, rad/s.

    Raises
    ------
    SynthesisError
        With the mode's frequency and the least period.
    """
    slowest = float(scales.min(initial=np.inf))
    if slowest * dt < _LEAST_TURN:
        raise SynthesisError(
            f"dt = {dt:g} s is so short that rounding hides what the slowest mode ({slowest / (2 * np.pi):.3g} Hz) "
            f"does in it; take dt above {_LEAST_TURN / slowest:.2g} s."
        )


def _others(count: int) -> str:
    return f" ({count} more {'mode is' if count == 1 else 'modes are'} too fast)" if count else ""
