"""Scenes and their results that many tests look at, built once a worker."""

# ruff: noqa: E402
import json
import os

# A BLAS with threads of its own fights with the test workers, and is slower on small matrices anyway.
for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import hypothesis
import numpy as np
import pytest
from jaxtyping import config, install_import_hook

# Shapes and types in signatures hold in these rooms, or calls raise. Rooms with kernels or protocols are left out.
_ROOMS = ("structure", "linear", "analysis")
install_import_hook([f"tensctl.{room}" for room in _ROOMS], "typecheck.checked")

from support import REFERENCE, shell_scene, solved
from typecheck import check_first_stretches

from tensctl.simulation.moving import Moving

check_first_stretches(Moving)

hypothesis.settings.register_profile("tensctl", deadline=None, derandomize=True, print_blob=True)
hypothesis.settings.load_profile("tensctl")


def pytest_runtest_setup():
    """Shapes are checked, also after a run that was expected to fail on its way."""
    config.update("jaxtyping_disable", False)


@pytest.fixture
def rng():
    return np.random.default_rng(20010731)


@pytest.fixture(scope="session", params=["3_1", "4_2"])
def reference(request):
    """An independent code's shell: topology, equilibrium and trajectory."""
    return json.loads((REFERENCE / f"ref_shell_{request.param}.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def reference_scene(reference):
    return shell_scene(reference["n"], reference["m"])


@pytest.fixture(scope="session")
def free():
    """The free (3,1) shell: dynamics, equilibrium and linear model."""
    return solved(shell_scene())


@pytest.fixture(scope="session")
def mast():
    """The (3,1) shell on its pinned base: dynamics, equilibrium and linear model."""
    return solved(shell_scene(pins=["P1_*_1"]))
