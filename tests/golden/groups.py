"""The groups of answers, each with its cases: functions of a corpus."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import sautereau as st
from sautereau.commands.app import app
from tests.golden import store
from tests.golden.commands import COMMANDS, ON_BENCH, UNCOVERED, WITHOUT_TEXT
from tests.golden.corpus import DATA, Corpus
from tests.golden.files import recording, shape_of
from tests.golden.plain import plain
from tests.golden.presses import JUDGED, STAND_IN, carved_rig
from tests.golden.tolerances import CHANGED, OTHER, RELATIVE, ROUNDING, Difference, differences
from tests.golden.wire import traffic

Case = Callable[[Corpus], Any]
LEVELS = ("elastica", "rods", "beam", "two-beam")
SIMULATED = ("stand-in", "independent")  # Groups of presses, each simulated and analysed
CONTROLLED = [name for name, words in ON_BENCH.items() if "--log" in words]


def _command(name: str, corpus: Corpus) -> dict[str, Any]:
    found = dict(corpus.answer(name, as_json=True))
    if name not in WITHOUT_TEXT:
        shown = corpus.answer(name, as_json=False)
        found["text"] = shown["text"] if shown["status"] == found["status"] else shown
    return found


def _prediction(rig: st.Rig, level: str) -> dict[str, Any]:
    made = rig.predict(level=level)
    return plain({"scalars": made.scalars, "frame": shape_of(made.to_frame())})


def _sweep() -> dict[str, Any]:
    values = {"plectrum.overlap": ["0.2 mm", "0.3 mm"], "press.jack_speed": ["30 mm/s", "0.1 m/s"]}
    return shape_of(st.Rig().sweep(values).to_frame())


def _interface() -> dict[str, list[str]]:
    """Return the options of every command with their defaults and help."""
    found = {}
    for name in sorted(set(app) - set(UNCOVERED)):
        arguments = app[name].assemble_argument_collection()
        found[name] = [
            f"{' '.join(one.names) or one.name}: {one.field_info.default!r}: {one.parameter.help}"
            for one in arguments
        ]
    return found


def _frames(corpus: Corpus) -> dict[str, Any]:
    """Return names, dtypes and units of all tables of a session of two strings."""
    session = st.open(corpus["press two"])
    compared, fit = session.compare(session), session.identify(["plectrum.overlap"])
    frames = {
        "rig": session[0].rig.to_frame(),
        "rig.plan": st.Rig().plan().checks,
        "data": session[0].data,
        "features": session.features,
        "compare.errors": session.compare().errors,
        "compare.features": session.compare().features,
        "compare.differences": compared.differences,
        "compare.conditions": compared.conditions,
        "identify.params": fit.params,
    }
    sampled = corpus.answer("press two", as_json=True)["sampled"]
    return {"sampled": sampled} | {name: shape_of(frame) for name, frame in frames.items()}


def _read(path: str, corpus: Corpus) -> dict[str, Any]:
    return plain(recording(DATA / path))


def _alone(make: Callable[[], Any]) -> Case:
    return lambda corpus: make()


_OLD = ["format_1.mcap", *(f"written_by_0.1/session/press-000{n}.mcap" for n in (1, 2))]
GROUPS: dict[str, dict[str, Case]] = {
    "stand-in": {name: _alone(make) for name, make in STAND_IN.items()},
    "independent": {name: _alone(make) for name, make in JUDGED.items()},
    "model": {
        **{level: _alone(partial(_prediction, st.Rig(), level)) for level in LEVELS},
        "carved": _alone(lambda: _prediction(st.Rig(carved_rig()), "fe")),
        "sweep": _alone(_sweep),
    },
    "commands": {name: partial(_command, name) for name in COMMANDS},
    "interface": {"options": _alone(_interface)},
    "frames": {"tables": _frames},
    "recordings": {name: partial(_read, name) for name in _OLD},
    "wire": {name: lambda corpus, name=name: traffic(corpus, name) for name in CONTROLLED},
}
"""Cases by group and name."""
QUICK = {
    "stand-in": ["random 001", "ideal, 72 mm/s", "paper, 72 mm/s", "two-choirs, 72 mm/s",
                 "pluck, 72 mm/s", "free-key"],
    "independent": ["all stiff", "random 000"],
    "model": [*LEVELS, "sweep"],
    "commands": ["init", "plan", "mount", "predict", "phases", "phases old", "compare", "touch",
                 "watch", "info", "info format 1", "info cut", "recover", "split", "campaign"],
    "interface": ["options"],
    "recordings": _OLD,
}  # fmt: skip
"""Cases of the quick tests: those without the devices, which take half of a second at most."""


def answers(group: str, names: list[str], corpus: Corpus) -> dict[str, Any]:
    """Return the present answers of some cases of a group, by name."""
    with corpus.inside():
        return {name: GROUPS[group][name](corpus) for name in names}


def compared(group: str, names: list[str], now: dict[str, Any]) -> Iterator[Difference]:
    """Yield where answers differ from the stored ones, and stored cases that are gone.

    Args:
        names: Of the cases that were answered.
        now: Their answers.
    """
    stored, relative = store.load(group), RELATIVE.get(group, OTHER)
    for name in names:
        case = f"{group}/{name}"
        if name not in stored:
            yield Difference(case, "", "(no stored answer: run --write)", "an answer")
        else:
            depends = ROUNDING in stored[name]
            for found in differences(case, stored[name], now[name], relative):
                if not (depends and found.stored == CHANGED):
                    yield found
    for name in stored.keys() - GROUPS[group].keys():
        yield Difference(f"{group}/{name}", "", "an answer", "(no such case)")
