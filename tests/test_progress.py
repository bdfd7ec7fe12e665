"""Progress says which stage runs: lines in a file, bars on a terminal, nothing when quiet."""

import io
import re

import pytest

from tensctl.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def work(stream, **settings) -> str:
    progress = Progress(stream=stream, **settings)
    with progress.stage("simulation"):
        steps = progress.track(4, "steps")
        for _ in range(4):
            steps.advance()
    return stream.getvalue()


def test_lines_where_there_is_no_terminal():
    assert re.fullmatch(r"simulation\nsimulation: \d+\.\d s\n", work(io.StringIO()))


def test_bars_on_a_terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    said = work(Terminal())
    assert "━" in said
    assert "steps" in said
    assert re.search(r"simulation: \d+\.\d s\n$", said)


@pytest.mark.parametrize("stream", [io.StringIO(), Terminal()])
def test_quiet(stream):
    assert work(stream, quiet=True) == ""


@pytest.mark.parametrize("kind", [io.StringIO, Terminal])
def test_a_stage_that_fails_says_so_and_ends(kind):
    stream = kind()
    progress = Progress(stream=stream)
    with pytest.raises(ZeroDivisionError), progress.stage("equilibrium"):
        _ = 1 / 0
    assert re.search(r"equilibrium: stopped after \d+\.\d s\n$", stream.getvalue())
    with progress.stage("report"):
        progress.track(1, "plots").advance()
