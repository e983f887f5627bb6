"""Generate the page from the template, with all scripts and styles inside."""

import base64
import hashlib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup, escape

from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.report import facts, figures, tables
from sautereau.analysis.report.contents import Contents
from sautereau.analysis.report.slow_motion import moving
from sautereau.analysis.report.tables import Fit
from sautereau.analysis.results.comparison import (
    compared_presses,
    contribution_rows,
    error_cells,
    feature_cells,
    repeatability_rows,
    verdict_line,
)
from sautereau.analysis.session.compare import ERRORS
from sautereau.analysis.text import counted
from sautereau.rig.text import rig_text


@dataclass(frozen=True)
class Again:
    """Command that repeats the session."""

    about: str
    command: str


@dataclass(frozen=True)
class About:
    """Facts about the session that are not in its recordings."""

    name: str
    """Name of the session, for the title."""
    version: str
    """Version of sautereau."""
    commands: tuple[str, ...] = ()
    """Commands that compute the figures from the recordings."""
    warnings: tuple[str, ...] = ()
    again: Again | None = None
    scene: str = ""
    """Scene of the stand-in as text; empty on the hardware."""
    fits: tuple[Fit, ...] = ()
    warm_ups: int = 0
    """Warm-up presses that are not on the page."""


def build_report(contents: Contents, about: About) -> str:
    """Return the report as one HTML page that loads nothing from a network."""
    presses, conditions = contents.presses, contents.conditions
    many = len(conditions) > 1
    names = [f"condition {number}" if many else "" for number in range(1, len(conditions) + 1)]
    plotly, script = _part("package_data/plotly.min.js", "plotly"), _part("page.js")
    shown = moving(contents.slow_motion) if contents.slow_motion else None
    simulated = sum(record.press.simulated for record in presses)
    courses = tables.courses(presses) if len(presses) > 1 else []
    return _template().render(
        title=f"Session {about.name}",
        subtitle=f"{counted(len(presses), 'press')} on rig {conditions[0].rig.name}",
        version=about.version,
        policy=_policy(plotly, script),
        moving=shown,
        about_moving=shown and escape(shown["about"]),
        not_moving=contents.no_slow_motion,
        css=_part("page.css"),
        plotly=plotly,
        script=script,
        simulated=simulated and f"{simulated} of {counted(len(presses), 'press')} simulated",
        warnings=facts.warnings(contents, about.warnings),
        facts=facts.how_pressed(contents, about.warm_ups),
        changes=[{"presses": len(c.presses), "changed": c.changed} for c in conditions]
        if many
        else [],
        zooms=figures.zooms(contents),
        about_time=escape(figures.about_time(contents)),
        table=tables.feature_table(contents),
        over_session=bool(courses),
        repeatability=[
            {
                "name": name,
                "presses": condition.repeatability.presses,
                "rows": repeatability_rows(condition.repeatability),
            }
            for name, condition in zip(names, conditions, strict=True)
            if condition.repeatability
        ],
        about_force=escape(figures.about_force(contents)),
        comparisons=[
            {
                "name": name,
                "level": condition.prediction.level,
                "presses": compared_presses(condition.rig, condition.comparison),
                "rows": [error_cells(condition.comparison, name) for name in ERRORS],
                "verdict": verdict_line(condition.comparison),
                "contributions": contribution_rows(condition.comparison),
                "features": [
                    (*feature_cells(one, string_names(condition.rig)), str(one.presses))
                    for one in condition.features
                    if one.predicted is not None
                ],
            }
            for name, condition in zip(names, conditions, strict=True)
            if condition.comparison and condition.prediction
        ],
        fits=about.fits,
        presses=[
            {"number": p.number, "path": p.press.path.name, "facts": facts.of_recording(p)}
            for p in presses
        ],
        commands="\n".join(about.commands),
        press_again=about.again,
        rig_toml=_long(rig_text(conditions[0].rig)),
        scene_toml=_long(about.scene),
        software=facts.software(presses),
        data=_data(contents, courses, shown),
    )


def build_live(title: str) -> str:
    """Return the page that shows a running session, and beside it the report served as /report."""
    script = _part("live.js")
    css, policy = _part("page.css"), _policy(script)
    return _template("live.html.jinja").render(title=title, css=css, script=script, policy=policy)


def _data(
    contents: Contents, courses: list[tables.Course], shown: dict[str, Any] | None
) -> dict[str, Markup]:
    drawn = {
        "over-time": figures.over_time(contents),
        "force-on-deflection": figures.force_on_deflection(contents),
    }
    if courses:
        drawn["over-session"] = figures.over_session(contents, courses)
    data = {name: plot.to_json() for name, plot in drawn.items()}
    if shown:
        data["slow-motion"] = shown["data"]
    # In which an HTML parser finds no tag.
    return {
        name: Markup(t.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))
        for name, t in data.items()
    }


@cache
def _template(name: str = "page.html.jinja") -> Template:
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        finalize=facts.cleaned,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.from_string(str(_part(name)))


@cache  # plotly's script takes 9 MiB, and the page of a session is built after each press
def _part(name: str, package: str = "sautereau.analysis.report") -> Markup:
    return Markup(resources.files(package).joinpath(name).read_text(encoding="utf-8"))


@cache
def _policy(*scripts: str) -> Markup:
    """Return the content security policy: only the page's own scripts, nothing loaded."""
    hashes = (
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts
    )
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return Markup(
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:"
    )


def _long(text: str) -> Markup | str:
    """Return an escaped text that may be longer than others."""
    # The longest text of a rig or a scene.
    return escape(facts.cleaned(text, 60_000)) if text else ""
