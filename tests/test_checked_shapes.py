"""Shapes are checked wherever tests look, but in the later stretches of a run."""

import numpy as np
import pytest
from jaxtyping import TypeCheckError
from typecheck import FIRST

import tensctl as tc


def checks(structure):
    """Whether lengths refuse nodes in a plane."""
    try:
        structure.lengths_at(np.zeros((4, 2)))
    except TypeCheckError:
        return True
    except (IndexError, ValueError):
        return False
    return False


class Probing:
    """At every sample, whether shapes are checked."""

    dt = 0.02

    def __init__(self, structure, fails=np.inf):
        self.structure, self.fails, self.found = structure, fails, []

    def step(self, t, measurement):
        """Where rest lengths are."""
        self.found.append(checks(self.structure))
        if len(self.found) > self.fails:
            raise ValueError("meant to fail")
        return measurement.inputs

    def reset(self):
        """Begin anew."""
        self.found = []


def test_first_stretches_of_each_run_are_checked(free):
    dynamics, rest, _ = free
    controller = Probing(dynamics.structure)
    for _ in range(2):
        tc.simulate(dynamics, rest, controller=controller, t_end=1.2, dt=0.02)
        assert controller.found[:FIRST] == [True] * FIRST
        assert not any(controller.found[FIRST + 1 :])
        assert checks(dynamics.structure)


def test_a_run_that_fails_leaves_the_rest_of_its_test_unchecked(free):
    dynamics, rest, _ = free
    assert checks(dynamics.structure)
    with pytest.raises(ValueError, match="meant to fail"):
        tc.simulate(dynamics, rest, controller=Probing(dynamics.structure, FIRST + 5), t_end=1.2, dt=0.02)
    assert not checks(dynamics.structure)


def test_and_no_other_test(free):
    assert checks(free[0].structure)
