"""The page itself: what was found, put into the template with all that it needs to open."""

import base64
import hashlib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from sautereau.analysis.report import captions, facts
from sautereau.analysis.report.contents import Contents
from sautereau.analysis.report.fits import Fit
from sautereau.analysis.report.moving import Moving, moving
from sautereau.analysis.report.tables import (
    compared_rows,
    comparison_rows,
    course,
    feature_table,
    repeatability_rows,
)
from sautereau.analysis.report.text import shown
from sautereau.rig.text import rig_text

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

MOST_LONG = 60_000
"""Characters of a rig or a scene that the page shows."""


@dataclass(frozen=True)
class Again:
    """How to press so again."""

    about: str
    command: str


@dataclass(frozen=True)
class About:
    """What the report says of its session that no recording holds."""

    name: str
    """Of the session, for the title."""
    version: str
    """Of sautereau."""
    commands: tuple[str, ...] = ()
    """That lead from the recordings to the figures."""
    warnings: tuple[str, ...] = ()
    again: Again | None = None
    scene: str = ""
    """Of the stand-in, as text; empty on the hardware."""
    fits: tuple[Fit, ...] = ()


def build_report(contents: Contents, about: About) -> str:
    """Return the report as one HTML page that loads nothing from elsewhere.

    Args:
        contents: The presses.
        about: What else is to be said.
    """
    from markupsafe import Markup, escape
    from plotly.offline import get_plotlyjs

    presses, conditions = contents.presses, contents.conditions
    part_of = {p.number: i for i, c in enumerate(conditions, 1) for p in c.presses}
    many = len(conditions) > 1
    names = [f"condition {number}" if many else "" for number in range(1, len(conditions) + 1)]
    plotly, script = Markup(get_plotlyjs()), Markup(_part("page.js"))
    shown = moving(contents.slow_motion) if contents.slow_motion else None
    simulated = sum(record.press.simulated for record in presses)
    return _template().render(
        title=f"Session {about.name}",
        subtitle=f"{len(presses)} press{'es' * (len(presses) > 1)} on rig {conditions[0].rig.name}",
        version=about.version,
        policy=_policy(plotly, script),
        moving=shown,
        about_moving=shown and escape(shown.about),
        not_moving=contents.no_slow_motion,
        css=Markup(_part("page.css")),
        plotly=plotly,
        script=script,
        simulated=simulated and f"{simulated} of {len(presses)} presses were made on the stand-in",
        warnings=facts.warnings(contents, about.warnings),
        facts=facts.how_pressed(contents),
        changes=[{"presses": len(c.presses), "changed": c.changed} for c in conditions]
        if many
        else [],
        zooms=captions.zooms(contents),
        about_time=escape(captions.about_time(contents)),
        table=feature_table(presses, part_of),
        over_session=len(presses) > 1,
        repeatability=[
            {
                "name": name,
                "presses": condition.repeatability.presses,
                "rows": repeatability_rows(condition.repeatability),
            }
            for name, condition in zip(names, conditions, strict=True)
            if condition.repeatability
        ],
        about_force=escape(captions.about_force(contents)),
        comparisons=[
            {
                "name": name,
                "level": condition.prediction.level,
                "presses": condition.comparison.presses,
                "rows": comparison_rows(condition.comparison),
                "features": compared_rows(condition.features),
            }
            for name, condition in zip(names, conditions, strict=True)
            if condition.comparison and condition.prediction
        ],
        fits=about.fits,
        presses=[
            {"number": p.number, "path": p.path.name, "facts": facts.of_recording(p)}
            for p in presses
        ],
        commands="\n".join(about.commands),
        press_again=about.again,
        rig_toml=_long(rig_text(conditions[0].rig)),
        scene_toml=_long(about.scene),
        software=facts.software(presses),
        data=_data(contents, shown),
    )


def _data(contents: Contents, shown: Moving | None) -> dict[str, "Markup"]:
    from sautereau.analysis.report.figures import force_on_deflection, over_session, over_time

    drawn = {
        "over-time": over_time(contents),
        "force-on-deflection": force_on_deflection(contents),
    }
    if len(contents.presses) > 1:
        drawn["over-session"] = over_session(contents, course(contents.presses))
    data = {name: figure.to_json(validate=False) or "" for name, figure in drawn.items()}
    if shown:
        data["slow-motion"] = shown.data
    return {name: _embedded(text) for name, text in data.items()}


def _embedded(text: str) -> "Markup":
    """Return JSON that no parser of HTML can take for a tag."""
    from markupsafe import Markup

    return Markup(text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


@cache
def _template() -> "Template":
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        finalize=shown,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.from_string(_part("page.html.jinja"))


def _part(name: str) -> str:
    return resources.files("sautereau.analysis.report").joinpath(name).read_text(encoding="utf-8")


def _policy(*scripts: str) -> "Markup":
    """Return what the page may do: run its own scripts, and load nothing."""
    from markupsafe import Markup

    hashes = (
        base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts
    )
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return Markup(
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data: blob:"
    )


def _long(text: str) -> "Markup | str":
    """Return a long text for a page, escaped, cut far later than others are."""
    from markupsafe import escape

    return escape(shown(text, MOST_LONG)) if text else ""
