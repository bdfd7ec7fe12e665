"""A linear model with other outputs."""

from __future__ import annotations

from dataclasses import replace

from tensctl.linear import LinearModel
from tensctl.linear.outputs import Output, output_map


def shown(linear: LinearModel, *outputs: Output) -> LinearModel:
    """The same model with these outputs in C and D, in this order."""
    return replace(linear, outputs_map=output_map(linear.dynamics, linear.equilibrium, outputs))
