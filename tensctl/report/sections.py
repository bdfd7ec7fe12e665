"""The report's sections in order, and which of them a case has data for."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from tensctl.report.case import Case


@dataclass(frozen=True)
class Section:
    """A section: anchor and template name, heading, and whether a case fills it."""

    name: str
    title: str
    present: Callable[[Case], bool]

    @property
    def template(self) -> str:
        """File name of the section's template."""
        return f"{self.name}.html"


def _certified(case: Case) -> bool:
    solved = case.run is not None and len(case.run.solve_time) > 0
    return case.lqr is not None or case.lqg is not None or case.mpc_check is not None or solved


SECTIONS = (
    Section("motion", "Motion", lambda case: True),
    Section("shape", "Shape", lambda case: case.equilibrium is not None),
    Section("path", "Path", lambda case: case.path is not None and case.survey is not None),
    Section("history", "Over time", lambda case: case.run is not None and len(case.run.time) > 1),
    Section("actuators", "Actuators", lambda case: case.demand is not None),
    Section("sanity", "Sanity", lambda case: case.sanity is not None),
    Section("accuracy", "Accuracy", lambda case: case.accuracy is not None),
    Section("solvers", "Solvers", lambda case: case.solvers is not None),
    Section("modes", "Modes", lambda case: case.linear is not None and len(case.linear.modes) > 0),
    Section("controllability", "Controllability", lambda case: case.controllability is not None),
    Section("certificates", "Controllers", _certified),
    Section("model", "Model", lambda case: bool(case.explain)),
    Section("record", "Record", lambda case: bool(case.checks or case.seconds or case.scene_toml)),
)


def sections_of(case: Case) -> tuple[Section, ...]:
    """The sections that this case fills."""
    return tuple(_still(section, case) for section in SECTIONS if section.present(case))


def _still(section: Section, case: Case) -> Section:
    """The first section under a name that fits when nothing moves."""
    moves = case.run is not None or case.path is not None
    return section if moves or section.name != "motion" else replace(section, title="Structure")
