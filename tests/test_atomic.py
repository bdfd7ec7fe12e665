"""A result is replaced whole or stays as it was, and nobody else's files are touched."""

from pathlib import Path

import pytest

from tensctl.atomic import replaced_folder
from tensctl.errors import OutputError


def write(out: Path, **files: str) -> None:
    with replaced_folder(out) as folder:
        for name, text in ({"summary": "{}"} | files).items():
            (folder / f"{name}.{'json' if name == 'summary' else 'txt'}").write_text(text)


def write_half(out: Path, fault: type[BaseException]) -> None:
    with replaced_folder(out) as folder:
        (folder / "report.txt").write_text("half")
        raise fault("stopped")


def contents(out: Path) -> dict[str, str]:
    return {path.name: path.read_text() for path in out.iterdir() if not path.name.startswith(".")}


def nothing_left_aside(folder: Path) -> bool:
    return not list(folder.rglob("*aside*"))


@pytest.fixture
def out(tmp_path):
    return tmp_path / "results" / "case"


def test_new_folder_with_its_parents(out):
    write(out, report="new")
    assert contents(out) == {"summary.json": "{}", "report.txt": "new"}
    assert nothing_left_aside(out.parent)


def test_new_folder_can_be_read_by_those_who_can_read_its_neighbours(out, tmp_path):
    write(out)
    (tmp_path / "neighbour").mkdir()
    assert out.stat().st_mode == (tmp_path / "neighbour").stat().st_mode


def test_earlier_result_is_replaced_and_its_other_files_go(out):
    write(out, report="old", run="old")
    write(out, report="new")
    assert contents(out) == {"summary.json": "{}", "report.txt": "new"}
    assert nothing_left_aside(out)


def test_notes_beside_a_result_stay(out):
    write(out, report="old")
    (out / "notes.md").write_text("mine")
    (out / "pictures").mkdir()
    write(out, report="new")
    assert (out / "notes.md").read_text() == "mine"
    assert (out / "pictures").is_dir()


def test_empty_folder_is_filled(out):
    out.mkdir(parents=True)
    write(out, report="new")
    assert contents(out)["report.txt"] == "new"


@pytest.mark.parametrize("fault", [ValueError, KeyboardInterrupt])
def test_failure_leaves_the_earlier_result(out, fault):
    write(out, report="old")
    before = contents(out)
    with pytest.raises(fault):
        write_half(out, fault)
    assert contents(out) == before
    assert nothing_left_aside(out)


def test_failure_leaves_no_new_folder(out):
    with pytest.raises(ValueError, match="stopped"):
        write_half(out, ValueError)
    assert not out.exists()
    assert nothing_left_aside(out.parent)


def test_failed_move_is_undone(out, monkeypatch):
    write(out, report="old", run="old")
    before = contents(out)
    rename, count = Path.rename, 0

    def fails_late(self, place):
        nonlocal count
        count += 1
        if count == 6:  # the four earlier files are out of the way and the first new one is in
            raise OSError(5, "Input/output error")
        return rename(self, place)

    monkeypatch.setattr(Path, "rename", fails_late)
    with pytest.raises(OutputError, match="cannot be written: Input/output error"):
        write(out, report="new", run="new")
    assert count > 6, "moves before the failing one were undone"
    assert contents(out) == before


def test_a_list_of_own_files_cannot_lead_elsewhere(out):
    write(out)
    precious = out.parent / "precious.txt"
    precious.write_text("mine")
    (out / ".tensctl-files").write_text("../precious.txt\n..\n.\n\n")
    write(out)
    assert precious.read_text() == "mine"


def test_folder_with_other_files_is_refused(out):
    out.mkdir(parents=True)
    (out / "thesis.tex").write_text("mine")
    with pytest.raises(OutputError, match=r"holds files but no summary\.json"):
        write(out)
    assert contents(out) == {"thesis.tex": "mine"}


def test_file_is_refused(out):
    out.parent.mkdir()
    out.write_text("mine")
    with pytest.raises(OutputError, match="is a file; expected a folder"):
        write(out)
    assert out.read_text() == "mine"


def test_place_under_a_file_is_refused(out):
    out.parent.write_text("a file")
    with pytest.raises(OutputError, match="cannot be written: Not a directory"):
        write(out)


def test_unwritable_place_is_refused_before_the_work(out, monkeypatch):
    def denied(self, *_, **__):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "mkdir", denied)
    with pytest.raises(OutputError, match="cannot be written: Permission denied"), replaced_folder(out):
        pytest.fail("the block must not run")


def test_current_folder_can_hold_a_result(out, monkeypatch):
    out.mkdir(parents=True)
    monkeypatch.chdir(out)
    write(Path("."), report="old")
    write(Path("."), report="new")
    assert Path("report.txt").read_text() == "new"
