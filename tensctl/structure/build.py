"""From the scene's recipe to the structure it describes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tensctl.errors import StructureError
from tensctl.structure.network import network
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
        A recipe that makes no structure, or a pin that names no node or holds a node only in part.
    """
    recipe = scene.structure
    pins = _whole_pins(recipe.pins)
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
            pins=pins,
        )
    if recipe.kind == "prism":
        return prism(recipe.n, radius=recipe.radius, height=recipe.height, twist=recipe.twist, pins=pins)
    return network(recipe.nodes, recipe.rods, recipe.tendons, pins)


def _whole_pins(pins) -> list[str]:
    if not isinstance(pins, dict):
        return list(pins)
    for label, directions in pins.items():
        if set(directions) != set("xyz"):
            raise StructureError(
                f'structure.pins: {label} = "{directions}" holds a node in some directions only, '
                'which is not supported yet; use "xyz" or leave the node free.'
            )
    return list(pins)
