"""Every example script runs from top to bottom, in a process of its own, and says what it found."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))


def test_there_are_examples():
    assert SCRIPTS


@pytest.mark.parametrize("script", SCRIPTS, ids=[script.stem for script in SCRIPTS])
def test_runs(script, tmp_path):
    """The first argument, where an example writes something, is the folder for it."""
    before = sorted(EXAMPLES.iterdir())
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:tensctl", str(script), str(tmp_path)],
        capture_output=True, text=True, cwd=tmp_path, env=os.environ | {"MPLBACKEND": "agg"}, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert sorted(EXAMPLES.iterdir()) == before


@pytest.mark.parametrize("script", SCRIPTS, ids=[script.stem for script in SCRIPTS])
def test_is_short(script):
    assert len(script.read_text(encoding="utf-8").splitlines()) < 80
