"""Answers and gains of the pinned prism at the edges of double precision, against fifty digits.

python benchmarks/control_extremes.py

The reference takes Hessian, masses and input map as the doubles they are; eigenvectors and gains follow in 50 digits.
Gains of one group of near frequencies are compared by the root of their sum of squares, which no choice of directions
inside the group changes. The largest number of the column is the worst group's relative difference. Writes the table of
docs/controllability.md.
"""

from collections import Counter
from collections.abc import Iterator

import mpmath as mp
import numpy as np
from page import table, write

import tensctl as tc
from tensctl.analysis.modal import near_modes
from tensctl.elements import Potential
from tensctl.linear import LinearModel
from tensctl.statics import Equilibrium

DIGITS = 50
LABELS = tc.prism(3).tendon_labels


def prism(**sections) -> tc.Scene:
    return tc.Scene(structure={"kind": "prism", "n": 3, "pins": ["a*"]}, **sections)


def linear_at(scene: tc.Scene, nodes: np.ndarray | None = None) -> LinearModel:
    """The linear model at rest, or at given nodes that are known to rest; tendons on the slack boundary are taut."""
    if nodes is None:
        rest = tc.find_equilibrium(scene)
    else:
        potential = Potential.of(scene)
        rest = Equilibrium(potential, nodes, potential.members.rest_lengths, 0)
    return tc.linearize(tc.build_dynamics(scene), rest, outputs=(), on_boundary="taut")


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


def cases() -> Iterator[tuple[str, float, LinearModel]]:
    for ratio in (1e0, 1e4, 1e8, 1e12):
        yield "one tendon stiffer", ratio, stiffer(ratio)
    for ratio in (1e0, 1e4, 1e8):
        yield "one rod heavier", ratio, linear_at(prism(rods={"mass": {"*": 1.0, "rod1": ratio}}))
    for strain in (0.5, 1e-2, 1e-4, 1e-6, 1e-8, 1e-9):
        scene = prism(tendons={"rest_ratio": 1.0 - strain})
        yield "prestress (strain)", strain, linear_at(scene)
    for part in (0.0, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2):
        stiffness = {"*": 100.0, "top2": 100.0 * (1 + part)}
        scene = prism(tendons={"stiffness": stiffness}, actuators={"tendons": ["side1"]})
        yield "one motor, symmetry broken by", part, linear_at(scene)
    for coefficient in (1e-6, 1e-2, 1.0, 10.0, 30.0):
        yield "damping, N s/m", coefficient, linear_at(prism(tendons={"damping": coefficient}))


def exact_gains(linear: LinearModel) -> list[float]:
    """Root of the sum of squared gains of each group of near frequencies, undamped, in 50 digits."""
    manifold, members = linear.equilibrium.potential.manifold, linear.dynamics.members
    mass = [mp.sqrt(mp.mpf(float(m))) for m in manifold.mass(members.mass)]
    H, G = linear.equilibrium.point.hessian.toarray(), linear.sparse.G.toarray()
    n = len(mass)
    scaled = mp.matrix(n, n)
    for i in range(n):
        for j in range(n):
            scaled[i, j] = (mp.mpf(float(H[i, j])) + mp.mpf(float(H[j, i]))) / 2 / (mass[i] * mass[j])
    _, vectors = mp.eigsy(scaled)
    rows = mp.matrix(n, G.shape[1])
    for k in range(n):
        for t in range(G.shape[1]):
            rows[k, t] = mp.fsum(vectors[i, k] * mp.mpf(float(G[i, t])) / mass[i] for i in range(n))
    sizes = [mp.fsum(rows[k, t] ** 2 for t in range(G.shape[1])) for k in range(n)]
    return [float(mp.sqrt(mp.fsum(sizes[k] for k in group))) for group, _ in near_modes(linear)]


def exact_damped(linear: LinearModel) -> list[float]:
    """sqrt(2) times the drive of each left eigenvector of the damped A, in 50 digits, ascending."""
    A, B = mp.matrix(linear.A.T.tolist()), mp.matrix(linear.B.tolist())
    _, vectors = mp.eig(A)
    found = []
    for k in range(A.rows):
        v = vectors[:, k]
        size = mp.sqrt(mp.fsum(abs(x) ** 2 for x in v))
        drive = mp.fsum(abs(mp.fsum(v[i] * B[i, t] for i in range(A.rows))) ** 2 for t in range(B.cols))
        found.append(float(mp.sqrt(2 * drive) / size))
    return sorted(found)


def error(linear: LinearModel, report: tc.ModalReport) -> float:
    """Worst relative difference of a group's gains to 50 digits; of damped models the weakest gain alone."""
    gains = np.array([mode.gain for mode in report.modes])
    with mp.workdps(DIGITS):
        if linear.dynamics.damped:
            return abs(gains.min() / exact_damped(linear)[0] - 1)
        exact = np.array(exact_gains(linear))
    found = np.array([np.linalg.norm(gains[group]) for group, _ in near_modes(linear)])
    return float((np.abs(found - exact) / np.where(exact > 0, exact, 1.0)).max())


def main() -> None:
    rows = []
    for what, value, linear in cases():
        report = tc.controllability(linear)
        answers = Counter(mode.verdict for mode in report.modes)
        said = ", ".join(f"{answers[word]} {word}" for word in ("yes", "undecided", "no") if answers[word])
        gains = [mode.gain for mode in report.modes]
        row = [what, f"{value:.0e}" if value else "0", said, f"{min(gains):.3g}", f"{max(gains):.3g}"]
        rows.append([*row, f"{report.hautus.min():.1e}", f"{error(linear, report):.0e}"])
    head = ["case", "value", "answers", "least gain", "largest", "over A and B, 1/s", "error against 50 digits"]
    text = table(head, rows)
    print(text)
    write("controllability.md", {"extremes": text})


if __name__ == "__main__":
    main()
