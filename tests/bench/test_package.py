"""Archives of sessions: complete, deterministic, and read by others' RO-Crate reader."""

import csv
import hashlib
import json
import re
import shutil
import zipfile
from datetime import date
from pathlib import Path

import pytest

import sautereau as st
from sautereau.analysis.errors import AnalysisError
from sautereau.commands.app import app
from sautereau.entrance import package
from sautereau.entrance.package import METADATA
from sautereau.rig.load import load_rig, parse_rig

LICENCE = "https://creativecommons.org/licenses/by/4.0/"
AUTHORS = ("https://orcid.org/0000-0002-1825-0097", "A. Person")


@pytest.fixture(scope="module")
def folder(write_session, tmp_path_factory):
    """A session of a design of two speeds, with a warm-up press and an incomplete recording."""
    folder = tmp_path_factory.mktemp("packed") / "my session.1"
    rows = st.design({"jack_speed": ["0.05 m/s", "0.07 m/s"]}, seed=1).rows(load_rig())
    for number, row in enumerate(rows, 1):
        about = {"session": "one", "levels": row.levels, "block": row.block}
        write_session(folder, 1, first=number, rig=row.rig, **about)
    (warm_up,) = write_session(folder / "other", 1, session="one", warm_up=True)
    shutil.move(warm_up, folder / "warm-up-01.mcap")
    (folder / "press-0009.mcap.part").write_bytes(b"cut")
    (folder / "design.csv").write_text("press\n")
    (folder / "private.txt").write_text("not of the session")
    return folder


@pytest.fixture(scope="module")
def packed(folder):
    return st.open(folder).package(licence=LICENCE, authors=AUTHORS)


def test_the_archive_holds_the_session_and_nothing_else(folder, packed):
    assert packed.path == folder.parent / "my session.1.zip"
    presses = {"press-0001.mcap", "press-0002.mcap"}
    beside = {"design.csv", "presses.csv", "presses-columns.json", "rig.toml", "versions.json"}
    with zipfile.ZipFile(packed.path) as archive:
        assert set(archive.namelist()) == presses | beside | {"warm-up-01.mcap", METADATA}
        for path in folder.glob("*.mcap"):
            assert archive.read(path.name) == path.read_bytes()
        rig = parse_rig(archive.read("rig.toml").decode(), "packed")
        rows = list(csv.DictReader(archive.read("presses.csv").decode().splitlines()))
        columns = json.loads(archive.read("presses-columns.json"))
    session = st.open(folder)
    assert rig.key == session[0].rig.values.key
    assert [column["name"] for column in columns] == list(rows[0])
    assert {c["name"]: c["unit"] for c in columns}["release_force"] == "N"
    for row, press in zip(rows, session, strict=True):
        assert float(row["release_force"]) == press.analysed.features["release_force"]
        assert row["path"] == press.path.name
        assert row["level.jack_speed"] == press.info.levels["jack_speed"]


def test_the_same_session_gives_the_same_bytes_elsewhere(folder, packed, tmp_path):
    moved = tmp_path / "far" / folder.name
    shutil.copytree(folder, moved)
    other = st.open(moved).package(tmp_path / "other.zip", licence=LICENCE, authors=AUTHORS)
    assert other.path.read_bytes() == packed.path.read_bytes()
    assert packed.sha256 == hashlib.sha256(packed.path.read_bytes()).hexdigest()


def test_another_reader_finds_every_file(packed):
    crate = pytest.importorskip("rocrate.rocrate").ROCrate(packed.path)
    assert crate.name.endswith("presses of the rig paper")
    assert crate.license.id == LICENCE
    assert crate.root_dataset["author"][0].id == AUTHORS[0]
    found = {entity.id: entity for entity in crate.data_entities}
    with zipfile.ZipFile(packed.path) as archive:
        assert set(found) == set(archive.namelist()) - {METADATA}
        for name, entity in found.items():
            content = archive.read(name)
            assert entity["contentSize"] == str(len(content))
            assert entity["sha256"] == hashlib.sha256(content).hexdigest()
    (action,) = crate.get_by_type("CreateAction")
    assert {one.id for one in action["result"]} == {n for n in found if n.endswith(".mcap")}


def test_the_description_keeps_the_rules_of_ro_crate_1_1(packed):
    """Sections 2 to 4 of https://w3id.org/ro/crate/1.1: descriptor, root, flat graph."""
    with zipfile.ZipFile(packed.path) as archive:
        document = json.loads(archive.read(METADATA))
    assert "https://w3id.org/ro/crate/1.1/context" in document["@context"]
    graph = {entity["@id"]: entity for entity in document["@graph"]}
    assert len(graph) == len(document["@graph"])
    assert all("@type" in entity for entity in graph.values())
    descriptor, root = graph[METADATA], graph["./"]
    assert descriptor["@type"] == "CreativeWork"
    assert descriptor["conformsTo"] == {"@id": "https://w3id.org/ro/crate/1.1"}
    assert descriptor["about"] == {"@id": "./"}
    assert root["@type"] == "Dataset"
    assert all(root[name] for name in ("name", "description", "license"))
    date.fromisoformat(root["datePublished"])
    for entity in graph.values():
        for value in entity.values():
            for each in value if isinstance(value, list) else [value]:
                if isinstance(each, dict):  # entities are referred to, not nested
                    assert set(each) == {"@id"}
                    assert each["@id"] in graph or each["@id"].startswith("https://")
    files = [entity for entity in graph.values() if entity["@type"] == "File"]
    assert [{"@id": file["@id"]} for file in files] == root["hasPart"]
    assert not [f for f in files if re.search(r"[\\ ]|^/|^\.", f["@id"])]


def test_a_file_that_changes_while_it_is_packed_is_noticed(folder, tmp_path, monkeypatch):
    copy = shutil.copytree(folder, tmp_path / "session")

    def changed(part, pieces=package._Part.pieces):
        for number, piece in enumerate(pieces(part)):
            if isinstance(part.source, Path) and not number:
                with part.source.open("ab") as file:
                    file.write(b" ")
            yield piece

    monkeypatch.setattr(package._Part, "pieces", changed)
    with pytest.raises(AnalysisError, match="has changed"):
        st.open(copy).package(tmp_path / "a.zip")
    assert list(tmp_path.iterdir()) == [copy]


def test_an_archive_that_does_not_read_back_is_refused(folder, tmp_path, monkeypatch):
    def other(archive, part, written=package._written):
        _, size = written(archive, part)
        return "0" * 64, size

    monkeypatch.setattr(package, "_written", other)
    with pytest.raises(AnalysisError, match="does not read back"):
        st.open(folder).package(tmp_path / "a.zip")
    assert list(tmp_path.iterdir()) == []


def test_the_command(folder, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    words = ["package", str(folder), "--out", "a.zip", "--json"]
    assert app(words, exit_on_error=False) == 0
    printed = capfd.readouterr()
    result = json.loads(printed.out)
    assert result["sha256"] == hashlib.sha256((tmp_path / "a.zip").read_bytes()).hexdigest()
    assert result["simulated"]
    assert ["--license" in text for text in result["warnings"]] == [True]
    with pytest.raises(AnalysisError, match="one folder"):
        st.open(sorted(folder.glob("*.mcap"))[:2]).package()
