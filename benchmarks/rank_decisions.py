"""Rank and stability decisions near the edge: error, verdict and run time against 50-digit arithmetic.

python benchmarks/rank_decisions.py

The reference takes the nodes as the doubles they are, and everything after them in 50 digits. A rank verdict is *right*
when it is the reference's, *to rounding* when it calls a true value zero that one unit in the last place of the matrix
can make or unmake (max(rows, columns) * 2^-52 of the largest), *undecided* when the method says so, else *wrong*.
"""

import time

import mpmath as mp
import numpy as np
import scipy.linalg as sla
import scipy.spatial

import tensctl as tc
from tensctl.elements import Potential
from tensctl.statics.algebra.rank_decision import decide_rank
from tensctl.statics.inverse import inverse_statics
from tensctl.statics.prestress import (
    admissible_prestress,
    equilibrium_matrix,
    rigid_fields,
    self_stress,
    stability_orders,
    subspaces,
)

EPS = np.finfo(float).eps
DIGITS = 50


def near_line(offset: float) -> tc.Structure:
    """A rod about a pin and a tendon along it, `offset` beside the line: one direction is a mechanism to the other."""
    nodes = [[0, 0, 0], [1, 0, 0], [-1, offset, 0], [1, 0, 1]]
    return tc.network(nodes, [[0, 1]], [[1, 2], [1, 3]], [0, 2, 3])


def near_twist(offset: float) -> tc.Structure:
    """A prism `offset` rad away from the twist at which it has a mechanism."""
    return tc.prism(3, twist=5 * np.pi / 6 + offset)


def long_rod(ratio: float) -> tc.Structure:
    """A prism at another twist, one rod 1/ratio times longer: the tendons of its far end become parallel to it."""
    prism = tc.prism(3, twist=2.4)
    nodes = prism.nodes.copy()
    nodes[3] = nodes[0] + (nodes[3] - nodes[0]) / ratio
    return tc.network(nodes, prism.rods, prism.tendons)


# Beyond 1e12 the other two rods are rounding beside the long one, and no structure is built.
CASES = {"near line": (near_line, 17), "near twist": (near_twist, 17), "long rod": (long_rod, 13)}


def by_svd(structure):
    """What the package does: singular values without rigid-body motions."""
    matrix = equilibrium_matrix(structure)
    fields = rigid_fields(matrix.nodes, structure.pinned)
    complement = np.linalg.qr(fields[matrix.free], mode="complete")[0][:, fields.shape[1] :]
    acting = np.concatenate([matrix.acting_tendons, matrix.acting_rods])
    return subspaces(complement.T @ matrix.full[:, np.flatnonzero(acting)].toarray()).decision


def by_qr(structure):
    """Diagonal of a pivoted QR: cheaper, and no better than a factor of the size away from the singular values."""
    A = dense(structure)
    diagonal = np.abs(np.diag(sla.qr(A, mode="r", pivoting=True)[0]))
    return decide_rank(diagonal, scale=diagonal.max(), rounding=max(A.shape) * EPS * diagonal.max())


def by_gram(structure):
    """Eigenvalues of A'A: half of the digits are gone before the decision."""
    A = dense(structure)
    values = np.sqrt(np.maximum(np.linalg.eigvalsh(A.T @ A), 0.0))
    return decide_rank(values, scale=values.max(), rounding=np.sqrt(max(A.shape) * EPS) * values.max())


METHODS = {"SVD (tensctl)": by_svd, "pivoted QR": by_qr, "A'A": by_gram}


def dense(structure) -> np.ndarray:
    matrix = equilibrium_matrix(structure)
    acting = np.concatenate([matrix.acting_tendons, matrix.acting_rods])
    return matrix.full[:, np.flatnonzero(acting)].toarray()


def exact_matrix(structure) -> mp.matrix:
    """The equilibrium matrix in many digits, from nodes and members alone."""
    free = [3 * a + i for a in np.flatnonzero(~structure.pinned) for i in range(3)]
    members = [(ends, 1) for ends in structure.tendons] + [(ends, -1) for ends in structure.rods]
    members = [(ends, sign) for ends, sign in members if not structure.pinned[ends].all()]
    A = mp.zeros(3 * len(structure.nodes), len(members))
    for m, ((a, b), sign) in enumerate(members):
        d = [mp.mpf(float(structure.nodes[b, i])) - mp.mpf(float(structure.nodes[a, i])) for i in range(3)]
        length = mp.sqrt(sum(x * x for x in d))
        for i in range(3):
            A[3 * int(a) + i, m] = sign * d[i] / length
            A[3 * int(b) + i, m] = -sign * d[i] / length
    return mp.matrix([[A[row, m] for m in range(len(members))] for row in free])


def exact_smallest(structure, digits: int = DIGITS):
    """Smallest and largest singular value in many digits."""
    with mp.workdps(digits):
        A = exact_matrix(structure)
        values = mp.svd_r(A if A.rows >= A.cols else A.T, compute_uv=False)
        sizes = sorted((abs(values[i]) for i in range(len(values))), reverse=True)
        return sizes[-1], sizes[0]


def timed(call, argument, repeats: int = 20):
    """The answer, and the shortest of several run times in microseconds."""
    times, answers = [], []
    for _ in range(repeats):
        start = time.perf_counter()
        answers.append(call(argument))
        times.append(time.perf_counter() - start)
    return answers[-1], 1e6 * min(times)


def verdict(decision, true: float, rounding: float) -> str:
    """All these matrices have full rank in the reference, by however little."""
    if not decision.decided:
        return "undecided"
    if decision.rank == len(decision.values):
        return "right"
    return "to rounding" if true <= rounding else "wrong"


def ranks() -> None:
    print(f"{'case':>11} {'part':>7} {'true value':>11} | " + " | ".join(f"{m:>9} error     verdict" for m in METHODS))
    tally = {name: {"errors": [], "times": [], "verdicts": []} for name in METHODS}
    reference = []
    for case, (build, end) in CASES.items():
        for power in range(2, end, 2):
            structure = build(10.0**-power)
            (true, largest), clock = timed(exact_smallest, structure, repeats=1)
            reference.append(clock)
            row = []
            for name, method in METHODS.items():
                decision, clock = timed(method, structure)
                error = abs(decision.values[-1] - float(true)) / float(true) if true > 0 else np.inf
                answer = verdict(decision, float(true), 18 * EPS * float(largest))
                tally[name]["errors"].append(float(abs(decision.values[-1] - float(true)) / float(largest)))
                tally[name]["times"].append(clock)
                tally[name]["verdicts"].append(answer)
                row.append(f"{error:13.1e} {answer:>12}")
            print(f"{case:>11} {10.0**-power:7.0e} {float(true / largest):11.2e} | " + " | ".join(row))
    print("\n       method   time [us]   largest error / s_1   right  to rounding  undecided  wrong")
    for name, kept in tally.items():
        count = [kept["verdicts"].count(v) for v in ("right", "to rounding", "undecided", "wrong")]
        print(
            f"{name:>13} {np.median(kept['times']):11.0f} {max(kept['errors']):21.1e} "
            f"{count[0]:7d} {count[1]:12d} {count[2]:10d} {count[3]:6d}"
        )
    print(f"{'50 digits':>13} {np.median(reference):11.0f} {0.0:21.1e} {len(reference):7d} {0:12d} {0:10d} {0:6d}")


def exact_lowest(orders, digits: int = DIGITS) -> tuple[float, float]:
    """Smallest eigenvalue of stress plus stiffness on motions that keep rods, and of the stress on the mechanism."""
    with mp.workdps(digits):
        nodes, structure = orders.nodes, orders.structure
        basis = exact_rigid_free(structure)
        T = [mp.mpf(float(t)) for t in orders.tensions]
        c = [mp.mpf(float(t)) for t in orders.rod_forces]
        k = [mp.mpf(float(t)) for t in orders.stiffness]
        H = mp.zeros(3 * len(nodes))
        for ends, sign, forces, stiff in ((structure.tendons, 1, T, k), (structure.rods, -1, c, None)):
            for m, (a, b) in enumerate(ends):
                d = [mp.mpf(float(nodes[b, i])) - mp.mpf(float(nodes[a, i])) for i in range(3)]
                length = mp.sqrt(sum(x * x for x in d))
                for i in range(3):
                    for j in range(3):
                        uu = d[i] * d[j] / length**2
                        block = sign * forces[m] / length * ((1 if i == j else 0) - (uu if stiff else 0))
                        block += stiff[m] * uu if stiff else 0
                        for p, q, s in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                            H[3 * int(p) + i, 3 * int(q) + j] += s * block
        values = mp.eigsy(basis.T * H * basis, eigvals_only=True)
        return float(min(values)), float(max(values))


def exact_rigid_free(structure) -> mp.matrix:
    """Orthonormal motions of a free structure that keep rods and are square to rigid-body motions, in many digits."""
    count = len(structure.nodes)
    rows = []
    for i in range(3):
        rows.append([mp.mpf(int(j % 3 == i)) for j in range(3 * count)])
        axis = np.eye(3)[i]
        rows.append([mp.mpf(float(x)) for x in np.cross(axis, structure.nodes).ravel()])
    for a, b in structure.rods:
        row = [mp.mpf(0)] * (3 * count)
        for i in range(3):
            d = mp.mpf(float(structure.nodes[b, i])) - mp.mpf(float(structure.nodes[a, i]))
            row[3 * int(a) + i], row[3 * int(b) + i] = -d, d
        rows.append(row)
    Q, _ = mp.qr(mp.matrix(rows).T)
    return mp.matrix([[Q[i, j] for j in range(len(rows), 3 * count)] for i in range(3 * count)])


def stabilities() -> None:
    print("\nprism, prestress over k l and stiffest over softest tendon: smallest eigenvalue on all motions, verdicts")
    print(f"{'prestress':>9} {'ratio':>7} {'true [N/m]':>11} {'error':>8} {'all':>10} {'mechanism':>10} {'super':>6}")
    prism = tc.prism(3)
    one = admissible_prestress(prism, tension_min=1.0)
    for level, ratio in [(1.0, 1.0), (1e-3, 1.0), (1e-6, 1.0), (1e-9, 1.0), (1e-12, 1.0)] + [
        (1.0, 10.0**p) for p in (3, 6, 9, 12, 15)
    ]:
        k = np.full(9, 1.0)
        k[0] = ratio
        orders = stability_orders(prism, None, level * one.tensions, level * one.rod_forces, stiffness=k)
        true, _ = exact_lowest(orders)
        error = abs(orders.on_all.smallest - true) / abs(true)
        print(
            f"{level:9.0e} {ratio:7.0e} {true:11.3e} {error:8.1e} {orders.stable:>10} "
            f"{orders.prestress_stable:>10} {orders.super_stable:>6}"
        )


def rhombus(ratio: float) -> tc.Structure:
    """Two crossed rods, one `ratio` times longer: an affine image of a square, so it holds the same force densities."""
    nodes = [[ratio, 0, 0], [0, 1, 0], [-ratio, 0, 0], [0, -1, 0]]
    return tc.network(nodes, [[0, 2], [1, 3]], [[0, 1], [1, 2], [2, 3], [3, 0]])


def pulled_to_its_pin() -> tc.Structure:
    """A rod whose only tendon pulls it towards the pin that it turns about: in balance, and never stable."""
    return tc.network([[0, 0, 0], [1, 0, 0], [-1.5, 0, 0]], [[0, 1]], [[1, 2]], [0, 2])


def extremes() -> None:
    print("\nextreme cases: residual of the prestress, then rank decision and verdicts")
    joined = tc.shell(3, 2, cls=2)
    rows = [(f"one rod {r:.0e} times longer", rhombus(r), {}) for r in (1e3, 1e6, 1e9)]
    rows += [(f"tension floor {f:.0e} of the others", joined, {"t5_*": f}) for f in (1e-6, 1e-12)]
    rows += [("rod pulled to its pin", pulled_to_its_pin(), {})]
    rows += [("prism away from its twist", tc.prism(3, twist=2.5), {})]
    for name, structure, floors in rows:
        try:
            found = admissible_prestress(structure, tension_min={"*": 1.0} | floors)
        except tc.EquilibriumError as error:
            print(f"{name:>32}  {str(error)[:110]}...")
            continue
        orders = stability_orders(structure, None, found.tensions, found.rod_forces, stiffness=100.0, rank_tol=0.0)
        decision = orders.rank
        print(
            f"{name:>32} {found.residual:8.1e}  rank {decision.rank:2d} of {len(decision.values):2d} gap "
            f"{decision.gap:.0e}{'' if decision.decided else ' undecided'}; mechanisms {orders.prestress_stable}, "
            f"all {orders.stable}, super {orders.super_stable}"
        )
    for gap in (1e-3, 1e-6, 1e-9, 1e-12):
        near = tc.shell(3, 2, twist=2 * np.pi / 3, overlap=0.5 + gap)
        closest = np.sort(scipy.spatial.distance.pdist(near.nodes))[0]
        spaces = self_stress(near)
        print(f"class 1 shell, nodes {closest:.0e} m apart: {spaces.states} states, {spaces.decision}")
    for strain in (1e-3, 1e-6, 1e-9, 1e-12):
        potential = Potential.of(tc.Scene(structure=tc.prism(3)))
        held = inverse_statics(potential, tension_min=100.0 * strain, goal="least norm")
        rest = held.equilibrium
        orders = stability_orders(potential.structure, None, held.tensions, held.rod_forces, stiffness=100.0)
        print(
            f"rest_ratio 1 - {strain:.0e}: balance of the program {held.prestress.residual:.1e}, of the tendon law "
            f"{held.residual:.1e}; mechanisms {orders.prestress_stable}, all {orders.stable}, equilibrium {rest.stable}"
        )


if __name__ == "__main__":
    ranks()
    stabilities()
    extremes()
