"""Paths of equilibria turn where theory says they fold, and several starts find what one does not."""

import numpy as np
import pytest
from support import network_scene, pendulum_scene, replaced, shell_scene

import tensctl as tc
from tensctl.statics.continuation import follow
from tensctl.statics.starts import find_equilibria, same_rest

K = 100.0


def stayed_rod(**sections):
    """A rod of 1 m on a pin at the origin, tied to two anchors in the plane z = 0."""
    nodes = {"o": [0, 0, 0], "head": [0.6, 0.8, 0], "left": [-1.5, 0, 0], "right": [2.0, -1.0, 0]}
    ties = {"l": ["head", "left"], "r": ["head", "right"]}
    return network_scene(nodes, {"rod": ["o", "head"]}, ties, ["o", "left", "right"], **sections)


def holding_force(angle, rest_lengths):
    """Force in -y on the head of the stayed rod that holds it at an angle from x, by moments about the pin."""
    head, turning = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    moment = 0.0
    for anchor, rest in zip([(-1.5, 0.0), (2.0, -1.0)], rest_lengths, strict=True):
        away = head - np.reshape(anchor, (2, 1))
        length = np.linalg.norm(away, axis=0)
        moment = moment + K * np.maximum(length - rest, 0) * (away * turning).sum(axis=0) / length
    return -moment / np.cos(angle)


class TestFollow:
    def test_load_path_ends_where_newton_ends(self):
        scene = shell_scene(pins=["P1_*_1"], loads={"P4_1_1": [5.0, 0.0, -10.0]})
        path = follow(scene)
        assert path.finished
        assert path.parameter[0] == 0
        assert path.parameter[-1] == 1
        assert max(rest.residual for rest in path.equilibria) < 1e-11
        assert np.abs(path.equilibria[-1].nodes - tc.find_equilibrium(scene).nodes).max() < 1e-9
        assert all(rest.stable for rest in path.equilibria)

    def test_rest_length_path_ends_where_newton_ends(self):
        scene = shell_scene(pins=["P1_*_1"])
        u = np.linspace(0.0, 0.3, 21)
        path = follow(scene, inputs=u)
        straight = tc.find_equilibrium(scene, inputs=u)
        assert path.finished
        assert np.abs(path.equilibria[-1].rest_lengths - straight.rest_lengths).max() < 1e-15
        assert np.abs(path.equilibria[-1].nodes - straight.nodes).max() < 1e-9

    def test_slack_and_taut_are_reported_and_passed(self):
        scene = shell_scene(pins=["P1_*_1"], loads={"P4_1_1": [5.0, 0.0, -10.0]})
        path = follow(scene)
        slack = {label for event in path.events if event.kind == "slack" for label in event.members}
        taut = {label for event in path.events if event.kind == "taut" for label in event.members}
        last = path.equilibria[-1]
        truly = {t for t, T in zip(last.structure.tendon_labels, last.tensions, strict=True) if T == 0}
        assert slack - taut == truly
        assert truly

    def test_a_pulled_rod_follows_its_circle(self):
        """A heavy rod hangs from a pin and is pushed sideways: half of its weight is at the head."""
        scene = pendulum_scene((0, 0, -2), tendons={"rest_ratio": 3.0}, gravity={"g": 10.0})
        push = np.zeros((3, 3))
        push[1, 0] = 20.0
        path = follow(scene, loads=push)
        for at, rest in zip(path.parameter, path.equilibria, strict=True):
            head = rest.nodes[1]
            assert np.arctan2(head[0], -head[2]) == pytest.approx(np.arctan2(20.0 * at, 5.0), rel=1e-9, abs=1e-12)

    def test_folds_are_the_extremes_of_a_known_force(self):
        """In the plane the load is a function of the angle; where it is extreme the path turns, and only there."""
        scene = stayed_rod()
        start = tc.find_equilibrium(scene, start=None)
        push = np.zeros((4, 3))
        push[1, 1] = -300.0
        path = follow(scene, loads=push, start=start)
        assert path.finished
        for at, rest in zip(path.parameter, path.equilibria, strict=True):
            angle = np.arctan2(rest.nodes[1, 1], rest.nodes[1, 0])
            assert 300.0 * at == pytest.approx(holding_force(np.array([angle]), rest.rest_lengths)[0], abs=1e-7)
        force = holding_force(np.linspace(-np.pi, np.pi, 2_000_001), start.rest_lengths)
        turns = force[1:-1][np.diff(np.sign(np.diff(force))) != 0]  # to a slope times 3e-6 rad
        assert len(path.folds) == 2
        for fold in path.folds:
            assert np.abs(turns - 300.0 * fold.at).min() < 1e-4


class TestSquashedMast:
    def path(self):
        return follow(shell_scene(pins=["P1_*_1"], loads={"P4_*_1": [0, 0, -20.0]}), max_points=60)

    def test_fold_is_the_largest_load_on_the_way(self):
        path = self.path()
        assert len(path.folds) >= 1
        fold = path.folds[0]
        before = path.parameter[: fold.index]
        assert (np.diff(before) > 0).all()
        assert path.parameter[fold.index - 1] < fold.at
        assert path.parameter[: fold.index + 1].max() <= fold.at * (1 + 1e-12)
        assert path.negative[fold.index - 1] == 0
        assert path.negative[fold.index] == 1

    def test_hessian_is_singular_at_the_fold(self):
        """Below the fold the smallest eigenvalue falls like the root of the load that is missing."""
        scene = shell_scene(pins=["P1_*_1"], loads={"P4_*_1": [0, 0, -20.0]})
        fold = self.path().folds[0].at
        missing, smallest = np.array([1e-2, 1e-3, 1e-4]), []
        for part in missing:
            near = follow(scene, to=fold * (1 - part)).equilibria[-1]
            smallest.append(near.smallest)
            assert near.residual < 1e-11
        slope = np.polyfit(np.log(missing), np.log(smallest), 1)[0]
        assert slope == pytest.approx(0.5, abs=0.05)

    def test_no_rest_nearby_beyond_the_fold(self):
        """Newton from the last stable rest, with 1 % more load than the fold, ends far away."""
        path = self.path()
        fold = path.folds[0]
        last = path.equilibria[fold.index - 1]
        beyond = shell_scene(pins=["P1_*_1"], loads={"P4_*_1": [0, 0, -20.0 * fold.at * 1.01]})
        rest = tc.find_equilibrium(beyond, start=last.nodes)
        assert np.abs(rest.nodes - last.nodes).max() > 0.3


class TestSeveral:
    def two_sided(self):
        """A rod on a pin between two anchors: it rests towards either side, and is a saddle in the middle."""
        nodes = {"o": [0, 0, 0], "head": [0, 0, 1.0], "l": [-0.6, 0, 1.2], "r": [0.6, 0, 1.2], "b": [0, 1.5, 0.2]}
        ties = {"tl": ["head", "l"], "tr": ["head", "r"], "tb": ["head", "b"]}
        return network_scene(nodes, {"rod": ["o", "head"]}, ties, ["o", "l", "r", "b"], tendons={"rest_ratio": 0.3})

    def test_rests_are_distinct_balanced_and_sorted(self):
        found = find_equilibria(self.two_sided(), starts=12, reach=2.0)
        assert len(found) >= 1
        energies = [rest.energy for rest in found]
        assert energies == sorted(energies)
        assert all(rest.residual < 1e-11 for rest in found)
        assert not any(same_rest(a, b) for k, a in enumerate(found) for b in found.found[:k])
        assert sum(found.hits) + len(found.failures) >= 12

    def test_a_saddle_leads_to_what_lies_beside_it(self):
        """From the exact saddle Newton stays; both its sides are searched and end below it."""
        scene = pendulum_scene(anchor=(-1.5, 0, 0), tendons={"rest_length": 0.3})
        found = find_equilibria(scene, starts=1)
        assert len(found) >= 2
        assert found[0].stable
        assert found[-1].stable is tc.Stability.NO
        assert found[0].energy < found[-1].energy
        head = found[0].nodes[1]
        assert head == pytest.approx([-1.0, 0, 0], abs=1e-7)

    def test_turned_copies_are_one(self, rng):
        """A free shell from starts that are random: one shape, however it has turned."""
        found = find_equilibria(shell_scene(), starts=4, reach=0.1)
        assert len(found) == 1
        assert found.hits == (4,)

    def test_mirrored_shells_are_two(self):
        """A shell and its mirror image have the same lengths, but no rotation carries one onto the other."""
        rest = tc.find_equilibrium(shell_scene())
        assert same_rest(rest, rest)
        assert not same_rest(replaced(rest, nodes=rest.nodes * [1, 1, -1.0]), rest)
