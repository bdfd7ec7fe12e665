"""A kept value is the one that compiled code was given: same arrays, same numbers, wherever it is opened."""

import copy
import os
import pickle
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest

from tensctl.jit import bare
from tensctl.simulation.integrators.kept import Kept, opened


class Inner(NamedTuple):
    values: np.ndarray
    flag: bool


class Outer(NamedTuple):
    inner: Inner
    places: np.ndarray
    scale: float
    other: Kept


@bare
def gather(kept, out):
    outer = opened(kept)
    for k in range(outer.places.size):
        out[k] = outer.scale * outer.inner.values[outer.places[k]] if outer.inner.flag else -1.0
        opened(outer.other)[0][0] += out[k]


def made(flag=True):
    counted = Kept((np.zeros(1),))
    inner = Inner(np.arange(5.0), flag)
    return Kept(Outer(inner, np.array([4, 0, 2], dtype=np.uint64), 0.5, counted))


def run(kept):
    out = np.zeros(3)
    gather(kept, out)
    return out.tolist()


@pytest.mark.parametrize("flag", [True, False])
def test_opens_to_what_was_kept(flag):
    kept = made(flag)
    assert run(kept) == ([2.0, 0.0, 1.0] if flag else [-1.0, -1.0, -1.0])
    assert kept.value.other.value[0][0] == sum(run(kept))


def test_arrays_are_not_copied():
    kept = made()
    kept.value.inner.values[:] *= 3.0
    assert run(kept) == [6.0, 0.0, 3.0]


@pytest.mark.parametrize("twin_of", [copy.deepcopy, lambda kept: pickle.loads(pickle.dumps(kept))])
def test_a_copy_has_arrays_of_its_own(twin_of):
    """And an address: that of the original may be gone by the time the copy is opened."""
    kept = made()
    twin = twin_of(kept)
    kept.value.inner.values[:] = 100.0
    assert twin.address != kept.address
    assert run(twin) == [2.0, 0.0, 1.0]


def test_arrays_live_as_long_as_what_keeps_them():
    kept = made()
    litter = [np.full(5, 7.0) for _ in range(1000)]
    assert run(kept) == [2.0, 0.0, 1.0]
    assert len(litter) == 1000


def test_opens_in_plain_python_for_a_debugger():
    look = (
        f"import sys; sys.path.insert(0, {os.path.dirname(__file__)!r}); import test_kept as t; print(t.run(t.made()))"
    )
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run([sys.executable, "-c", look], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[2.0, 0.0, 1.0]"
