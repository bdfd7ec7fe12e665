"""Chosen, mixed and moving outputs, and loads as inputs."""

import inspect

import numpy as np
import pytest
from support import replaced, shell_scene, solved

import tensctl as tc


@pytest.fixture(scope="module")
def damped():
    """The damped mast with its base pinned, all outputs."""
    return solved(
        shell_scene(pins=["P1_*_1"], tendons={"damping": 1.5}), ("nodes", "velocities", "lengths", "tensions")
    )


def rows(linear, labels):
    return [linear.outputs.index(label) for label in labels]


class TestChoice:
    @pytest.mark.parametrize(
        ("asked", "labels"),
        [
            ("nodes:P4_1_1", ["P4_1_1_x", "P4_1_1_y", "P4_1_1_z"]),
            ("nodes:P4_*_z", ["P4_1_1_z", "P4_2_1_z", "P4_3_1_z"]),
            ("velocities:P4_1_1_y", ["v_P4_1_1_y"]),
            ("tensions:t5_*", ["T_t5_1_1", "T_t5_2_1", "T_t5_3_1"]),
            ("lengths:t6_2_1", ["l_t6_2_1"]),
        ],
    )
    def test_by_pattern(self, damped, asked, labels):
        full, some = damped[2], damped[2].showing((asked,))
        assert list(some.outputs) == labels
        assert (full.C[rows(full, labels)] == some.C).all()
        assert (full.D[rows(full, labels)] == some.D).all()

    def test_in_the_order_asked(self, damped):
        some = damped[2].showing(("tensions:t6_1_1", "nodes:P4_1_1", "tensions:t5_1_1"))
        assert some.outputs == ("T_t6_1_1", "P4_1_1_x", "P4_1_1_y", "P4_1_1_z", "T_t5_1_1")

    def test_velocities_are_the_rates_of_positions(self, damped):
        """Of y_p = C x follows y_v = C A x + C B u: C B = 0 and both matrices agree."""
        at, moving = damped[2].showing(("nodes",)), damped[2].showing(("velocities",))
        assert np.abs(at.C @ at.A - moving.C).max() < 1e-12 * np.abs(moving.C).max()
        assert not moving.D.any()

    @pytest.mark.parametrize(
        ("asked", "words"),
        [
            (("tensions:x*",), "nearest label"),
            (("angles:P4_*",), 'output "angles" is unknown'),
            (("nodes", "nodes:P4_1_1"), "output P4_1_1_x is asked for twice"),
            ((tc.Mix({"lean": {"P9_1_1_x": 1.0}}),), "the mix lean asks for P9_1_1_x"),
            ((tc.Mix({"lean": {"P4_1_1_x": np.nan}}),), "lean gives P4_1_1_x the weight nan; a finite number"),
            ((tc.Mix({"T_t5_1_1": {"P4_1_1_x": 1.0}}), "tensions"), "T_t5_1_1 is asked for twice"),
        ],
    )
    def test_refusals(self, damped, asked, words):
        with pytest.raises(tc.LinearizationError, match=words):
            inspect.unwrap(tc.linearize)(damped[0], damped[1], outputs=asked)

    def test_one_alone_needs_no_sequence(self, damped):
        dynamics, rest, full = damped
        for one in ("lengths", tc.Mix({"lean": {"P4_1_1_x": 0.5}})):
            alone, listed = tc.linearize(dynamics, rest, outputs=one), tc.linearize(dynamics, rest, outputs=[one])
            assert alone.outputs == listed.outputs
            assert (alone.C == listed.C).all()
            assert full.showing(one).outputs == listed.outputs


class TestMix:
    def test_is_the_weighted_sum(self, damped, rng):
        full = damped[2]
        labels = ["P4_1_1_x", "v_P4_2_1_z", "l_t5_1_1", "T_t5_1_1", "T_t6_2_1"]
        weights = rng.standard_normal((2, 5))
        mix = tc.Mix({f"m{k}": dict(zip(labels, row.tolist(), strict=True)) for k, row in enumerate(weights)})
        mixed = full.showing(("nodes:P4_1_1_x", mix))
        assert mixed.outputs == ("P4_1_1_x", "m0", "m1")
        for name in ("C", "D"):
            wanted = weights @ getattr(full, name)[rows(full, labels)]
            assert np.abs(getattr(mixed, name)[1:] - wanted).max() < 1e-12 * np.abs(wanted).max()

    def test_mean_of_the_ring_is_blind_to_what_moves_it_to_and_fro(self, damped):
        """The mean height of three equal nodes sees none of the repeated modes of a symmetric mast."""
        height = damped[2].showing((tc.Mix({"height": {f"P4_{i}_1_z": 1 / 3 for i in (1, 2, 3)}}),))
        twice = [name for m in height.modes if m.multiplicity == 2 for name in (f"q{m.index + 1}", f"v{m.index + 1}")]
        seen = np.abs(height.C[0])
        assert len(twice) > 10
        assert seen[[height.states.index(name) for name in twice]].max() < 1e-10 * seen.max()

    def test_in_a_scene(self, tmp_path):
        asked = {"outputs": ["nodes:P4_*_z"], "mix": {"lean": {"P4_1_1_x": 0.5, "P4_2_1_x": 0.5}}}
        found = tc.run(shell_scene(linearize=asked), tmp_path / "out")
        assert found.linear.outputs == ("P4_1_1_z", "P4_2_1_z", "P4_3_1_z", "lean")


class TestLoads:
    def test_chosen_nodes(self, damped):
        """Columns of E by label; a load does the work w . dp, so E is the position outputs' transpose."""
        dynamics, rest, full = damped
        linear = tc.linearize(dynamics, rest, outputs=("nodes:P4_*",), loads=["P4_*"])
        assert linear.disturbances == tuple(f"w_{label}" for label in linear.outputs)
        half = len(linear.modes)
        assert np.abs(linear.E[half:] - (linear.C[:, :half] * linear.scales).T).max() < 1e-14
        assert not full.E.size

    def test_as_inputs_of_the_state_space(self, damped):
        linear = tc.linearize(damped[0], damped[1], loads=["P4_1_1"])
        system = linear.to_statespace(disturbances=True)
        assert system.input_labels[-3:] == ["w_P4_1_1_x", "w_P4_1_1_y", "w_P4_1_1_z"]
        assert (np.hstack([linear.B, linear.E]) == system.B).all()
        assert not system.D[:, -3:].any()

    def test_unknown_node(self, damped):
        with pytest.raises(tc.StructureError, match='loads: "P9_\\*" names nothing'):
            tc.linearize(damped[0], damped[1], loads=["P9_*"])


def test_showing_changes_outputs_only(damped):
    linear = damped[2].showing(("lengths",))
    assert linear.A is not damped[2].A
    assert (linear.A == damped[2].A).all()
    assert (replaced(linear).B == damped[2].B).all()
