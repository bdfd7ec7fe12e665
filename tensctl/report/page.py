"""A case in, one HTML file out: it loads nothing from elsewhere, and its policy forbids it."""

import base64
import hashlib
import os
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from tensctl.report.case import Case

if TYPE_CHECKING:
    from jinja2 import Environment

_SCRIPTS = (
    *("colours", "camera", "scenery", "stage", "pointer"),
    *("motion", "player", "modes", "cursor", "main"),
)


def write_report(case: Case, path: str | os.PathLike[str]) -> Path:
    """Write the report of a case.

    Parameters
    ----------
    case : Case
        What to show.
    path : path
        The HTML file. It is written aside and renamed: an earlier report stays whole until the new one is.

    Returns
    -------
    Path
        The file written.
    """
    target = Path(path)
    page = render(case)
    target.parent.mkdir(parents=True, exist_ok=True)
    aside = target.with_name(target.name + ".part")
    try:
        aside.write_text(page, encoding="utf-8", newline="\n")
        aside.replace(target)
    finally:
        aside.unlink(missing_ok=True)
    return target


def render(case: Case) -> str:
    """The report's HTML. The same case gives the same text."""
    # matplotlib and jinja2 are loaded here, since only a report needs them.
    from tensctl.report import animation, control_rows, demand_rows, facts, figures, tables
    from tensctl.report.floor import floor_story
    from tensctl.report.sections import sections_of

    motion = animation.motion_of(case)
    script = _script()
    return (
        _environment()
        .get_template("page.html")
        .render(
            case=case,
            motion=motion,
            figures=figures.draw_figures(case, motion),
            sections=sections_of(case),
            tiles=facts.tiles(case),
            verdict=facts.verdict(case),
            solves=tables.solves(case.run),
            shape_errors=tables.shape_errors(case),
            floor=floor_story(case),
            tables=tables,
            control=control_rows,
            demand_rows=demand_rows,
            known=facts.KNOWN,
            speeds=animation.speeds(motion.duration),
            style=_asset("page.css"),
            script=script,
            script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
            motion_json=animation.json_for_html(animation.motion_data(case, motion)),
            mode_json=animation.json_for_html(animation.mode_data(case)),
            palette_json=animation.json_for_html(animation.palette_data()),
        )
    )


def _asset(name: str) -> str:
    return files("tensctl.report").joinpath("assets", name).read_text(encoding="utf-8")


def _script() -> str:
    """The viewer's files as one script that leaves no global name behind."""
    parts = "\n".join(_asset(f"{name}.js") for name in _SCRIPTS)
    return f'(() => {{\n"use strict";\n{parts}}})();\n'


@cache
def _environment() -> "Environment":
    """The templates, compiled once a process: a sixth of a page's time."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    from tensctl.report import numbers, palette

    def source(name: str) -> str:
        return files("tensctl.report").joinpath("templates", name).read_text(encoding="utf-8")

    environment = Environment(
        loader=FunctionLoader(source),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        number=numbers.number,
        plain=numbers.plain,
        fixed=numbers.fixed,
        count=numbers.count,
        seconds=numbers.seconds,
        plural=numbers.plural,
        sentence=numbers.sentence,
        word=str.__str__,
    )
    environment.globals.update(
        light_colours=palette.declarations(dark=False),
        dark_colours=palette.declarations(dark=True),
        ramp=range(len(palette.RAMP)),
    )
    return environment
