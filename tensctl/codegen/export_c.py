"""A controller as one C file and its header: what a step computes, with every matrix a constant table.

    u = -K x,   u = -(C xi + C_u u),   or the first input of the condensed QP; all clipped to the hard limits

The source is C99 and needs math.h and string.h. It allocates nothing, keeps all that it remembers in one static struct,
and bounds its own work: a search that takes more than allowed ends with a plan that is no worse than the last one.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from tensctl import __version__
from tensctl.codegen.feedback import lqg_facts, lqr_facts
from tensctl.codegen.literals import Table, number
from tensctl.codegen.predictive import predictive
from tensctl.errors import OutputError
from tensctl.scene.given import argument, place
from tensctl.scene.values import Number
from tensctl.synthesis import (
    LQG,
    LQR,
    MPC,
    HarmonicLQG,
    HarmonicLQR,
    HarmonicSampledLQR,
    NonlinearMPC,
    SampledLQR,
    ScheduledLQR,
)

StateFeedback = LQR | SampledLQR | ScheduledLQR | HarmonicLQR | HarmonicSampledLQR
Exportable = StateFeedback | LQG | HarmonicLQG | MPC

_NAME = "controller"


@dataclass(frozen=True, eq=False)
class CSource:
    """A controller as C.

    Attributes
    ----------
    kind : "lqr", "lqg" or "mpc"
    header, source : str
    tables : tuple of Table
        The constant arrays of the source.
    """

    kind: str
    header: str
    source: str
    tables: tuple[Table, ...]

    @property
    def table_bytes(self) -> int:
        """Constant memory of the arrays."""
        return sum(table.bytes for table in self.tables)


def export_c(controller: Exportable, path: str | Path, *, max_iterations: int | None = None) -> CSource:
    """Write a controller as C source.

    Parameters
    ----------
    controller : LQR (continuous, sampled, scheduled, harmonic), LQG with a period (harmonic too), MPC or OutputMPC
        What follows a path has it as a table, one row a control period.
    path : path
        A file `NAME.c`, or a folder that exists, for `controller.c`; the header stands beside it.
    max_iterations : int, optional
        Most changes of the active set in each search of an MPC's step, ten times its unknowns by default;
        as in Python, multiplications are bounded too.

    Raises
    ------
    OutputError
        A controller without a form in C, or a place that cannot be written.
    """
    if max_iterations is not None:
        most = Number("changes of the active set", least=1, whole=True)
        max_iterations = argument("max_iterations", max_iterations, most, OutputError)
    path = place("path", path, "a file NAME.c or a folder", OutputError)
    if path.is_dir():
        path = path / f"{_NAME}.c"
    if path.suffix != ".c" or not path.parent.is_dir():
        raise OutputError(f"{path} cannot be written: give a file NAME.c in a folder that exists.")
    made = _made(controller, path.stem, max_iterations)
    try:
        path.write_text(made.source, encoding="utf-8")
        path.with_suffix(".h").write_text(made.header, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from None
    return made


def _made(controller: Exportable, name: str, max_iterations: int | None) -> CSource:
    if isinstance(controller, LQG | HarmonicLQG):
        found = lqg_facts(controller)
    elif isinstance(controller, MPC):
        found = predictive(controller, max_iterations)
    elif isinstance(controller, StateFeedback):
        found = lqr_facts(controller)
    elif isinstance(controller, NonlinearMPC):
        raise OutputError(
            "NonlinearMPC has no form in C: it rolls its plans out on the nonlinear structure; give an MPC, whose "
            "models are linear."
        )
    else:
        raise OutputError(
            f"{type(controller).__name__} has no form in C; give an LQR, an LQG with a control period, a harmonic "
            "design of either, what scheduled_lqr makes, an MPC or an OutputMPC."
        )
    facts: dict[str, Any] = {"name": name, "version": __version__, "number": number}
    facts |= {"charts": (), "delay": 0.0, "lag": 0.0, "sensors": 0, "signal": None} | found
    tables = (*(table for chart in facts["charts"] for table in chart.tables), *facts["tables"])
    facts |= {"tables": tables}
    return CSource(facts["kind"], _filled("controller.h", facts), _filled("controller.c", facts), tables)


def _filled(template: str, facts: dict[str, Any]) -> str:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    def source(name: str) -> str:
        return files("tensctl.codegen").joinpath("templates", name).read_text(encoding="utf-8")

    # C has "{%" and "{#" of its own seldom, but "{{" in every nested initialiser.
    environment = Environment(
        loader=FunctionLoader(source), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True, variable_start_string="<<", variable_end_string=">>", autoescape=False,
    )  # fmt: skip
    return environment.get_template(template).render(facts)
