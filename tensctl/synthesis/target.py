"""The wanted shape as one number: mean axial distance from the base ring's nodes to the top ring's."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.structure import Structure

if TYPE_CHECKING:
    from tensctl.scene import Scene, TargetStage

_NODE = re.compile(r"P([1-4])_(\d+)_(\d+)")


@dataclass(frozen=True, eq=False)
class Height:
    """Height of a shell: a linear function of the nodes.

    Attributes
    ----------
    gradient : (N, 3)
        d(height)/d(nodes).
    """

    gradient: Float[np.ndarray, "nodes 3"]

    def of(self, nodes: Float[np.ndarray, "nodes 3"]) -> float:
        """Height at the given nodes, m."""
        return float((self.gradient * nodes).sum())


def shell_height(structure: Structure) -> Height:
    """Height from P1 of the first stage to P4 of the last, along z.

    Raises
    ------
    SynthesisError
        When the nodes are not labelled as a shell's.
    """
    found = [_NODE.fullmatch(label) for label in structure.node_labels]
    stages = [int(match[3]) for match in found if match]
    base = np.array([bool(match) and match[1] == "1" and match[3] == "1" for match in found])
    top = np.array([bool(match) and match[1] == "4" and int(match[3]) == max(stages) for match in found])
    if not (base.any() and top.any()):
        raise SynthesisError(
            "target.height_scale needs a shell with base nodes P1_i_1 and top nodes P4_i_m; this structure has none."
        )
    gradient = np.zeros_like(structure.nodes)
    gradient[base, 2] -= 1 / base.sum()
    gradient[top, 2] += 1 / top.sum()
    return Height(gradient)


@dataclass(frozen=True)
class Target:
    """What shape is wanted, and when.

    Attributes
    ----------
    height_scale : float
        Wanted height over the height at the start.
    start, duration : float, s
    """

    height_scale: float
    start: float = 0.0
    duration: float = 3.0

    @classmethod
    def of(cls, scene: Scene, wanted: float | Mapping[str, float] | TargetStage | None) -> Target:
        """The target of a call, or the scene's own.

        Raises
        ------
        SynthesisError
            When neither names one, or a height is not positive.
        """
        asked = scene.target if wanted is None else wanted
        if asked is None:
            raise SynthesisError("no target is given: add [target] height_scale to the scene, or pass target=1.2.")
        if isinstance(asked, float | int):
            base = scene.target
            target = cls(float(asked)) if base is None else cls(float(asked), base.start, base.duration)
        elif isinstance(asked, Mapping):
            target = cls(**asked)
        else:
            target = cls(asked.height_scale, asked.start, asked.duration)
        if not target.height_scale > 0:
            raise SynthesisError(f"target.height_scale is {target.height_scale:g}; a number > 0 is expected.")
        return target
