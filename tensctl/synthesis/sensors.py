"""What is measured, and with how much noise.

    y_k = (lengths, tensions, positions)_k + sigma n_k,   n_k standard normal, drawn for sample k from (seed, k)

Drawing by number makes runs repeatable and lets them be resumed: no generator has to be remembered.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.linear.outputs import safe_label
from tensctl.scene.given import argument, check_kind
from tensctl.scene.tables import per_member
from tensctl.scene.values import Number
from tensctl.statics import Equilibrium
from tensctl.structure import Structure
from tensctl.structure.labels import by_label
from tensctl.synthesis.shown import shown

Noise = float | Mapping[str, float]
_UNITS = {"lengths": "m", "tensions": "N", "nodes": "m"}


class Measurable(Protocol):
    """The state of the structure that sensors look at."""

    @property
    def nodes(self) -> np.ndarray:
        """Node positions, (N, 3) m."""
        ...

    @property
    def lengths(self) -> np.ndarray:
        """Tendon lengths, (nt,) m."""
        ...

    @property
    def tensions(self) -> np.ndarray:
        """Tensions, (nt,) N."""
        ...

    @property
    def inputs(self) -> np.ndarray:
        """Rest-length changes as they are now, (nu,) m."""
        ...


@dataclass(frozen=True, eq=False)
class Reading:
    """What sensors show at a sample, and nothing else.

    Attributes
    ----------
    values : (ny,)
        With noise, in the order of `Sensors.labels`.
    inputs : (nu,) m
        Rest-length changes as they are now; actuators know them.
    commands : (nu,) m, optional
        Those that were asked for until now, as far as the measurement tells.
    """

    values: Float[np.ndarray, " ny"]
    inputs: Float[np.ndarray, " nu"]
    commands: Float[np.ndarray, " nu"] | None = None


@dataclass(frozen=True, eq=False)
class Sensors:
    """Sensors on a structure.

    Attributes
    ----------
    structure : Structure
    lengths, tensions : (k,) int
        Tendons whose length or tension is measured.
    positions : (k,) int
        Flat indices 3 node + axis of the coordinates that are measured.
    noise : (ny,)
        Standard deviation of each sample, m or N, in this order.
    seed : int
    """

    structure: Structure
    lengths: np.ndarray
    tensions: np.ndarray
    positions: np.ndarray
    noise: Float[np.ndarray, " ny"]
    seed: int = 0

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels as the linear model's outputs have them."""
        tendons, nodes = self.structure.tendon_labels, self.structure.node_labels
        return (
            *(f"l_{safe_label(tendons[k])}" for k in self.lengths),
            *(f"T_{safe_label(tendons[k])}" for k in self.tensions),
            *(f"{safe_label(nodes[k // 3])}_{'xyz'[k % 3]}" for k in self.positions),
        )

    def of(self, state: Measurable | Equilibrium) -> Float[np.ndarray, " ny"]:
        """What they would show without noise."""
        positions = np.asarray(state.nodes).ravel()[self.positions]
        return np.concatenate([state.lengths[self.lengths], state.tensions[self.tensions], positions])

    def read(self, state: Measurable | Equilibrium, sample: int) -> Reading:
        """What they show at a sample, by its number."""
        drawn = np.random.default_rng([self.seed, sample]).standard_normal(self.noise.size)
        return Reading(self.of(state) + self.noise * drawn, np.asarray(state.inputs), getattr(state, "commands", None))

    def rows(self, linear: LinearModel) -> tuple[Float[np.ndarray, "ny nx"], Float[np.ndarray, "ny nu"]]:
        """C and D of a linear model of the same structure."""
        model = shown(linear, "lengths", "tensions", "nodes")
        place = {label: k for k, label in enumerate(model.outputs)}
        rows = [place[label] for label in self.labels]
        return model.C[rows], model.D[rows]


def sensors(
    structure: Structure,
    *,
    lengths: Noise | None = None,
    tensions: Noise | None = None,
    nodes: Noise | None = None,
    seed: int = 0,
) -> Sensors:
    """Sensors by the noise that they have; what is not named is not measured.

    Parameters
    ----------
    lengths, tensions, nodes : number or table by label pattern, optional
        Standard deviation of each sample: m of tendon lengths, N of tensions, m of each free coordinate of nodes. A
        number measures all of them, a table those that it names.

    Raises
    ------
    SynthesisError
        A noise that is no positive number, nothing measured, or positions of a structure that floats freely.
    """
    check_kind(Structure, structure=structure)
    seed = argument("sensors.seed", seed, Number(least=0, whole=True))
    tendons = structure.tendon_labels
    by_length = _noise("lengths", tendons, lengths)
    by_tension = _noise("tensions", tendons, tensions)
    by_node = np.repeat(_noise("nodes", structure.node_labels, nodes), 3)
    by_node[~structure.free.ravel()] = np.inf
    chosen = [np.flatnonzero(np.isfinite(noise)) for noise in (by_length, by_tension, by_node)]
    noise = np.concatenate([by_length[chosen[0]], by_tension[chosen[1]], by_node[chosen[2]]])
    if not noise.size:
        raise SynthesisError("no sensor is given; measure lengths, tensions or nodes, each with its noise.")
    if chosen[2].size and not structure.held.any():
        raise SynthesisError(
            "positions of a free structure tell of its drift and turning, which no tendon can take back; "
            "measure lengths or tensions."
        )
    return Sensors(structure, chosen[0], chosen[1], chosen[2], noise, seed)


def _noise(name: str, labels: tuple[str, ...], given: Noise | None) -> np.ndarray:
    if given is None:
        return np.full(len(labels), np.inf)
    noise = argument(f"sensors.{name}", given, per_member(Number(_UNITS[name], above=0)))
    return by_label(labels, noise, f"sensors.{name}", np.inf)
