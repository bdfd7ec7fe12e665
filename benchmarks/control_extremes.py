"""Verdicts, distances and Riccati solutions of the pinned prism at the edges of double precision, against 50 digits.

python benchmarks/control_extremes.py           # prints the table
python benchmarks/control_extremes.py --docs    # and writes it into docs/controllability.md

Gains of one group of near frequencies are compared by the root of their sum of squares; of damped models the weakest
gain is. Gains K are compared as R^1/2 K, with the solution of the same A, B, Q and R.
"""

from collections.abc import Iterator

import mpmath as mp
import numpy as np
import page
from fifty_digits import DIGITS, damped_gains, distances, exact, group_gains, regulator, size

import tensctl as tc
from tensctl.analysis.modal import near_modes
from tensctl.elements import Potential
from tensctl.errors import TensctlError
from tensctl.linear import LinearModel
from tensctl.statics import Equilibrium
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread

LABELS = tc.prism(3).tendon_labels
SIGNS = {"yes": "y", "no": "n", "undecided": "?"}
HEAD = ["case", "value", "mode by mode", "least gain", "largest", "error", "least distance, 1/s", "in 100 digits"]
HEAD += ["energies: residual", "error of K", "estimated", "nodes: residual", "error of K", "estimated"]


def prism(**sections) -> tc.Scene:
    return tc.Scene(structure={"kind": "prism", "n": 3, "pins": ["a*"]}, **sections)


def linear_at(scene: tc.Scene, nodes: np.ndarray | None = None, side="refuse") -> LinearModel:
    """The linear model at rest, or at given nodes that are known to rest."""
    if nodes is None:
        rest = tc.find_equilibrium(scene)
    else:
        potential = Potential.of(scene)
        rest = Equilibrium(potential, nodes, potential.members.rest_lengths, 0)
    return tc.linearize(tc.build_dynamics(scene), rest, outputs=(), on_boundary=side)


def stiffer(ratio: float) -> LinearModel:
    """One side tendon `ratio` times stiffer, its rest length such that tensions and shape stay."""
    rest = tc.find_equilibrium(prism())
    k = np.array([100.0 * (ratio if label == "side1" else 1.0) for label in LABELS])
    lengths = rest.lengths - rest.tensions / k
    tendons = {
        "stiffness": dict(zip(LABELS, k.tolist(), strict=True)),
        "rest_length": dict(zip(LABELS, lengths.tolist(), strict=True)),
    }
    return linear_at(prism(tendons=tendons), rest.nodes)


def beside(part: float, side="refuse") -> LinearModel:
    """The prism with a tie from a1 to b2 that is stretched by a part of its length, or slack by it."""
    rest = tc.find_equilibrium(prism())
    built, nodes = rest.structure, rest.nodes
    names = built.node_labels

    def ends(pairs: np.ndarray, labels: tuple[str, ...]) -> dict[str, list[str]]:
        return {label: [names[a], names[b]] for label, (a, b) in zip(labels, pairs, strict=True)}

    structure = {
        "kind": "network",
        "nodes": dict(zip(names, nodes.tolist(), strict=True)),
        "rods": ends(built.rods, built.rod_labels),
        "tendons": ends(built.tendons, LABELS) | {"tie": ["a1", "b2"]},
        "pins": ["a*"],
    }
    lengths = dict(zip(LABELS, rest.rest_lengths.tolist(), strict=True))
    lengths["tie"] = float(np.linalg.norm(nodes[0] - nodes[4])) * (1 - part)
    scene = tc.Scene(structure=structure, tendons={"stiffness": 100.0, "rest_length": lengths})
    return linear_at(scene, side=side)


def cases() -> Iterator[tuple[str, str, LinearModel]]:
    for ratio in (1e0, 1e2, 1e4, 1e6, 1e8, 1e10, 1e12):
        yield "one tendon stiffer", f"{ratio:.0e}", stiffer(ratio)
    for ratio in (1e0, 1e2, 1e4, 1e6, 1e8):
        yield "one rod heavier", f"{ratio:.0e}", linear_at(prism(rods={"mass": {"*": 1.0, "rod1": ratio}}))
    for strain in (0.9, 0.5, 1e-2, 1e-4, 1e-6, 1e-8, 1e-9):
        yield "prestress (strain)", f"{strain:.0e}", linear_at(prism(tendons={"rest_ratio": 1.0 - strain}))
    for ratio in (0.0, 1e-6, 1e-3, 1e-1, 1.0):
        damping = {"damping": {"ratio": ratio}}
        yield "damping of critical", f"{ratio:.0e}" if ratio else "0", linear_at(prism(tendons=damping))
    for part in (0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2):
        stiffness = {"*": 100.0, "top2": 100.0 * (1 + part)}
        scene = prism(tendons={"stiffness": stiffness}, actuators={"tendons": ["side1"]})
        yield "one motor, symmetry broken by", f"{part:.0e}" if part else "0", linear_at(scene)
    for part in (1e-2, 1e-6, 1e-10, 1e-12, -1e-12, -1e-10, -1e-6, -1e-2):
        yield "a tie stretched by", f"{part:.0e}", beside(part)
    for side in ("taut", "slack"):
        yield "a tie on the boundary", side, beside(0.0, side)


def gain_error(linear: LinearModel, report: tc.ModalReport) -> float:
    """Worst relative difference of a group's gains to 50 digits; of damped models the weakest gain alone."""
    gains = np.array([mode.gain for mode in report.modes])
    if linear.dynamics.damped:
        return abs(gains.min() / damped_gains(linear)[0] - 1)
    groups = [group for group, _ in near_modes(linear)]
    found, wanted = np.array([np.linalg.norm(gains[group]) for group in groups]), group_gains(linear, groups)
    return float((np.abs(found - wanted) / np.where(wanted > 0, wanted, 1.0)).max())


def designed(linear: LinearModel, cost: Cost | None) -> tuple[str, str, str]:
    """Residual of the Riccati equation, the relative error of R^1/2 K, and the design's own estimate of it."""
    try:
        design = tc.lqr(linear, cost=cost, stabilisable_only=True)
    except TensctlError:
        return "refused", "", ""
    T, root = design.basis, np.sqrt(np.diag(design.R))[:, None]
    wanted = root * regulator(T.T @ design.A @ T, T.T @ design.B, T.T @ design.Q @ T, design.R)
    error = size(wanted - exact(root * (design.K @ T))) / size(wanted)
    left = len(T) - T.shape[1]
    return (
        f"{design.residual:.0e}" + (f", {left} states left" if left else ""),
        f"{float(error):.0e}",
        f"{design.gain_doubt:.0e}",
    )


def rows() -> Iterator[list[str]]:
    for what, value, linear in cases():
        with mp.workdps(DIGITS):
            report = tc.controllability(linear)
            gains = [mode.gain for mode in report.modes]
            row = [what, value, "".join(SIGNS[mode.verdict] for mode in report.modes)]
            row += [f"{min(gains):.3g}", f"{max(gains):.3g}", f"{gain_error(linear, report):.0e}"]
            row += [f"{report.hautus.min():.2e}", f"{distances(linear)[0]:.2e}"]
            row += designed(linear, None)
            row += designed(linear, tc.weights(linear, nodes=0.01, rest_lengths=0.05))
        yield row


@one_blas_thread()
def main() -> None:
    page.tell("controllability.md", "extremes", HEAD, rows())


if __name__ == "__main__":
    main()
