"""One decorator for compiled kernels, whose cache never stands in the way.

`numba.njit(cache=True)` raises at decoration time where neither the package folder nor the home can be
written (a read-only container, a system-wide installation used by a service). Here it then tries a temporary
folder of the user's own, and last no cache at all: every start compiles anew, nothing else changes.

Numba itself looks for changes in a kernel's own file only, and would go on with machine code that holds an old version
of a kernel that it calls. Every cache is therefore stamped with all the kernels' sources: a change in one compiles all.

Numba compiles with every kernel two entries for callers from outside, one of which reads each array of each argument
from Python. A kernel that other kernels call is compiled for them without, as a function of its own, and with them only
if Python calls it as well: a quarter of the time that the kernels of a splitting take to compile.
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
from types import FunctionType
from typing import Any, TypeVar, cast

import numba
import numba.core.config
from numba.core.types import unliteral

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
    return cast(Kernel, _with_inside(function, forceinline=True, _nrt=False))


def inlined(function: Kernel) -> Kernel:
    """Write a bare kernel into each kernel that calls it before they are compiled; for links of a chain of calls.

    All that a kernel calls is optimised and translated anew with it, and so with each link: without the links between
    its march and its step, the kernels of a splitting compile in three quarters of the time.
    """
    compile_as: Any = numba.njit
    return cast(Kernel, compile_as(inline="always", _nrt=False, **_ARITHMETIC)(function))


def _kept(function: Kernel, *, counted: bool) -> Kernel:
    try:
        return _with_inside(function, cache=True, nogil=True, _nrt=counted)
    except RuntimeError:  # no folder can be written; numba has no narrower class for it
        pass
    try:
        with _cache_in(_own_temporary_folder()):
            return _with_inside(function, cache=True, nogil=True, _nrt=counted)
    except (RuntimeError, OSError):
        return _with_inside(function, cache=False, nogil=True, _nrt=counted)


def _with_inside(function: Callable[..., Any], **options: Any) -> Any:
    """A kernel for Python, which hands kernels that call it on to one without entries from outside."""
    kernel = _dispatcher(function, **options)
    if kernel is function:  # NUMBA_DISABLE_JIT leaves the plain function
        return function
    same: Any = function
    inside = FunctionType(same.__code__, same.__globals__, same.__name__, same.__defaults__, same.__closure__)
    inside.__qualname__ = f"{same.__qualname__}_inside"  # the cache tells kernels apart by it
    inside.__module__ = same.__module__
    called = _dispatcher(inside, no_cpython_wrapper=True, no_cfunc_wrapper=True, **options)

    def template(types, keywords):
        # Without this a kernel compiles twice where an argument begins as a constant and changes in a loop.
        return called.get_call_template([unliteral(each) for each in types], keywords)

    kernel.get_call_template, kernel.get_overload = template, called.get_overload
    return kernel


def _dispatcher(function: Callable[..., Any], **options: Any) -> Any:
    compile_as: Any = numba.njit  # its stubs do not know all of its options
    kernel: Any = compile_as(**options, **_ARITHMETIC)(function)
    if options.get("cache") and kernel is not function:
        index = kernel._cache._cache_file
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
