"""Arguments that compiled code reads from Python once, and from memory ever after.

    kept = Kept(value)          # value: arrays, numbers and tuples of them
    kernel(kept): opened(kept)  # the value, inside compiled code

An empty kernel that is given the arrays of a splitting takes 7.6 us, as long as two or three steps of the (3,1) shell;
with a `Kept` it takes less than 2 us. Its arrays are those that it was given, not copies: what is written into them on
either side is seen on the other. What changes often is best kept on its own within what does not, and renewed.

Classes of tuples must be the package's own: numba's cache names them, and cannot be read where they cannot be imported.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numba
import numba.core.config
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.registry import cpu_target
from numba.extending import NativeValue, intrinsic, models, register_model, unbox

from tensctl.jit import bare

_PLAIN: bool = cast(Any, numba.core.config).DISABLE_JIT


class Kept:
    """A value as compiled code has it, at an address that stays the same."""

    __slots__ = ("_numba_type_", "_room", "address", "value")

    def __init__(self, value: Any) -> None:
        self.value = value  # its arrays live as long as their addresses are used
        if _PLAIN:
            return
        self._numba_type_, size = _kind_of(value)
        self._room = np.zeros(size, np.uint8)
        self.address = self._room.ctypes.data
        _write(self, value)

    def renew(self, value: Any) -> bool:
        """Keep another value at the same address, if its form is the same; whether it is."""
        if value is self.value:
            return True
        if not _PLAIN:
            if _kind_of(value)[0] != self._numba_type_:
                return False
            _write(self, value)
        self.value = value
        return True

    def __reduce__(self) -> tuple:
        return Kept, (self.value,)  # a copy has its own address, and copies of the arrays


class KeptType(types.Type):
    """Numba's type of a `Kept`, by that of its value."""

    def __init__(self, inner: types.Type) -> None:
        self.inner = inner
        super().__init__(name=f"Kept({inner})")


register_model(KeptType)(models.OpaqueModel)

_KINDS: dict[Any, tuple[KeptType, int]] = {}


def _kind_of(value: Any) -> tuple[KeptType, int]:
    """Type and size, bytes: asked of numba once for all values of one form, which takes it 0.5 ms for a splitting's."""
    form = _form(value)
    if form not in _KINDS:
        context: Any = cpu_target.target_context
        kind = KeptType(numba.typeof(value))
        _KINDS[form] = kind, context.get_abi_sizeof(context.get_value_type(kind.inner))
    return _KINDS[form]


def _form(value: Any) -> Any:
    """What numba's type of a value depends on."""
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.num
    if isinstance(value, tuple):
        return type(value), tuple(map(_form, value))
    if isinstance(value, Kept):
        return value._numba_type_
    return type(value), type(value) is int and value.bit_length() > 63


@unbox(KeptType)
def _unbox(_: KeptType, value: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


def _place(context: Any, builder: Any, kept: Any, kind: KeptType) -> Any:
    return builder.bitcast(kept, ir.PointerType(context.get_value_type(kind.inner)))


@intrinsic
def _opened(_: Any, kept: Any) -> Any:
    def load(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, arguments[0], signature.args[0]))

    return kept.inner(kept), load


@intrinsic
def _store(_: Any, kept: Any, value: Any) -> Any:
    def store(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[1], _place(context, builder, arguments[0], signature.args[0]))
        return context.get_dummy_value()

    return types.void(kept, value), store


_stored: Callable[[Any, Any], None] = cast(Any, _store)


@bare
def _write(kept, value):
    _stored(kept, value)


def _value_of(kept: Kept) -> Any:
    return kept.value


opened: Callable[[Kept], Any] = _value_of if _PLAIN else cast(Any, _opened)
"""The value that is kept, inside compiled code; in plain Python where compilation is switched off for a debugger."""
