"""The report: its numbers, its size, and texts of recordings that must have no effect."""

import json
import random
import re
import unicodedata
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import load_press
from sautereau.analysis.report import contents
from sautereau.analysis.report.build import About, Again, build_report
from sautereau.analysis.report.contents import gather
from sautereau.analysis.report.facts import cleaned
from sautereau.analysis.report.pictures import envelope
from sautereau.analysis.report.tables import Fit, read_fit
from sautereau.analysis.text import percent
from sautereau.rig.load import parse_rig, with_values
from tests.budget import slow

ABOUT = About("a session", "0.1.0", commands=("sautereau report x",))
LARGEST = 6_000_000  # Bytes of a page of 20 presses


class Page(HTMLParser):
    """A page as an HTML parser reads it."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.tags, self.attributes, self.texts, self.rows = [], [], [], []
        self._script = False
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, *pair) for pair in attrs]
        self._script = tag in ("script", "style")
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag):
        self._script = False

    def handle_data(self, data):
        if not self._script:
            self.texts.append(data)
            if self.rows and data.strip():
                self.rows[-1].append(data.strip())

    @property
    def text(self):
        return "".join(self.texts)


@pytest.fixture(scope="module")
def twenty(write_session, tmp_path_factory):
    paths = write_session(tmp_path_factory.mktemp("twenty"), 20)
    found = gather(paths, "elastica")
    return found, build_report(found, ABOUT)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400).map(np.array), st.integers(0, 100))
def test_an_envelope_keeps_every_peak(signal, points):
    kept = envelope(signal, points)
    assert (np.diff(kept) > 0).all()
    assert kept[0] == 0
    assert kept[-1] == len(signal) - 1
    assert signal[kept].min() == signal.min()
    assert signal[kept].max() == signal.max()
    assert len(kept) <= max(points, 2) + 2


@given(st.text(max_size=60))
def test_every_character_is_visible(text):
    found = cleaned(text)
    hidden = {"Cc", "Cf", "Cs", "Co", "Zl", "Zp"}
    assert not [c for c in found if unicodedata.category(c) in hidden and c not in "\n\t"]
    if text.isprintable():
        assert found == text


def test_a_page_of_twenty_presses_keeps_its_size_and_loads_nothing(twenty):
    _, text = twenty
    assert len(text.encode()) < LARGEST
    page = Page(text)
    assert not [a for a in page.attributes if a[1] in ("src", "srcset", "action", "data")]
    assert {value for _, name, value in page.attributes if name == "href"} == {"#presses"}
    (policy,) = [value for _, name, value in page.attributes if value and "default-src" in value]
    assert "default-src 'none'" in policy
    assert "unsafe-eval" not in policy
    assert "http" not in policy


def test_the_table_holds_the_features(twenty):
    found, text = twenty
    rows = [row for row in Page(text).rows if row and row[0].isdigit() and len(row) > 5]
    assert [int(row[0]) for row in rows] == list(range(1, 21))
    for row, record in zip(rows, found.presses, strict=True):
        first = record.phases.plucks[0]
        times = [cell.partition(" ± ")[0] for cell in row]
        assert {f"{t * 1e3:.3f}" for t in (first.contact, first.release)} <= set(times)
        assert f"{first.release_force:.4f}" in row
    mean = np.mean([r.phases.plucks[0].pluck_duration for r in found.presses])
    (foot,) = [row for row in Page(text).rows if row and row[0] == "mean"]
    assert f"{mean * 1e3:.3f}" in foot


def test_traces_are_samples_of_the_recording(twenty):
    found, _ = twenty
    record = found.presses[3]
    press = load_press(record.press.path)
    for column, trace in record.traces.items():
        assert len(trace.x) <= found.points + 2
        drawn = press.data[column].loc[trace.x].to_numpy()
        np.testing.assert_array_equal(drawn, trace.y)
        assert trace.y.max() == press.data[column].max()


def test_comparison_and_repeatability_are_on_the_page(twenty):
    found, text = twenty
    (condition,) = found.conditions
    page = Page(text).text
    assert percent(condition.comparison.duration_error.value) in page
    assert f"{condition.repeatability.path_repeatability * 1e6:.3g} µm" in page
    assert not re.search(r"\b(um|uJ)\b", page)
    assert "SIMULATED: 20 of 20 presses" in page


def test_the_rig_on_the_page_is_the_rig(write_session, tmp_path):
    # An ideal sensor's delay of 0 s lies outside the range that the paper's is assumed in.
    one = write_session.one.rig
    assumed = {key: ends for key, ends in one.assumed.items() if not key.startswith("daq.")}
    rig = one.model_copy(update={"assumed": assumed})
    rig = with_values(rig, {"daq.channels.1.input_delay": "-4.8 us"})
    text = build_report(gather(write_session(tmp_path, 1, rig=rig), "elastica"), ABOUT)
    (shown_rig,) = re.findall(r'<pre id="rig-toml">(.*?)</pre>', text, re.DOTALL)
    assert parse_rig(Page(shown_rig).text) == rig
    assert re.search(r"corrected in force\s*delay of the input -4.8 µs", Page(text).text)


def test_warnings_come_first_and_once(write_session, tmp_path):
    fault = ("fault", "the lid was open")
    found = gather(write_session(tmp_path, 2, events=(fault,)), "elastica")
    text = build_report(found, About("a", "0", warnings=("the folder is odd",)))
    page = Page(text).text
    assert page.index("the folder is odd") < page.index("the lid was open")
    assert page.index("fault: the lid was open (press 1 to 2)") < page.index("Setup")


def test_a_damaged_recording_is_reported(write_session, tmp_path):
    paths = write_session(tmp_path, 2)
    data = paths[1].read_bytes()
    paths[1].write_bytes(data[: len(data) // 2])
    found = gather(paths, "elastica")
    assert [record.number for record in found.presses] == [1]
    assert "press-0002.mcap could not be read" in Page(build_report(found, ABOUT)).text
    with pytest.raises(AnalysisError, match="no recording of 1 can be read"):
        gather(paths[1:2], "elastica")
    with pytest.raises(AnalysisError, match="no recording of 0"):
        gather([], "elastica")


def test_conditions_are_separated(write_session, tmp_path):
    rig = with_values(write_session.one.rig, {"plectrum.thickness": "0.5 mm"})
    paths = write_session(tmp_path, 1) + write_session(tmp_path, 2, first=2, rig=rig)
    found = gather(paths, "elastica")
    assert [len(condition.presses) for condition in found.conditions] == [1, 2]
    assert list(found.conditions[1].changed) == ["plectrum.thickness"]
    page = Page(build_report(found, ABOUT))
    assert "plectrum.thickness = 0.0005 m" in page.text
    assert [t for t in page.texts if t in ("condition 1", "condition 2")]


def test_warm_up_presses_are_excluded(write_session, tmp_path):
    paths = write_session(tmp_path, 1, warm_up=True, noise=0.01)
    paths += write_session(tmp_path, 3, first=2)
    (condition,) = gather(paths, "elastica").conditions
    assert condition.comparison.presses == 3
    assert condition.repeatability.presses == 3


def test_a_key_that_did_not_move(write_session, tmp_path):
    found = gather(write_session(tmp_path, 1, scale=0.0), "elastica")
    page = Page(build_report(found, ABOUT)).text
    assert "the key did not move down" in page
    assert "no comparison with the model" in page


def test_of_many_presses_not_all_are_drawn(write_session, tmp_path, monkeypatch):
    monkeypatch.setattr(contents, "POINTS", 2 * 3 * contents.LEAST_POINTS)
    found = gather(write_session(tmp_path, 4), "elastica")
    assert [bool(record.traces) for record in found.presses] == [True, False, True, False]
    assert "of 2 of 4 presses" in Page(build_report(found, ABOUT)).text


def test_fits_and_the_command_that_repeats_the_session(twenty):
    found, _ = twenty
    fit = Fit("fit.json", "20 presses", (("string.tension", "66.9 N", "0.1", "66.7 to 67.1"),))
    about = About("a", "0", again=Again("Press so:", "sautereau press"), scene="{}", fits=(fit,))
    page = Page(build_report(found, about)).text
    assert "Fitted parameters: fit.json" in page
    assert "66.7 to 67.1" in page
    assert "Press so:" in page


FIT = {
    "parameters": {
        "key.inertia": {
            "unit": "kg*m**2", "value": 7.1e-4, "std": 1e-6, "ci95": [7.0e-4, 7.2e-4],
            "start": 7e-4, "at_bound": False, "identifiable": True,
        },
        "string.tension": {
            "unit": "N", "value": 66.0, "std": None, "ci95": None,
            "start": 66.0, "at_bound": False, "identifiable": False,
        },
    },
    "presses": ["a", "b"], "level": "elastica", "rms": 1e-3, "rms_before": 2e-3,
    "warnings": ["few presses"],
}  # fmt: skip


def test_a_fit_of_identify_is_read(tmp_path):
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(FIT))
    fit = read_fit(path)
    assert fit.rows == (
        ("key.inertia", "7.100e-4 kg m^2", "-", "-", "0.01e-4", "7.000e-4 to 7.200e-4"),
        (
            "string.tension, not identifiable from these recordings",
            *("66.0000 N", "-", "-", "undetermined", "none"),
        ),
    )
    assert fit.warnings == ("few presses",)


@pytest.mark.parametrize(
    ("fits", "said"),
    [({}, "is unknown"), ({"fits": None}, "is unknown"), ({"fits": False}, "does not fit")],
)
def test_the_verdict_of_a_fit_is_shown(tmp_path, fits, said):
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(FIT | fits))
    assert said in read_fit(path).about
    path.write_text(json.dumps(FIT | {"fits": True}))
    assert "fit" not in read_fit(path).about.partition("after")[2]


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"parameters": 3}', "\x00\xff", "NaN"])
def test_another_file_is_refused_as_a_fit(tmp_path, text):
    path = tmp_path / "fit.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(AnalysisError, match=r"fit\.json: .*write it with `sautereau identify"):
        read_fit(path)


ODD = [
    "</script><script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "</title></style></pre><svg onload=alert(1)>",
    "--><!--",
    "{{ 7 * 7 }}{% raw %}",
    "\"'><b onclick='x'>",
    "javascript:alert(1)",
    "\x00\x07\x1b[2J\x7f\x85",
    "\u202etxet\u2066\ufeff\u200b",
    "&lt;script&gt;&#60;",
    "]]><![CDATA[",
    "\ud7ff\ue000\uffff\U0010ffff",
    "line\r\nline\u2028line",
    "%{x}<extra></extra>",
]


LONG = "<i>é" * 210_000  # A megabyte


def malformed(n, seed):
    """Return n malicious or malformed texts."""
    chance = random.Random(seed)
    return [f"{i}:" + "".join(chance.sample(ODD, chance.randint(1, 4))) for i in range(n)]


def page_with(write_session, folder, monkeypatch, simulated, texts, long):
    """Build a page with one of the texts in every place."""
    left = iter(texts)
    channels = {f"daq.channels.{i}.sensor": next(left) for i in (0, 1)}
    rig = with_values(write_session.one.rig, {"name": next(left), **channels})
    places = ("controller", "daq", "scene", "session", "started")
    software = {next(left): next(left) for _ in range(20)}
    monkeypatch.setattr("sautereau.daq.file.provenance.software", lambda: software)
    notes = [next(left), long, next(left)]
    paths = []
    for number in (1, 2, 3):
        events = [(kind, next(left)) for kind in ("fault", "aborted", next(left)) * 6]
        events[-1] = ("fault", long)
        paths += write_session(
            folder,
            1,
            first=number,
            rig=rig,
            events=tuple(events),
            notes=notes[number - 1],
            simulated=simulated,
            **{name: next(left) for name in places},
        )
    fit = Fit(next(left), next(left), ((next(left), next(left), next(left), next(left)),))
    again = Again(next(left), next(left))
    name, version, scene, *rest = left
    about = About(name, version, tuple(rest[:20]), tuple(rest[20:]), again, scene, (fit,))
    quoted = [rig.name, *channels.values(), *notes, events[0][1], *rest[20:], scene, name]
    return build_report(gather(paths, "elastica"), about), quoted


@pytest.mark.parametrize("simulated", [True, slow(False)])
def test_malformed_metadata_is_text(simulated, write_session, tmp_path, monkeypatch):
    """200 malformed texts, some of a megabyte: the page's tags are those with plain texts."""
    places = (write_session, tmp_path / "odd", monkeypatch, simulated)
    text, quoted = page_with(*places, malformed(200, 5), LONG)
    places = (write_session, tmp_path / "plain", monkeypatch, simulated)
    other, _ = page_with(*places, [f"text {i}" for i in range(200)], "another")
    page, plain = Page(text), Page(other)
    assert page.tags == plain.tags
    assert [a[:2] for a in page.attributes] == [a[:2] for a in plain.attributes]
    assert len(text.encode()) < LARGEST
    assert not re.search("[\x00-\x08\x0b-\x1f\u202e\u2066]", text.split("<script>")[0])
    for one in quoted:
        assert cleaned(one) in page.text
    for data in re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text):
        assert "alert" not in data
        json.loads(data)
