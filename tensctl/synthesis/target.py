"""The wanted shape as one number: mean axial distance from the base ring's nodes to the top ring's."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.scene import TargetStage
from tensctl.structure import Structure

if TYPE_CHECKING:
    from tensctl.scene import Scene

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


def wanted_target(scene: Scene, asked: float | Mapping[str, float] | TargetStage | None) -> TargetStage:
    """The target of a call, or the scene's own, checked as a scene's `[target]` is.

    Raises
    ------
    SceneError
        A key or value that `[target]` would refuse.
    SynthesisError
        When neither the call nor the scene names a target.
    """
    if asked is None:
        if scene.target is None:
            raise SynthesisError("no target is given: add [target] height_scale to the scene, or pass target=1.2.")
        return scene.target
    if isinstance(asked, TargetStage):
        return asked
    if isinstance(asked, Mapping):
        return TargetStage.checked(**asked)
    timing = {} if scene.target is None else {"start": scene.target.start, "duration": scene.target.duration}
    return TargetStage.checked(height_scale=asked, **timing)
