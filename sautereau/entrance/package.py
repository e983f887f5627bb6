"""A session as one archive for a repository: recordings, tables, rig, versions, and what they are.

The archive is a ZIP file, described as an RO-Crate 1.1 (Sefton et al., 2021,
https://w3id.org/ro/crate/1.1). The same files give the same bytes: their order, dates and modes are
fixed, and nothing is compressed, because recordings are compressed already.
"""

import hashlib
import json
import mimetypes
import os
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO
from urllib.parse import quote

from sautereau.analysis.campaign.row import unit_of
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.session.analysed import AnalysedPress
from sautereau.daq.file.reading import read_recording
from sautereau.rig.disk import as_text, new_file, open_regular
from sautereau.rig.faults import fault_list
from sautereau.rig.text import rig_text
from sautereau.rig.version import made_by
from sautereau.robot.experiment.design import RECORD
from sautereau.robot.experiment.session import WARM_UPS
from sautereau.robot.experiment.session_folder import MANIFEST

if TYPE_CHECKING:
    import pandas as pd

METADATA = "ro-crate-metadata.json"  # Name that RO-Crate requires
BESIDE = (MANIFEST, RECORD, "learned.json", "fit*.json", "*.truth.json", "report.html")
"""Patterns of the files of a session's folder that are packed with its recordings."""
TYPES = {".mcap": "application/octet-stream", ".toml": "application/toml"}


@dataclass(frozen=True)
class Package:
    """An archive that was written."""

    path: Path
    files: tuple[str, ...]
    """Names in the archive, without the description."""
    sha256: str
    """Of the archive."""
    simulated: bool
    """Whether the stand-in made any of the presses."""
    left_out: tuple[str, ...] = ()
    """Recordings that are packed but not in the table, with the reasons."""


@dataclass(frozen=True)
class _Part:
    """One file of the archive."""

    name: str
    source: Path | bytes
    description: str

    def pieces(self) -> Iterator[bytes]:
        """Yield the content; a file that changes meanwhile is refused."""
        if isinstance(self.source, bytes):
            yield self.source
            return
        with open_regular(self.source) as file:
            before = os.fstat(file.fileno())
            while piece := file.read(1 << 20):
                yield piece
            after = os.fstat(file.fileno())
        if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns):
            raise AnalysisError(
                f"package: {self.name} has changed while it was packed; end what writes into the"
                " folder, and pack it again"
            )


def package_of(folder: Path) -> Path:
    """Return the archive of a folder: its name with .zip, beside it."""
    place = folder.resolve()
    return place.with_name(f"{place.name}.zip")


def write_package(
    folder: Path,
    out: Path,
    paths: Sequence[Path],
    presses: Sequence[AnalysedPress],
    table: "pd.DataFrame",
    licence: str = "",
    authors: Sequence[str] = (),
) -> Package:
    """Pack the folder of a session; see `sautereau.entrance.session.Session.package`.

    Args:
        paths: All recordings, without warm-up presses.
        presses: Those that can be analysed.
        table: Their features.
    """
    table = table.assign(path=[as_text(press.press.path.name) for press in presses])
    for factor in presses[0].session.levels:  # of a design
        table[f"level.{factor}"] = [press.session.levels.get(factor) for press in presses]
        table["block"] = [press.session.block for press in presses]
    parts = [_Part(p.name, p, "Recording of a press (MCAP)") for p in paths]
    parts += [
        _Part(p.name, p, "Recording of a warm-up press (MCAP), no part of the results")
        for p in sorted(folder.glob(WARM_UPS))
    ]
    parts += [
        _Part(p.name, p, "File of the session, as sautereau wrote it")
        for pattern in BESIDE
        for p in sorted(folder.glob(pattern))
    ]
    columns = [{"name": str(c), "unit": unit_of(str(c))} for c in table]
    software = read_recording(paths[0]).software
    parts += [
        _Part("presses.csv", _text(table.to_csv(index=False, lineterminator="\n")),
              "Features of the presses, a row each, in SI units"),
        _Part("presses-columns.json", _json(columns), "Columns of presses.csv with their units"),
        _Part("rig.toml", _text(rig_text(presses[0].press.rig)),
              "Bench of the first press, complete; every recording contains its own"),
        _Part("versions.json", _json({"recorded": software, "analysed": made_by()}),
              "Software that made the recordings and the table"),
    ]  # fmt: skip
    parts.sort(key=lambda part: part.name)
    with new_file(out) as file:
        with zipfile.ZipFile(file, "w") as archive:
            digests = {part.name: _written(archive, part) for part in parts}
            about = _described(folder, parts, digests, presses, software, licence, authors)
            description = _Part(METADATA, _json(about), "Description of this archive")
            digests[METADATA] = _written(archive, description)
        _check(file, out, digests)
        file.seek(0)
        digest = hashlib.file_digest(file, "sha256").hexdigest()  # pyright: ignore
    names = tuple(part.name for part in parts)
    return Package(out, names, digest, any(press.press.simulated for press in presses))


def _written(archive: zipfile.ZipFile, part: _Part) -> tuple[str, int]:
    """Write a file into an archive, uncompressed; return its SHA-256, and its size in bytes."""
    entry = zipfile.ZipInfo(part.name, (1980, 1, 1, 0, 0, 0))  # The earliest that ZIP can hold
    entry.external_attr = 0o644 << 16
    entry.create_system = 3  # Unix, wherever it is written
    digest, size = hashlib.sha256(), 0
    with archive.open(entry, "w", force_zip64=True) as target:
        for piece in part.pieces():
            target.write(piece)
            digest.update(piece)
            size += len(piece)
    return digest.hexdigest(), size


def _check(file: BinaryIO, out: Path, digests: Mapping[str, tuple[str, int]]) -> None:
    """Read an archive back, before it gets its name.

    Raises:
        AnalysisError: A file is missing or differs.
    """
    faults = []
    with zipfile.ZipFile(file) as archive:
        if archive.namelist() != list(digests):
            faults.append("its files are not those that were written")
        for name, (digest, _) in digests.items():
            with archive.open(name) as content:
                if hashlib.file_digest(content, "sha256").hexdigest() != digest:  # pyright: ignore
                    faults.append(f"{name}: its content differs")
    if faults:
        fault = fault_list(f"package {out}: it does not read back as written", faults)
        raise AnalysisError(f"{fault}\npack it again, on another disk")


def _described(
    folder: Path,
    parts: Sequence[_Part],
    digests: Mapping[str, tuple[str, int]],
    presses: Sequence[AnalysedPress],
    software: Mapping[str, str],
    licence: str,
    authors: Sequence[str],
) -> dict[str, Any]:
    """Return the description of the archive, as RO-Crate 1.1 requires it."""
    first = presses[0]
    dates = sorted(press.session.started for press in presses)
    simulated = any(press.press.simulated for press in presses)
    people = [
        {"@id": a if a.startswith("https://") else f"#author-{k}", "@type": "Person", "name": a}
        for k, a in enumerate(authors, 1)
    ]
    tool = {
        "@id": "#sautereau", "@type": "SoftwareApplication", "name": "sautereau",
        "softwareVersion": software.get("sautereau", version("sautereau")),
    }  # fmt: skip
    made = {
        "@id": "#session", "@type": "CreateAction",
        "name": "Simulated presses" if simulated else "Presses of a key by a robot",
        "startTime": dates[0], "endTime": dates[-1], "instrument": {"@id": tool["@id"]},
        "result": [{"@id": quote(p.name)} for p in parts if p.name.endswith(".mcap")],
    }  # fmt: skip
    root = {
        "@id": "./", "@type": "Dataset", "name": f"{folder.resolve().name}: presses of the rig"
        f" {first.press.rig.name}",
        "description": f"{'SIMULATED: ' * simulated}{len(presses)} presses of a harpsichord key,"
        " with force and motion, their features, and the numbers of the bench.",
        "datePublished": dates[-1][:10],
        "identifier": first.session.session or folder.resolve().name,
        "hasPart": [{"@id": quote(part.name)} for part in parts],
        "mentions": {"@id": made["@id"]},
    }  # fmt: skip
    if people:
        root["author"] = [{"@id": person["@id"]} for person in people]
    graph: list[dict[str, Any]] = [
        {
            "@id": METADATA, "@type": "CreativeWork", "about": {"@id": "./"},
            "conformsTo": {"@id": "https://w3id.org/ro/crate/1.1"},
        },
        root,
    ]  # fmt: skip
    if licence:
        root["license"] = {"@id": licence}
        graph.append({"@id": licence, "@type": "CreativeWork", "name": licence})
    for part in parts:
        digest, size = digests[part.name]
        suffix = Path(part.name).suffix
        graph.append({
            "@id": quote(part.name), "@type": "File", "name": part.name,
            "description": part.description,
            "contentSize": str(size), "sha256": digest,
            "encodingFormat": TYPES.get(suffix) or mimetypes.types_map.get(suffix, "text/plain"),
        })  # fmt: skip
    context = ["https://w3id.org/ro/crate/1.1/context", {"sha256": "https://schema.org/sha256"}]
    return {"@context": context, "@graph": [*graph, made, tool, *people]}


def _json(document: Any) -> bytes:
    return _text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")


def _text(text: str) -> bytes:
    return as_text(text).encode("utf-8")
