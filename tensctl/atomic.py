"""Results written aside, then moved into place: an earlier result is replaced whole or stays as it was.

A result folder keeps a list of the files that are its own. The next result replaces these and nothing else: a
user's notes beside them stay, and a file that the new result no longer has does not stay behind.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from uuid import uuid4

from tensctl.errors import OutputError

MARK = "summary.json"
"""The file by which a result folder is known; every result has it."""

UNFINISHED = "unfinished"
"""Folder in a result folder with a run that goes to disk while it goes on; no result, and gone when there is one."""

_OWN = ".tensctl-files"  # names of the result's own entries, one a line
_ASIDE = ".tensctl-aside-"  # start of the name of a folder that a result is written into


@contextmanager
def replaced_folder(out: str | PathLike[str]) -> Iterator[Path]:
    """Give a new empty folder to write a result into, and move the result to `out` at the end.

    When the block raises, `out` stays as it was and the new folder is removed.

    Raises
    ------
    OutputError
        On entry, when `out` cannot be written, is a file, or holds files but no result: before anything has
        been computed in vain. At the end, when the result cannot be moved.
    """
    target = Path(out).resolve()
    try:
        _refuse_what_is_no_result(target)
        aside = _folder_aside(target)
    except OSError as error:
        raise _unwritable(target, error) from None
    try:
        new = aside / "new"
        new.mkdir()
        yield new
        names = sorted(entry.name for entry in new.iterdir())
        (new / _OWN).write_text("".join(f"{name}\n" for name in names), encoding="utf-8")
        try:
            _move_in(new, target, aside / "earlier")
        except OSError as error:
            raise _unwritable(target, error) from None
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _refuse_what_is_no_result(target: Path) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise OutputError(f"{target} is a file; expected a folder, new or with an earlier result.")
    names = [entry.name for entry in target.iterdir()]
    holds_files = any(not name.startswith(_ASIDE) and name != UNFINISHED for name in names)
    if holds_files and not (target / MARK).is_file():
        raise OutputError(
            f"{target} holds files but no {MARK}, so it is no earlier result; "
            "expected a folder that is new, empty or an earlier result."
        )


def _folder_aside(target: Path) -> Path:
    """Make a folder from which one rename leads to `target`: inside it or, if it does not exist, beside it.

    Inside, because `target` may be a mount point, with another file system beside it.
    """
    aside = (target if target.exists() else target.parent) / f"{_ASIDE}{uuid4().hex[:8]}"
    aside.mkdir(parents=True)
    return aside


def _move_in(new: Path, target: Path, earlier: Path) -> None:
    """Move a result to its place; when a move fails, undo those before it."""
    if not target.exists():
        new.rename(target)
        return
    earlier.mkdir()
    names = [entry.name for entry in new.iterdir()]
    found = {entry.name for entry in target.iterdir()}
    moves = [(target / name, earlier / name) for name in sorted(found & {*names, *_listed(target)})]
    moves += [(new / name, target / name) for name in names]
    done = []
    try:
        for source, place in moves:
            source.rename(place)
            done.append((source, place))
    except BaseException:
        for source, place in reversed(done):
            place.rename(source)
        raise


def _listed(target: Path) -> list[str]:
    """Names of what an earlier result wrote, as it listed them."""
    own = target / _OWN
    return own.read_text(encoding="utf-8").splitlines() if own.is_file() else []


def _unwritable(target: Path, error: OSError) -> OutputError:
    return OutputError(f"{target} cannot be written: {error.strerror}.")
