"""The shell class at rest: primal shells, one-stage shells, and how few tendons are enough."""

from dataclasses import replace

import pytest

import tensctl as tc


def at_rest(structure, rest_ratio=0.8):
    return tc.find_equilibrium(tc.Scene(structure=structure, tendons={"stiffness": 100.0, "rest_ratio": rest_ratio}))


@pytest.mark.parametrize(("n", "m"), [(3, 2), (4, 2), (6, 3), (8, 4)])
def test_primal_shells_are_stable_and_taut(n, m):
    rest = at_rest(tc.shell(n, m, primal=True))
    assert len(rest.tensions) == 8 * n * m
    assert rest.stable
    assert rest.tensions.min() > 0
    assert rest.residual < 1e-12


@pytest.mark.parametrize("n", [4, 5, 6, 8, 12])
def test_one_stage_shells(n):
    rest = at_rest(tc.shell(n, 1))
    assert len(rest.tensions) == 8 * n
    assert rest.stable
    assert rest.residual < 1e-12
    assert len(rest.spectrum.rigid.names) == 6


def test_fewer_tendons_than_the_primal_shell_are_enough():
    """[S] calls 8nm the least; the (3,1) shell stands, taut, on 15 of its 24."""
    shell = tc.shell(3, 1, primal=True)
    kept = [t for t, label in enumerate(shell.tendon_labels) if label.split("_")[0] not in ("t2", "t7", "t8")]
    labels = tuple(shell.tendon_labels[t] for t in kept)
    rest = at_rest(replace(shell, tendons=shell.tendons[kept], tendon_labels=labels))
    assert len(rest.tensions) == 15
    assert rest.stable
    assert rest.tensions.min() > 0.1
    assert rest.smallest > 0.5


def test_a_shell_in_pieces_is_refused():
    """With t1 and t2 alone, every second rod is joined to nothing."""
    shell = tc.shell(3, 1)
    kept = [t for t, label in enumerate(shell.tendon_labels) if label.split("_")[0] in ("t1", "t2")]
    labels = tuple(shell.tendon_labels[t] for t in kept)
    with pytest.raises(tc.EquilibriumError, match="falls into 4 parts that nothing joins: one is P3_3_1, P4_3_1"):
        at_rest(replace(shell, tendons=shell.tendons[kept], tendon_labels=labels))
