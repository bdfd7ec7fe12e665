"""What a linear model shows: positions, velocities, lengths and tensions to first order, or any mix of them ([S] 5.22).

    dp = J xi,   dp' = J xi',   dl = (dl/dp) dp,   dT = (dT/dl) dl + c dl' + (dT/du) u,   slack tendons: dT = 0

These signals, stacked as (p, p', l, T) over all nodes and tendons, are the raw ones; every output is a weighted sum of
them, so one matrix of weights chooses, orders and mixes, for the linear model and for the nonlinear one alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.errors import LinearizationError, StructureError
from tensctl.model import Dynamics
from tensctl.scene.complaint import shown
from tensctl.statics import Equilibrium, stretch_map
from tensctl.structure import Structure
from tensctl.structure.labels import matches

_KINDS = ("nodes", "velocities", "lengths", "tensions")


@dataclass(frozen=True, eq=False)
class Mix:
    """Outputs that are weighted sums of others.

    Attributes
    ----------
    rows : table by output name of tables by label
        `Mix({"lean": {"P4_1_1_x": 0.5, "P4_2_1_x": 0.5}})`: the mean x of two nodes. Labels are those of plain outputs:
        `P4_1_1_x`, `v_P4_1_1_x`, `l_t5_1_1`, `T_t5_1_1`.
    """

    rows: Mapping[str, Mapping[str, float]]


Output = str | Mix


@dataclass(frozen=True, eq=False)
class OutputMap:
    """Outputs from tangent coordinates xi, their rates and the shortenings of all tendons; sparse.

    Attributes
    ----------
    labels : tuple of str
    weights : (ny, 6 N + 2 nt)
        Outputs from the raw signals (p, p', l, T).
    position, rate : (ny, size)
    feedthrough : (ny, nt)
    """

    labels: tuple[str, ...]
    weights: sp.csr_array
    position: sp.csr_array
    rate: sp.csr_array
    feedthrough: sp.csr_array


def output_map(dynamics: Dynamics, equilibrium: Equilibrium, outputs: Output | Sequence[Output]) -> OutputMap:
    """Stack the maps of the outputs asked for, one or several.

    Raises
    ------
    LinearizationError
        An unknown kind, a pattern or label that names nothing, an infinite weight, or an output asked for twice.
    """
    names, outputs = _Names(dynamics.structure), [outputs] if isinstance(outputs, Output) else outputs
    if not (isinstance(outputs, Sequence) and all(isinstance(asked, Output) for asked in outputs)):
        raise LinearizationError(f"outputs is {shown(outputs)}; {', '.join(_KINDS)} or a tc.Mix are expected.")
    parts = [names.mixed(asked) if isinstance(asked, Mix) else names.chosen(asked) for asked in outputs]
    labels = tuple(label for found, _ in parts for label in found)
    if len(set(labels)) < len(labels):
        twice = next(label for k, label in enumerate(labels) if label in labels[:k])
        raise LinearizationError(f"output {twice} is asked for twice; name it once.")
    weights = sp.csr_array(sp.vstack([sp.csr_array((0, len(names.labels))), *(rows for _, rows in parts)]))
    position, rate, feedthrough = _raw(dynamics, equilibrium)
    return OutputMap(labels, weights, *(sp.csr_array(weights @ part) for part in (position, rate, feedthrough)))


def safe_label(label: str) -> str:
    """A label that python-control takes: no dots."""
    return label.replace(".", "_")


def signal_labels(structure: Structure) -> list[str]:
    """Labels of the raw signals (p, p', l, T): nodes' coordinates and rates, lengths, tensions."""
    tendons = [safe_label(label) for label in structure.tendon_labels]
    axes = [f"{safe_label(label)}_{axis}" for label in structure.node_labels for axis in "xyz"]
    return [*axes, *(f"v_{a}" for a in axes), *(f"l_{t}" for t in tendons), *(f"T_{t}" for t in tendons)]


class _Names:
    """Labels of the raw signals, and the weights that choose among them."""

    def __init__(self, structure: Structure) -> None:
        self.labels = signal_labels(structure)
        self._members = [label for label in structure.node_labels for _ in "xyz"], list(structure.tendon_labels)
        self._moving = np.flatnonzero(structure.free)

    def chosen(self, asked: str) -> tuple[list[str], sp.csr_array]:
        """Labels and weights of `kind` or `kind:pattern`."""
        kind, _, pattern = asked.partition(":")
        if kind not in _KINDS:
            raise LinearizationError(f'output "{kind}" is unknown; choose from {", ".join(_KINDS)}.')
        coordinates, tendons = (len(names) for names in self._members)
        at_nodes = kind in ("nodes", "velocities")
        rows = self._moving if at_nodes else np.arange(tendons)
        start = {"nodes": 0, "velocities": coordinates, "lengths": 2 * coordinates}.get(kind, 2 * coordinates + tendons)
        if pattern:
            rows = rows[self._matching(rows, pattern, asked, at_nodes=at_nodes)]
        return [self.labels[start + k] for k in rows], self._unit(start + rows)

    def mixed(self, mix: Mix) -> tuple[list[str], sp.csr_array]:
        """Labels and weights of a mix."""
        place = {label: k for k, label in reversed(list(enumerate(self.labels)))}
        weights = sp.lil_array((len(mix.rows), len(self.labels)))
        for row, (name, terms) in enumerate(mix.rows.items()):
            for label, weight in terms.items():
                if safe_label(label) not in place:
                    raise LinearizationError(
                        f"the mix {name} asks for {label}, which is no output; labels are like P4_1_1_x, v_P4_1_1_x, "
                        "l_t5_1_1 or T_t5_1_1."
                    )
                if not np.isfinite(weight):
                    raise LinearizationError(
                        f"the mix {name} gives {label} the weight {weight}; a finite number is expected."
                    )
                weights[row, place[safe_label(label)]] = weight
        return [safe_label(name) for name in mix.rows], sp.csr_array(weights)

    def _matching(self, rows: np.ndarray, pattern: str, asked: str, *, at_nodes: bool) -> list[int]:
        """Rows whose node, node and axis, or tendon the pattern names."""
        members = self._members[0 if at_nodes else 1]
        tries = [[members[k] for k in rows]] + ([[self.labels[k] for k in rows]] if at_nodes else [])
        complaint = ""
        for labels in tries:
            try:
                return matches(labels, pattern, f'outputs "{asked}"')
            except StructureError as error:
                complaint = str(error)
        raise LinearizationError(complaint)

    def _unit(self, rows: np.ndarray) -> sp.csr_array:
        entries = (np.ones(rows.size), (np.arange(rows.size), rows))
        return sp.csr_array(sp.coo_array(entries, shape=(rows.size, len(self.labels))))


def _raw(dynamics: Dynamics, equilibrium: Equilibrium) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    """The raw signals from xi, xi' and the shortenings."""
    tangent, stretch = equilibrium.point.tangent, stretch_map(equilibrium)
    slope, through = _slopes(dynamics, equilibrium)
    still, count = sp.csr_array(tangent.shape), len(equilibrium.lengths)
    damper = sp.diags_array(dynamics.damping * (equilibrium.tensions > 0))
    position = sp.vstack([tangent, still, stretch, sp.diags_array(slope) @ stretch])
    rate = sp.vstack([still, tangent, sp.csr_array(stretch.shape), damper @ stretch])
    feedthrough = sp.vstack([sp.csr_array((2 * tangent.shape[0] + count, count)), sp.diags_array(through)])
    return sp.csr_array(position), sp.csr_array(rate), sp.csr_array(feedthrough)


def _slopes(dynamics: Dynamics, equilibrium: Equilibrium) -> tuple[Float[np.ndarray, " nt"], Float[np.ndarray, " nt"]]:
    """Growth of each tension with its length and with the shortening of its rest length, N/m."""
    members, rest = dynamics.members, equilibrium.rest_lengths
    slope = np.where(equilibrium.tensions > 0, members.stiffness if members.law == "k" else members.stiffness / rest, 0)
    # dT/du = -dT/dL: k for constant k, EA l / L^2 for constant EA.
    return slope, slope if members.law == "k" else slope * equilibrium.lengths / rest
