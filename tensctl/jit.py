"""One decorator for compiled kernels, whose cache never stands in the way.

`numba.njit(cache=True)` raises at decoration time where neither the package folder nor the home can be
written (a read-only container, a system-wide installation used by a service). Here it then tries a temporary
folder of the user's own, and last no cache at all: every start compiles anew, nothing else changes.

Numba itself looks for changes in a kernel's own file only, and would go on with machine code that holds an old version
of a kernel that it calls. Every cache is therefore stamped with all the kernels' sources: a change in one compiles all.
"""

from __future__ import annotations

import functools
import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numba.core.config

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

_ARITHMETIC: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy"}


def jit(function: Kernel) -> Kernel:
    """Compile a kernel when it is first called, and keep the machine code for later starts.

    IEEE arithmetic in the order that is written (no fast-math), save that a product and a sum may be rounded once
    together where the processor can; NumPy's division (x/0 is inf, not an exception). Kernels run outside Python's
    lock: threads may call them at once, each with arrays of its own.
    """
    return _kept(function, counted=True)


def bare(function: Kernel) -> Kernel:
    """`jit` for a kernel that makes no array of its own and works on those that it is given.

    References to arrays are not counted then. Counting costs more than the work of a small kernel: the rates of the 24
    tendons of the (3,1) shell take 0.63 us with it, 0.16 us without.
    """
    return _kept(function, counted=False)


def part(function: Kernel) -> Kernel:
    """Compile a bare kernel that becomes part of each kernel that calls it; call it in few places.

    A call of a kernel that stays on its own copies every array header in its tuples of arrays: 0.6 us for the arrays of
    one right-hand side of the (3,1) shell, which itself takes 0.2 us.
    """
    compile_as: Any = numba.njit
    return cast(Kernel, compile_as(forceinline=True, _nrt=False, **_ARITHMETIC)(function))


def _kept(function: Kernel, *, counted: bool) -> Kernel:
    try:
        return _compiled(function, cache=True, counted=counted)
    except RuntimeError:  # no folder can be written; numba has no narrower class for it
        pass
    try:
        with _cache_in(_own_temporary_folder()):
            return _compiled(function, cache=True, counted=counted)
    except (RuntimeError, OSError):
        return _compiled(function, cache=False, counted=counted)


def _compiled(function: Callable[..., Any], *, cache: bool, counted: bool) -> Any:
    compile_as: Any = numba.njit  # its stubs do not know all of its options
    kernel: Any = compile_as(cache=cache, nogil=True, _nrt=counted, **_ARITHMETIC)(function)
    kept: Any = getattr(kernel, "_cache", None)  # NUMBA_DISABLE_JIT leaves the plain function, which has none
    if cache and kept is not None:
        index = kept._cache_file
        index._source_stamp = (index._source_stamp, sources_stamp())
    return kernel


@functools.cache
def sources_stamp() -> str:
    """Digest of every module of the package that has kernels."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        text = path.read_bytes()
        if b"tensctl.jit import" in text:
            digest.update(text)
    return digest.hexdigest()


@contextmanager
def _cache_in(folder: Path) -> Iterator[None]:
    """Point numba's cache to a folder while a function is decorated; it keeps the place found then."""
    config: Any = numba.core.config
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        config.CACHE_DIR = before


def _own_temporary_folder() -> Path:
    """The user's cache folder among the temporary files, made if need be.

    Cached code is executed when it is loaded, so a folder that someone else owns or can write is refused.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    folder = Path(tempfile.gettempdir()) / f"tensctl-numba-{user}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise OSError(f"{folder} is no folder")
    if hasattr(os, "getuid") and (found.st_uid != os.getuid() or found.st_mode & 0o022):
        raise OSError(f"{folder} belongs to, or can be written by, someone else")
    return folder
