"""Repeated frequencies: one stated gap rule, and groups that part smoothly when a symmetry is broken."""

import numpy as np
import pytest
from support import shell_scene, solved

import tensctl as tc
from tensctl.linear.modes import group_modes

BROKEN = np.array([1e-14, 1e-13, 1e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])


def broken(delta):
    """The pinned mast, three-fold symmetric but for one tendon stiffer by delta."""
    scene = shell_scene(pins=["P1_*_1"], tendons={"stiffness": {"*": 100.0, "t6_1_1": 100.0 * (1 + delta)}})
    return solved(scene)[1:]


@pytest.fixture(scope="module")
def whole():
    return broken(0.0)


@pytest.fixture(scope="module")
def opened():
    return [broken(delta) for delta in BROKEN]


def pairs(linear):
    """Positions of the pairs of a symmetric mast."""
    return [k for k in range(len(linear.modes) - 1) if linear.modes[k].cluster == linear.modes[k + 1].cluster]


def test_the_symmetric_mast_has_seven_pairs(whole):
    assert len(pairs(whole[1])) == 7
    assert sorted(mode.multiplicity for mode in whole[1].modes) == [1] * 7 + [2] * 14


def test_gaps_open_in_proportion(whole, opened):
    """A broken symmetry splits omega^2 of each pair in proportion to delta, as soon as that is above rounding."""
    for k in pairs(whole[1]):
        gaps = np.array([linear.modes[k + 1].omega2 - linear.modes[k].omega2 for _, linear in opened])
        seen = (BROKEN >= 1e-8) & (BROKEN <= 1e-4)
        assert np.polyfit(np.log(BROKEN[seen]), np.log(gaps[seen]), 1)[0] == pytest.approx(1, abs=0.01)


def test_groups_part_once(opened):
    """More symmetry breaking never joins groups again: all pairs below rounding, none above the gap."""
    counts = [len({mode.cluster for mode in linear.modes}) for _, linear in opened]
    assert counts == sorted(counts)
    assert counts[0] == counts[2] == 14
    assert counts[-1] == counts[-4] == 21


@pytest.mark.parametrize("repeated", [0.0, 1e-12, 1e-6, 1e-3, 1e-1])
def test_the_gap_is_the_users(opened, repeated):
    """Neighbours are one exactly where the rule says so."""
    for rest, linear in opened:
        modes = tc.linearize(linear.dynamics, rest, repeated=repeated).modes
        omega2 = np.array([mode.omega2 for mode in modes])
        together = np.diff(omega2) <= repeated * omega2[1:] + rest.tolerance
        assert (np.diff([mode.cluster for mode in modes]) == 0).tolist() == together.tolist()


def test_what_a_group_does_changes_smoothly(whole, opened):
    """The space that a pair spans, and how strongly it is driven, move by delta, though single shapes turn at will."""
    rest, linear = whole
    mass = rest.potential.manifold.mass(linear.dynamics.members.mass)
    order = linear.order
    first = np.empty_like(linear.B)
    first[order] = linear.B
    half = len(linear.modes)
    for delta, (_, other) in zip(BROKEN, opened, strict=True):
        drive = np.empty_like(other.B)
        drive[other.order] = other.B
        for k in pairs(linear):
            a, b = linear.shapes[:, k : k + 2], other.shapes[:, k : k + 2]
            angles = np.linalg.svd(a.T @ (mass[:, None] * b), compute_uv=False)
            assert 1 - angles.min() < 1e3 * delta**2 + 1e-12
            gains = [np.linalg.svd(rows[half + k : half + k + 2], compute_uv=False) for rows in (first, drive)]
            assert np.abs(gains[0] - gains[1]).max() < (20 * delta + 1e-11) * gains[0].max()


def test_every_verdict_stays(opened):
    """Whether modes count as one or two, the mast is driven in all of them."""
    for _, linear in opened:
        assert len(tc.controllability(linear).controllable_modes) == 21


def test_negative_gap_is_refused(whole):
    rest, linear = whole
    with pytest.raises(tc.LinearizationError, match="repeated is -1"):
        tc.linearize(linear.dynamics, rest, repeated=-1.0)


def test_rigid_body_motions_are_one_group():
    rest = tc.find_equilibrium(shell_scene())
    assert (group_modes(rest.spectrum)[:7] == [0, 0, 0, 0, 0, 0, 1]).all()
