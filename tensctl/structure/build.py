"""From the scene's recipe to the structure it describes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tensctl.structure.network import network, planar
from tensctl.structure.prism import prism
from tensctl.structure.shell import shell
from tensctl.structure.structure import Structure

if TYPE_CHECKING:
    from tensctl.scene import Scene


def build_structure(scene: Scene) -> Structure:
    """Build the structure that a scene describes.

    Raises
    ------
    StructureError
        A recipe that makes no structure, or a pin that names no node.
    """
    recipe = scene.structure
    if recipe.kind == "shell":
        return shell(
            recipe.n,
            recipe.m,
            cls=recipe.cls,
            primal=recipe.primal,
            radius=recipe.radius,
            height=recipe.height,
            overlap=recipe.overlap,
            twist=recipe.twist,
            pins=recipe.pins,
        )
    if recipe.kind == "prism":
        return prism(recipe.n, radius=recipe.radius, height=recipe.height, twist=recipe.twist, pins=recipe.pins)
    build = planar if recipe.kind == "planar" else network
    return build(recipe.nodes, recipe.rods, recipe.tendons, recipe.pins)
