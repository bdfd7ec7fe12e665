"""The house stands: imports point one way, and the front door is light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import tensctl

PACKAGE = Path(tensctl.__file__).parent
ROOMS = (
    "scene",
    "structure",
    "elements",
    "statics",
    "model",
    "linear",
    "analysis",
    "synthesis",
    "simulation",
    "accuracy",
    "report",
    "interop",
    "codegen",
    "pipeline",
    "cli",
    "__main__",
)
TOOLS = ("errors", "jit", "progress", "atomic", "threads")
HEAVY = ("numba", "scipy.linalg", "control", "cvxpy", "xarray", "osqp", "matplotlib", "pydantic")
MODULES = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))


def room_of(module: str) -> str:
    """`statics` of `tensctl.statics.newton`; nothing of `tensctl` itself."""
    return ".".join(module.split(".")[1:2])


def name_of(path: Path) -> str:
    parts = ("tensctl", *path.with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(source: str, module: str, *, is_package: bool) -> set[str]:
    """Modules of tensctl that a module imports anywhere in it, under TYPE_CHECKING too."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = module.split(".")[: len(module.split(".")) - node.level + is_package] if node.level else []
            origin = ".".join([*above, *filter(None, [node.module])])
            if origin == "tensctl":
                found |= {f"tensctl.{alias.name}" for alias in node.names}
            else:
                found.add(origin)
    return {name for name in found if name.split(".")[0] == "tensctl"}


def wrong_imports(source: str, module: str, *, is_package: bool = False) -> set[str]:
    """Imports that lead from a room to itself by the front door, to one below it, or nowhere known."""
    own = room_of(module)
    above = set(TOOLS) if own not in TOOLS else {"errors"}
    if own in ROOMS:
        above |= set(ROOMS[: ROOMS.index(own) + 1])
    allowed = above | {own, "__version__"}
    names = imported(source, module, is_package=is_package)
    return {name for name in names if room_of(name) not in allowed}


# The front door, tensctl/__init__.py, leads to every room when asked, so it has no place in the flow.
@pytest.mark.parametrize("path", [path for path in MODULES if name_of(path) != "tensctl"], ids=str)
def test_imports_point_one_way(path):
    module = name_of(path)
    assert room_of(module) in ROOMS + TOOLS, "a new room takes its place in ROOMS"
    source = (PACKAGE / path).read_text(encoding="utf-8")
    assert wrong_imports(source, module, is_package=path.name == "__init__.py") == set()


@pytest.mark.parametrize(
    ("module", "line", "wrong"),
    [
        ("tensctl.statics.newton", "from tensctl.model import Dynamics", {"tensctl.model"}),
        ("tensctl.statics.newton", "from ..linear.modes import x", {"tensctl.linear.modes"}),
        ("tensctl.statics.newton", "def f():\n    import tensctl.cli", {"tensctl.cli"}),
        ("tensctl.statics.newton", "from tensctl import report", {"tensctl.report"}),
        ("tensctl.statics.newton", "from tensctl import shell", {"tensctl.shell"}),
        ("tensctl.statics.newton", "import tensctl as tc", {"tensctl"}),
        ("tensctl.errors", "from tensctl.scene import Scene", {"tensctl.scene"}),
        ("tensctl.statics.newton", "from tensctl.elements.rod import x", set()),
        ("tensctl.statics.newton", "from .balance import x", set()),
        ("tensctl.statics.newton", "from tensctl.errors import TensctlError", set()),
        ("tensctl.cli", "from tensctl import __version__", set()),
    ],
)
def test_wrong_imports_are_seen(module, line, wrong):
    assert wrong_imports(line, module) == wrong


def test_the_front_door_loads_no_heavy_module():
    look = f"import sys, tensctl; tensctl.__version__; print([m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_public_names_are_listed_once_for_each_reader():
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    checked = next(node for node in tree.body if isinstance(node, ast.If))
    for_pyright = {
        alias.name: node.module for node in checked.body if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert for_pyright == tensctl._MODULE_OF
    assert set(tensctl.__all__) == {*for_pyright, "__version__"}
    assert set(dir(tensctl)) == set(tensctl.__all__)


def test_names_come_from_their_rooms():
    from tensctl.scene import Scene

    assert tensctl.Scene is Scene
    with pytest.raises(AttributeError, match="no attribute 'shel'"):
        _ = tensctl.shel


def test_the_citation_names_the_version():
    citation = PACKAGE.parent / "CITATION.cff"
    assert f"version: {tensctl.__version__}\n" in citation.read_text(encoding="utf-8")
