"""Changes of a file that happen whole or not at all, wherever a kill strikes.

Pages that change are gathered in memory, then written to a journal beside the file with a checksum at its end; only
then is the file itself changed. A whole journal found later is carried out once more, which does no harm; a torn one is
thrown away, since the file was not touched yet.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Bytes that change together; that of most file systems.
_PAGE = 4096
_NUMBER = struct.Struct("<q")
_SUM = struct.Struct("<I")


class Staged(io.RawIOBase):
    """A file whose changes stay in memory until they are committed."""

    def __init__(self, path: Path) -> None:
        self._path, self._file = path, path.open("rb")
        self._pages: dict[int, bytearray] = {}
        self._size, self._at = path.stat().st_size, 0

    def readable(self) -> bool:
        """It is."""
        return True

    def writable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET, /) -> int:
        """Go to a place."""
        self._at = offset + (0, self._at, self._size)[whence]
        return self._at

    def tell(self) -> int:
        """Where it is."""
        return self._at

    def truncate(self, size: int | None = None, /) -> int:
        """Set the size, here by default."""
        self._size = self._at if size is None else size
        return self._size

    def readinto(self, buffer, /) -> int:
        """Fill a buffer with what the file will hold."""
        view = memoryview(buffer).cast("B")
        count = max(0, min(len(view), self._size - self._at))
        for place, page, inside in self._pieces(count):
            view[place] = (self._pages.get(page) or self._read(page))[inside]
        return count

    def write(self, data, /) -> int:
        """Change bytes in memory."""
        view = memoryview(data).cast("B")
        for place, page, inside in self._pieces(len(view)):
            if page not in self._pages:
                self._pages[page] = self._read(page)
            self._pages[page][inside] = view[place]
        self._size = max(self._size, self._at)
        return len(view)

    def close(self) -> None:
        """Forget what was not committed."""
        self._file.close()
        super().close()

    def commit(self) -> None:
        """Carry the changes out, by way of the journal."""
        pages = (part for page, held in sorted(self._pages.items()) for part in (_NUMBER.pack(page), held))
        changes = b"".join([_NUMBER.pack(self._size), *pages])
        with _journal(self._path).open("wb") as journal:
            journal.write(changes + _SUM.pack(zlib.crc32(changes)))
            _settle(journal)
        _carry_out(self._path, changes)

    def _read(self, page: int) -> bytearray:
        self._file.seek(page * _PAGE)
        return bytearray(self._file.read(_PAGE).ljust(_PAGE, b"\0"))

    def _pieces(self, count: int) -> Iterator[tuple[slice, int, slice]]:
        """Go on by `count` bytes: pieces of a buffer, the pages they belong to, and where in them."""
        done = 0
        while done < count:
            page, inside = divmod(self._at, _PAGE)
            size = min(count - done, _PAGE - inside)
            self._at += size
            yield slice(done, done + size), page, slice(inside, inside + size)
            done += size


@contextmanager
def staged(path: Path) -> Iterator[Staged]:
    """The file with changes that are carried out at the end of the block, or not at all when it raises."""
    mend(path)
    with Staged(path) as file:
        yield file
        file.commit()


def mend(path: Path) -> None:
    """Finish a change that a kill cut short, or throw away what there is of it."""
    journal = _journal(path)
    if not journal.exists():
        return
    if not path.exists():
        journal.unlink()
        return
    content = journal.read_bytes()
    changes, checksum = content[: -_SUM.size], content[-_SUM.size :]
    if changes and checksum == _SUM.pack(zlib.crc32(changes)):
        _carry_out(path, changes)
    else:
        journal.unlink()


def _carry_out(path: Path, changes: bytes) -> None:
    with path.open("r+b") as file:
        for at in range(_NUMBER.size, len(changes), _NUMBER.size + _PAGE):
            file.seek(_PAGE * _NUMBER.unpack_from(changes, at)[0])
            file.write(changes[at + _NUMBER.size : at + _NUMBER.size + _PAGE])
        file.truncate(_NUMBER.unpack_from(changes)[0])
        _settle(file)
    _journal(path).unlink()


def _journal(path: Path) -> Path:
    return path.with_name(f"{path.name}.journal")


def _settle(file) -> None:
    """Leave nothing in the buffers of Python or of the system."""
    file.flush()
    os.fsync(file.fileno())
