"""Weights of a harmonic LQR, one Hermitian block a harmonic: checked, or made from allowed sizes as by `weights`.

cost rate  sum_k x_k* Q_k x_k + 2 Re x_k* N_k u_k + u_k* R_k u_k  over all n harmonics
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from tensctl.analysis.scaling import input_stiffness
from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel
from tensctl.linear.harmonic_block import Harmonic, Shown
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Number
from tensctl.synthesis.weights import Cost, Size, allowed_sizes

Blocks = Sequence[np.ndarray]
Costs = Sequence[Cost]

# Values of a member and of its image that differ by less than this part are equal.
_EQUAL = 1e-9

# A weight that is skew or negative by less than this part of itself is so by rounding (as in `lqr`).
_SKEW = 1e-12


def harmonic_weights(
    linear: HarmonicModel,
    *,
    energy: float | None = None,
    nodes: Size | None = None,
    tensions: Size | None = None,
    rest_lengths: Size | None = None,
) -> tuple[Cost, ...]:
    """Weights from allowed sizes, those of `weights` harmonic by harmonic.

    Parameters
    ----------
    linear : HarmonicModel
    energy, nodes, tensions, rest_lengths : J, m, N, m
        As `weights` takes them; tables by label pattern give images the same size.

    Raises
    ------
    SynthesisError
        A size that is no positive number or breaks the symmetry, or an input that costs nothing.
    """
    check_kind(HarmonicModel, linear=linear)
    structure, symmetry = linear.dynamics.structure, linear.map.point.sector.symmetry
    shown: dict[Shown, np.ndarray] = {}
    if nodes is not None:
        sizes = allowed_sizes("nodes", structure.node_labels, nodes)[symmetry.nodes]
        shown["nodes"] = np.repeat(of_sector(sizes, "allowed sizes of nodes", "tc.weights"), 3)
    if tensions is not None:
        sizes = allowed_sizes("tensions", structure.tendon_labels, tensions)
        shown["tensions"] = of_sector(sizes[symmetry.tendons], "allowed sizes of tensions", "tc.weights")
    own = _of_inputs(linear, energy, rest_lengths)
    return tuple(
        _cost(b, energy, shown, own[linear.map.first(b.k)], sized=rest_lengths is not None) for b in linear.blocks
    )


def _of_inputs(linear: HarmonicModel, energy: float | None, sizes: Size | None) -> Float[np.ndarray, " nu"]:
    """Weight of each input alone."""
    if sizes is None:
        return np.zeros(linear.nu) if energy is None else 0.5 * input_stiffness(linear) / energy
    given = 1 / allowed_sizes("rest_lengths", linear.dynamics.input_labels, sizes) ** 2
    if not linear.map.alike(given):
        raise _unequal("allowed sizes of rest_lengths", "tc.weights")
    return given


def _cost(
    block: Harmonic, energy: float | None, shown: dict[Shown, np.ndarray], own: np.ndarray, *, sized: bool
) -> Cost:  # fmt: skip
    nx, p = block.nx, own.size
    total = np.zeros((nx + p, nx + p), block.shapes.dtype)
    if energy is not None:
        total[:nx, :nx] += 0.5 * np.eye(nx) / argument("energy", energy, Number("J", above=0))
    for kind, sizes in shown.items():
        rows = np.hstack([block.C(kind), block.D(kind)]) / (sizes[block.free] if kind == "nodes" else sizes)[:, None]
        total += rows.conj().T @ rows
    total[nx:, nx:] += np.diag(own)
    if p and not sized and np.linalg.eigvalsh(total[nx:, nx:]).min() <= 0:
        raise SynthesisError("some rest length costs nothing; give rest_lengths, the change that is allowed, in m.")
    return Cost(total[:nx, :nx], total[nx:, nx:], total[:nx, nx:])


def checked_costs(
    linear: HarmonicModel, Q: Blocks | None, R: np.ndarray | Blocks | None, costs: Costs | None
) -> tuple[Cost, ...]:
    """The costs asked for, energies where nothing is said.

    Raises
    ------
    SynthesisError
        Weights that do not fit, or are given twice.
    """
    if costs is None:
        pairs = zip(linear.blocks, state_weights(linear, Q), input_weights(linear, R), strict=True)
        return tuple(Cost(one, other, np.zeros(block.B.shape)) for block, one, other in pairs)
    if Q is not None or R is not None:
        raise SynthesisError("weights are given twice, as cost and as Q or R; give one of them.")
    state_weights(linear, [cost.Q for cost in costs])
    input_weights(linear, [cost.R for cost in costs])
    sizes = [block.nx + block.B.shape[1] for block in linear.blocks]
    _checked("[Q N; N* R]", [cost.matrix for cost in costs], sizes, positive=False)
    return tuple(costs)


def of_sector(values: Float[np.ndarray, "n k"], what: str, dense: str) -> Float[np.ndarray, " k"]:
    """Values of one sector.

    Raises
    ------
    SynthesisError
        When those of its images differ; the sentence names what takes such values.
    """
    first, others = values[0], values[1:]
    if not np.isclose(others, first, rtol=_EQUAL, atol=0.0).all():
        raise _unequal(what, dense)
    return first


def _unequal(what: str, dense: str) -> SynthesisError:
    return SynthesisError(
        f"the {what} are not the same in all sectors; give images the same, or use {dense} on the dense model of "
        "tc.linearize."
    )


def state_weights(linear: HarmonicModel, Q: Blocks | None) -> tuple[np.ndarray, ...]:
    """Q_k; identity by default.

    Raises
    ------
    SynthesisError
        For blocks of the wrong number or shape, or a negative weight.
    """
    sizes = [block.nx for block in linear.blocks]
    if Q is None:
        return tuple(np.eye(size) for size in sizes)
    return _checked("Q", Q, sizes, positive=False)


def input_weights(linear: HarmonicModel, R: np.ndarray | Blocks | None) -> tuple[np.ndarray, ...]:
    """R_k; the stiffness of each tendon by default, and the same for every harmonic when one array is given.

    Raises
    ------
    SynthesisError
        For blocks of the wrong number or shape, or a weight that is not positive.
    """
    count, first = len(linear.blocks), [linear.map.first(k) for k in range(len(linear.blocks))]
    if R is None:
        stiffness = input_stiffness(linear)
        R = [np.diag(stiffness[own]) for own in first]
    same = isinstance(R, np.ndarray) and R.ndim == 2
    blocks = [np.asarray(R)] * count if same else [np.asarray(block) for block in R]
    return _checked("R", blocks, [own.size for own in first], positive=True)


def _checked(name: str, blocks: Blocks, sizes: list[int], *, positive: bool) -> tuple[np.ndarray, ...]:
    if len(blocks) != len(sizes):
        raise SynthesisError(
            f"{name} has {len(blocks)} blocks; {len(sizes)} are expected, one for each harmonic 0 ... n/2."
        )
    for k, (block, size) in enumerate(zip(blocks, sizes, strict=True)):
        if np.shape(block) != (size, size):
            raise SynthesisError(f"{name} of harmonic {k} has shape {np.shape(block)}; ({size}, {size}) is expected.")
        scale = np.abs(block).max(initial=0.0)
        if not np.isfinite(scale):
            raise SynthesisError(f"{name} of harmonic {k} has entries that are no finite numbers.")
        if np.abs(block - block.conj().T).max(initial=0.0) > _SKEW * scale:
            raise SynthesisError(f"{name} of harmonic {k} is not Hermitian; give ({name} + {name}*)/2.")
        smallest = np.linalg.eigvalsh(block).min(initial=np.inf)
        if (positive and smallest <= 0) or smallest < -_SKEW * scale * size:
            wanted = "every input needs a positive cost" if positive else "weights are never negative"
            raise SynthesisError(f"{name} of harmonic {k} has the eigenvalue {smallest:.3g}; {wanted}.")
    return tuple(np.asarray(block) for block in blocks)
