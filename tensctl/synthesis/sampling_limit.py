"""Modes that a control period cannot follow: refused, or left out by name with their static answer kept.

A mode with omega dt >= pi is seen by samples as a slower one. Left out, it stands where forces put it,

    eta_f = Phi_f' G u / omega_f^2,

so tensions and places answer to held rest lengths exactly; its ringing is not modelled.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel

Fast = Literal["refuse", "truncate"]


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


def _others(count: int) -> str:
    return f" ({count} more {'mode is' if count == 1 else 'modes are'} too fast)" if count else ""
