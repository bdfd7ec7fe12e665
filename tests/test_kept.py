"""A kept value is the one that compiled code was given: same arrays, same numbers, wherever it is opened."""

import copy
import os
import pickle
import subprocess
import sys

import numba
import numpy as np
import pytest

from tensctl.jit import bare
from tensctl.simulation.integrators.kept import Kept, opened


# Plain tuples: numba's cache of the package would name classes of this file, which other programs cannot import.
@bare
def gather(kept, out):
    (values, flag), places, scale, other = opened(kept)
    for k in range(places.size):
        out[k] = scale * values[places[k]] if flag else -1.0
        opened(other)[0][0] += out[k]


def made(flag=True):
    """Values and a flag, places, a scale, and something kept that counts."""
    return Kept(((np.arange(5.0), flag), np.array([4, 0, 2], dtype=np.uint64), 0.5, Kept((np.zeros(1),))))


def run(kept):
    out = np.zeros(3)
    gather(kept, out)
    return out.tolist()


@pytest.mark.parametrize("flag", [True, False])
def test_opens_to_what_was_kept(flag):
    kept = made(flag)
    assert run(kept) == ([2.0, 0.0, 1.0] if flag else [-1.0, -1.0, -1.0])
    assert kept.value[3].value[0][0] == sum(run(kept))


def test_arrays_are_not_copied():
    kept = made()
    kept.value[0][0][:] *= 3.0
    assert run(kept) == [6.0, 0.0, 3.0]


@pytest.mark.parametrize("twin_of", [copy.deepcopy, lambda kept: pickle.loads(pickle.dumps(kept))])
def test_a_copy_has_arrays_of_its_own(twin_of):
    """And an address: that of the original may be gone by the time the copy is opened."""
    kept = made()
    twin = twin_of(kept)
    kept.value[0][0][:] = 100.0
    assert twin.address != kept.address
    assert run(twin) == [2.0, 0.0, 1.0]


def test_values_of_one_form_share_a_type():
    """And those of another do not: layout, dimensions, entries, numbers, and what is kept inside."""
    strided = np.arange(10.0)[::2]
    others = [np.ones((1, 3)), np.ones((3, 2)).T, strided, np.ones(3, np.float32), np.arange(3), 2.0, 3, True, 2**63]
    values = [np.ones(3), *others, (np.ones(3),), Kept((np.ones(3),)), Kept((np.ones(3), 1.0))]
    kinds = [Kept((value,))._numba_type_ for value in values]
    assert all(Kept((value,))._numba_type_ is kind for value, kind in zip(values, kinds, strict=True))
    assert len(set(kinds)) == len(values)
    assert all(kind.inner == numba.typeof((value,)) for value, kind in zip(values, kinds, strict=True))


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


def test_caches_name_no_class_of_the_tests():
    """Every kernel's cache is read whole when the kernel is loaded; a class that cannot be imported would stop it."""
    run(made())
    look = "import numpy as np; from tensctl.simulation.integrators.kept import Kept; Kept((np.ones(3), 2.0)); print(1)"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "1"


def test_is_renewed_in_place():
    """What is kept inside another shows its new value there; one of another form is refused and changes nothing."""
    inner = Kept((np.zeros(1),))
    outer = Kept(((np.arange(5.0), True), np.array([4, 0, 2], dtype=np.uint64), 0.5, inner))
    address, sums = inner.address, np.full(1, 10.0)
    assert inner.renew((sums,))
    assert inner.address == address
    assert run(outer) == [2.0, 0.0, 1.0]
    assert sums[0] == 13.0
    assert not inner.renew((np.zeros((1, 1)),))
    run(outer)
    assert sums[0] == 16.0
