"""The jit helper compiles, and compiles still where no cache can be kept."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core import event

from tensctl.jit import inlined, part

KERNEL = """
from tensctl.jit import jit


@jit
def quotient(x, y):
    return x / y
"""

REPORT = """
import sys
sys.path.insert(0, sys.argv[1])
from kernels import quotient
import numba.core.config
print(quotient(1.0, 4.0), quotient(1.0, 0.0), quotient.stats.cache_path, repr(numba.core.config.CACHE_DIR))
"""


def run(folder: Path, tmp: Path, **environment: str) -> list[str]:
    """Compile and call the kernel in a fresh interpreter whose temporary files are in `tmp`."""
    done = subprocess.run(
        [sys.executable, "-c", REPORT, str(folder)],
        env={**os.environ, "TMPDIR": str(tmp), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.fixture
def kernels(tmp_path):
    folder = tmp_path / "package"
    folder.mkdir()
    (folder / "kernels.py").write_text(KERNEL)
    (tmp_path / "tmp").mkdir()
    return folder


def nowhere(tmp_path: Path) -> dict[str, str]:
    """An environment in which numba finds no place: the only folder it may use would be under a file."""
    (tmp_path / "file").write_text("")
    return {
        "NUMBA_CACHE_DIR": str(tmp_path / "file" / "cache"),
        "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator",
    }


def test_cache_beside_the_kernel_where_it_can_be_written(kernels, tmp_path):
    quarter, infinite, cache, _ = run(kernels, tmp_path / "tmp")
    assert (quarter, infinite) == ("0.25", "inf")
    assert Path(cache).is_relative_to(kernels)
    assert list(kernels.rglob("*.nbi"))


def test_numba_alone_would_raise_there(kernels, tmp_path):
    (kernels / "kernels.py").write_text(KERNEL.replace("@jit", "@__import__('numba').njit(cache=True)"))
    with pytest.raises(AssertionError, match="cannot cache function"):
        run(kernels, tmp_path / "tmp", **nowhere(tmp_path))


def test_temporary_cache_where_nothing_else_can_be_written(kernels, tmp_path):
    environment = nowhere(tmp_path)
    _, _, cache, config = run(kernels, tmp_path / "tmp", **environment)
    assert Path(cache).is_relative_to(tmp_path / "tmp")
    assert list((tmp_path / "tmp").rglob("*.nbi")), "machine code is kept for the next start"
    assert config == repr(environment["NUMBA_CACHE_DIR"]), "numba's own setting is put back"


def test_no_cache_where_even_temporary_files_cannot_be_written(kernels, tmp_path):
    own = tmp_path / "tmp" / f"tensctl-numba-{os.getuid()}"
    own.write_text("a file in the place of the folder")
    quarter, infinite, cache, _ = run(kernels, tmp_path / "tmp", **nowhere(tmp_path))
    assert (quarter, infinite, cache) == ("0.25", "inf", "None")


def test_a_cache_that_others_can_write_is_not_trusted(kernels, tmp_path):
    own = tmp_path / "tmp" / f"tensctl-numba-{os.getuid()}"
    own.mkdir()
    own.chmod(0o777)
    *_, cache, _ = run(kernels, tmp_path / "tmp", **nowhere(tmp_path))
    assert cache == "None"


HITS = """
import sys
import tensctl.jit
if len(sys.argv) > 2:
    tensctl.jit.sources_stamp = lambda: sys.argv[2]
sys.path.insert(0, sys.argv[1])
from kernels import quotient
quotient(1.0, 4.0)
print(sum(quotient.stats.cache_hits.values()))
"""


def test_a_change_of_any_kernel_makes_every_cache_stale(kernels):
    """Numba alone would keep machine code that holds an old version of a kernel in another file."""

    def hits(*stamp):
        command = [sys.executable, "-c", HITS, str(kernels), *stamp]
        return int(subprocess.run(command, capture_output=True, text=True, check=True).stdout)

    assert [hits(), hits(), hits("changed"), hits("changed"), hits()] == [0, 1, 0, 1, 0]


def test_kernels_run_as_plain_python_for_a_debugger(kernels):
    look = "import sys; sys.path.insert(0, sys.argv[1]); from kernels import quotient; print(type(quotient).__name__)"
    done = subprocess.run(
        [sys.executable, "-c", look, str(kernels)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "function"


def compiled(call):
    """Names of what is compiled in a call."""
    with event.install_recorder("numba:compile") as record:
        call()
    return [each.data["dispatcher"].py_func.__name__ for _, each in record.buffer if each.is_start]


def test_a_kernel_is_compiled_for_kernels_once_and_for_python_when_it_calls():
    """In `total` the first argument of `add` is a constant at first and then a number."""

    @part
    def add(x, y):
        return x + y

    @numba.njit
    def total(n):
        x = 0
        for k in range(n):
            x = add(x, k)
        return x

    assert compiled(lambda: total(5)) == ["total", "add"]
    assert total(5) == 10
    assert not add.signatures, "nothing is compiled for Python, which has not called it"
    assert compiled(lambda: add(2, 3)) == ["add"]
    assert add(2, 3) == 5


def test_what_is_written_in_is_compiled_with_its_caller_alone():
    @inlined
    def twice(x):
        return 2 * x

    @numba.njit
    def fourfold(x):
        return twice(twice(x))

    assert compiled(lambda: fourfold(3)) == ["fourfold"]
    assert (fourfold(3), twice(3)) == (12, 6)
