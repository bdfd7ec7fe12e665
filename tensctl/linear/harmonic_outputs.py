"""Outputs of a cyclically symmetric structure by harmonic: those of one sector and their images.

    y_k = C_k x_k + D_k u_k,   y_k = n^-1/2 sum_s exp(-2 pi i k s/n) R_s' y_s

R_s turns nodes' positions back to the first sector's axes and leaves lengths and tensions as they are, so the transform
of all outputs is unitary: norms, gains and energies are those of the whole structure in the world's axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast, get_args

import numpy as np
from jaxtyping import Float, Inexact, Int

from tensctl.errors import LinearizationError
from tensctl.linear.harmonic import HarmonicModel
from tensctl.linear.harmonic_block import Harmonic, Shown
from tensctl.linear.outputs import safe_label
from tensctl.structure.labels import matches


@dataclass(frozen=True, eq=False)
class Orbits:
    """Outputs of one kind.

    Attributes
    ----------
    kind : "nodes", "lengths" or "tensions"
    rows : (y,) int
        Rows of the sector's outputs of this kind; of nodes three at a time.
    places : (n, y) int
        Position of each image in the whole structure's outputs.
    """

    kind: Shown
    rows: Int[np.ndarray, " y"]
    places: Int[np.ndarray, "n y"]


@dataclass(frozen=True, eq=False)
class HarmonicOutputs:
    """Outputs that a turn by a sector carries onto each other.

    Attributes
    ----------
    model : HarmonicModel
    labels : tuple of str
        As in `LinearModel.outputs`.
    orbits : tuple of Orbits
    """

    model: HarmonicModel
    labels: tuple[str, ...]
    orbits: tuple[Orbits, ...]

    @classmethod
    def of(cls, model: HarmonicModel, members: Sequence[tuple[Shown, Int[np.ndarray, " _"]]]) -> HarmonicOutputs:
        """Outputs by kind and number: tendons, or 3 node + axis, in this order.

        Raises
        ------
        LinearizationError
            For outputs whose images are not all there, or of nodes that the ground holds.
        """
        labels: list[str] = []
        orbits = []
        for kind, chosen in members:
            orbits.append(_orbits(model, kind, chosen, len(labels)))
            labels += _labels(model, kind, chosen)
        return cls(model, tuple(labels), tuple(orbits))

    @property
    def sector_labels(self) -> tuple[str, ...]:
        """Labels of the first sector's outputs, each standing for its images."""
        return tuple(self.labels[k] for orbit in self.orbits for k in orbit.places[0])

    def C(self, block: Harmonic) -> Inexact[np.ndarray, "y nx"]:
        """Output matrix of a harmonic."""
        return np.vstack([np.zeros((0, block.nx)), *(block.C(orbit.kind)[orbit.rows] for orbit in self.orbits)])

    def D(self, block: Harmonic) -> Inexact[np.ndarray, "y p"]:
        """Feedthrough of a harmonic."""
        still = np.zeros((0, block.gear.shape[1]))
        return np.vstack([still, *(block.D(orbit.kind)[orbit.rows] for orbit in self.orbits)])

    def waves(self, y: Float[np.ndarray, "ny *columns"]) -> list[Inexact[np.ndarray, "y *columns"]]:
        """Harmonics of outputs of the whole structure."""
        own = [self._turned(orbit, y[orbit.places], back=True) for orbit in self.orbits]
        return self.model.map.forward(np.concatenate(own, axis=1))

    def values(self, waves: list[Inexact[np.ndarray, "y *columns"]]) -> Float[np.ndarray, "ny *columns"]:
        """Outputs of the whole structure from their harmonics."""
        own, at = self.model.map.backward(waves), 0
        y = np.empty((len(self.labels), *own.shape[2:]))
        for orbit in self.orbits:
            y[orbit.places] = self._turned(orbit, own[:, at : at + orbit.rows.size], back=False)
            at += orbit.rows.size
        return y

    def squares(self, factors: Sequence[Inexact[np.ndarray, "y _"]]) -> Float[np.ndarray, " ny"]:
        """Diagonal of a symmetric covariance of y, whose harmonics have the covariances S_k S_k*.

        Of nodes 3 x 3 blocks are turned to the world's axes; nothing of full size is formed.
        """
        n, total, at = self.model.order, np.empty(len(self.labels)), 0
        for orbit in self.orbits:
            size = 3 if orbit.kind == "nodes" else 1
            own = np.zeros((orbit.rows.size // size, size, size))
            for block, S in zip(self.model.blocks, factors, strict=True):
                part = S[at : at + orbit.rows.size].reshape(-1, size, S.shape[1])
                own += (block.copies / n) * np.real(part @ part.conj().transpose(0, 2, 1))
            turns = self.model.map.point.sector.symmetry.turns if size == 3 else np.ones((n, 1, 1))
            diagonal = np.einsum("sij,ajk,sik->sai", turns, own, turns)
            total[orbit.places] = diagonal.reshape(n, -1)
            at += orbit.rows.size
        return total

    def _turned(self, orbit: Orbits, values: np.ndarray, *, back: bool) -> np.ndarray:
        """Positions (n, y, ...) in axes that turn with the sectors, or turned forth to the world's."""
        if orbit.kind != "nodes":
            return values
        turns = self.model.map.point.sector.symmetry.turns
        by_node = values.reshape(len(values), -1, 3, *values.shape[2:])
        turned = np.einsum("sji,saj...->sai..." if back else "sij,saj...->sai...", turns, by_node)
        return turned.reshape(values.shape)


def harmonic_outputs(model: HarmonicModel, outputs: str | Sequence[str]) -> HarmonicOutputs:
    """Outputs by name, `kind` or `kind:pattern`, as `linearize` takes them.

    Parameters
    ----------
    outputs : one or several of "nodes", "lengths", "tensions"
        Each with a pattern of node or tendon labels where not all are meant.

    Raises
    ------
    LinearizationError
        An unknown kind, or outputs that leave out an image.
    """
    structure, members = model.dynamics.structure, []
    for asked in [outputs] if isinstance(outputs, str) else outputs:
        kind, _, pattern = asked.partition(":")
        if kind not in get_args(Shown):
            raise LinearizationError(
                f'output "{kind}" is unknown to harmonics; choose from {", ".join(get_args(Shown))}.'
            )
        labels = structure.node_labels if kind == "nodes" else structure.tendon_labels
        chosen = np.sort(matches(labels, pattern, f'outputs "{asked}"')) if pattern else np.arange(len(labels))
        if kind == "nodes":
            chosen = np.asarray(chosen)[structure.free[chosen].any(axis=1)]
            chosen = (3 * chosen[:, None] + np.arange(3)).ravel()
        members.append((cast(Shown, kind), np.asarray(chosen, int)))
    return HarmonicOutputs.of(model, members)


def _orbits(model: HarmonicModel, kind: Shown, chosen: np.ndarray, start: int) -> Orbits:
    symmetry, structure = model.map.point.sector.symmetry, model.dynamics.structure
    if kind == "nodes":
        size, axes = structure.nodes.size, np.arange(3)
        images = (3 * symmetry.nodes[..., None] + axes).reshape(model.order, -1)
        images = images[:, structure.free.ravel()[images[0]]]
    else:
        size, images = len(structure.tendons), symmetry.tendons
    place = np.full(size, -1)
    place[chosen] = start + np.arange(chosen.size)
    there = place[images] >= 0
    whole = (there == there[0]).all() and there.sum() == np.unique(chosen).size == chosen.size
    if kind == "nodes":
        by_node = there[0].reshape(-1, 3)
        whole = whole and bool((by_node == by_node[:, :1]).all())
    if not whole:
        raise LinearizationError(
            f"outputs {kind} leave out images of what they show in other sectors, or axes of a node, or show a held "
            "node; name whole rings of tendons or free nodes, or use tc.linearize."
        )
    rows = np.flatnonzero(there[0])
    return Orbits(kind, rows, place[images[:, rows]])


def _labels(model: HarmonicModel, kind: Shown, chosen: np.ndarray) -> list[str]:
    structure = model.dynamics.structure
    if kind == "nodes":
        return [f"{safe_label(structure.node_labels[k // 3])}_{'xyz'[k % 3]}" for k in chosen]
    return [f"{kind[0] if kind == 'lengths' else 'T'}_{safe_label(structure.tendon_labels[k])}" for k in chosen]
