"""An MCAP file taken apart, changed in its structure, and put together with right checksums."""

import random
import struct
import zlib
from dataclasses import dataclass, field

import numpy as np
import zstandard

from tests.fuzz import mutate

MAGIC = b"\x89MCAP0\r\n"
PREFIX = struct.Struct("<BQ")
FOOTER, CHUNK, MESSAGE, INDEX, METADATA, DATA_END, CHANNEL = 2, 6, 5, 8, 12, 15, 4
MESSAGE_HEAD = struct.Struct("<HIQQ")
LARGEST = 6_000_000  # Byte, of the records that a mutation repeats


@dataclass
class Record:
    """A record; a chunk has others in it."""

    opcode: int
    body: bytes
    inner: "list[Record]" = field(default_factory=list)

    def packed(self) -> bytes:
        body = self.body
        if self.opcode == CHUNK:
            data = b"".join(record.packed() for record in self.inner)
            frame = zstandard.ZstdCompressor(level=1).compress(data)
            head = self.body[:16] + struct.pack("<QII", len(data), zlib.crc32(data), 4) + b"zstd"
            body = head + struct.pack("<Q", len(frame)) + frame
        return PREFIX.pack(self.opcode, len(body)) + body


def records(data: bytes) -> list[Record]:
    """Return the records of an undamaged stretch of a file."""
    found, at = [], 0
    while at < len(data):
        opcode, length = PREFIX.unpack_from(data, at)
        body = data[at + 9 : at + 9 + length]
        inner = []
        if opcode == CHUNK:
            name = 32 + int.from_bytes(body[28:32], "little")
            packed = body[name + 8 :]
            plain = zstandard.ZstdDecompressor().decompress(packed) if name > 32 else packed
            inner = records(plain)
        found.append(Record(opcode, body, inner))
        at += 9 + length
    return found


def together(parts: list[Record]) -> bytes:
    """Return a file of records, with the checksums and the places of its chunks made right."""
    data, summary, chunks = bytearray(MAGIC), bytearray(), []
    made: dict[int, bytes] = {}  # One chunk may be there a thousand times
    target = data
    for part in parts:
        if part.opcode == DATA_END and target is data:
            data += PREFIX.pack(DATA_END, 4) + struct.pack("<I", zlib.crc32(data))
            target = summary
        elif part.opcode == FOOTER:
            head = PREFIX.pack(FOOTER, 20) + struct.pack("<QQ", len(data), 0)
            crc = zlib.crc32(bytes(summary) + head)
            return bytes(data + summary + head + struct.pack("<I", crc) + MAGIC)
        elif part.opcode == INDEX and chunks and len(part.body) >= 32:
            place = struct.pack("<QQ", *chunks.pop(0))
            target += Record(INDEX, part.body[:16] + place + part.body[32:]).packed()
        else:
            packed = made.get(id(part)) or part.packed()
            made[id(part)] = packed
            if part.opcode == CHUNK:
                chunks.append((len(target), len(packed)))
            target += packed
    return bytes(data + summary)


def texts(body: bytes) -> tuple[str, dict[str, str]]:
    """Return name and entries of a Metadata record."""

    def text(at: int) -> tuple[str, int]:
        end = at + 4 + int.from_bytes(body[at : at + 4], "little")
        return body[at + 4 : end].decode(), end

    name, at = text(0)
    end, at, found = at + 4 + int.from_bytes(body[at : at + 4], "little"), at + 4, {}
    while at < end:
        key, at = text(at)
        found[key], at = text(at)
    return name, found


def _packed(text: str) -> bytes:
    data = text.encode("utf-8", "surrogatepass")
    return struct.pack("<I", len(data)) + data


def metadata(name: str, values: dict[str, str]) -> bytes:
    """Return the body of a Metadata record; its checksum is made right where it has one."""
    content = b"".join(_packed(t) for pair in values.items() for t in pair if pair[0] != "crc32")
    body = _packed(name) + struct.pack("<I", len(content)) + content
    if "crc32" not in values:
        return body
    crc = zlib.crc32(PREFIX.pack(METADATA, len(body)) + body)
    content += _packed("crc32") + _packed(f"{crc:08x}")
    return _packed(name) + struct.pack("<I", len(content)) + content


def of_metadata(body: bytes, dice: random.Random) -> bytes:
    """Change an entry of a Metadata record: in its JSON, in its text, or its name."""
    try:
        name, values = texts(body)
        key = dice.choice(list(values))
    except (UnicodeDecodeError, IndexError):  # already changed
        return mutate.of_bytes(body, dice)
    match dice.randrange(8):
        case 0:
            del values[key]
        case 1:
            values[dice.choice(mutate.TEXTS)] = values[key]
        case 2:
            name = dice.choice((*mutate.TEXTS, "rig", "session", "end", "recovered"))
        case 3:
            values[key] = mutate.json_text(mutate.hostile(dice))
        case _ if values[key].startswith(("{", "[")):
            values[key] = mutate.of_json(values[key], dice).decode("utf-8", "replace")
        case _:
            values[key] = mutate.of_text(values[key], dice)
    return metadata(name, values)


def _varint(value: int) -> bytes:
    value %= 1 << 64
    found = bytearray()
    while value > 127:
        found.append(value & 127 | 128)
        value >>= 7
    return bytes(found) + bytes([value])


def wide(value: int) -> bytes:
    """Return a varint of five bytes."""
    return bytes(value >> 7 * i & 127 | (128 if i < 4 else 0) for i in range(5))


def fields(data: bytes) -> list[tuple[int, int, bytes]]:
    """Return number, wire type and content of the fields of a protobuf message."""
    found, at = [], 0

    def varint() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while at < len(data):
        key = varint()
        if key & 7 == 0:
            content = _varint(varint())
        else:
            size = {1: 8, 5: 4}.get(key & 7) or varint()
            content = data[at : at + size]
            at += size
        found.append((key >> 3, key & 7, content))
    return found


def of_message(data: bytes, dice: random.Random) -> bytes:
    """Change a field of a protobuf message."""
    try:
        found = fields(data)
    except IndexError:  # an earlier change has cut it
        return mutate.of_bytes(data, dice)
    if found:
        at = dice.randrange(len(found))
        number, kind, content = found[at]
        match dice.randrange(6):
            case 0:
                del found[at]
            case 1:
                found.append(found[at])
            case 2:
                found[at] = (dice.randrange(1, 9), kind, content)
            case _ if kind == 0:
                values = (0, 1, -1, 2**31, 2**53, 2**62, 2**63 - 1, 2**63, 1500, -1500)
                found[at] = (number, 0, _varint(dice.choice(values)))
            case _ if kind == 1:
                value = float(dice.choice(mutate.NUMBERS[:23]))
                found[at] = (number, 1, struct.pack("<d", value))
            case _:
                found[at] = (number, kind, mutate.of_bytes(content, dice)[: 1 << 20])
    return packed(found)


def packed(found: list[tuple[int, int, bytes]]) -> bytes:
    """Return a protobuf message of the fields that `fields` returns."""
    data = bytearray()
    for number, kind, content in found:
        data += _varint(number << 3 | kind)
        if kind == 2:
            size = len(content)
            # A block's length always has five bytes.
            data += _varint(size) if size < 1000 else wide(size)
        data += content
    return bytes(data)


def mutated(data: bytes, dice: random.Random) -> bytes:
    """Return a recording with its structure changed and its checksums right."""
    parts = records(data[len(MAGIC) : -len(MAGIC)])
    for _ in range(dice.choice((1, 1, 2, 4))):
        _change(parts, dice)
    return together(parts)


def _change(parts: list[Record], dice: random.Random) -> None:
    """Change one thing; without a chunk or Metadata record a change of these adds one."""
    chunks = [part for part in parts if part.opcode == CHUNK and part.inner]
    named = [part for part in parts if part.opcode == METADATA]
    changes = (
        *[(_change_named, named)] * 4,
        *[(_change_message, chunks)] * 3,
        (_change_chunk, chunks),
        (_change_order, parts),
        (_change_body, parts),
        (_add_channel, chunks),
    )
    change, among = dice.choice((*changes, (_add_metadata, parts)))
    (change if among else _add_metadata)(among or parts, dice)


def _change_named(named: list[Record], dice: random.Random) -> None:
    """Change a Metadata record; each is written twice, and the first or both are changed."""
    part = dice.choice(named)
    name, new = first_name(part), of_metadata(part.body, dice)
    for other in named if dice.random() < 0.8 else [part]:
        if first_name(other) == name:
            other.body = new


def first_name(part: Record) -> str:
    """Return the name of the Metadata record that a record is, or repeats."""
    size = int.from_bytes(part.body[:4], "little")
    return part.body[4 : 4 + size].decode(errors="replace").removesuffix(" (copy)")


def _change_message(chunks: list[Record], dice: random.Random) -> None:
    chunk = dice.choice(chunks)
    record = dice.choice(chunk.inner[:64] + chunk.inner[-8:])
    if record.opcode != MESSAGE:
        record.body = mutate.of_bytes(record.body, dice)
        return
    head, body = record.body[: MESSAGE_HEAD.size], record.body[MESSAGE_HEAD.size :]
    if dice.random() < 0.2:
        head = mutate.of_bytes(head, dice)[: MESSAGE_HEAD.size].ljust(MESSAGE_HEAD.size, b"\0")
    record.body = head + of_message(body, dice)


def _change_chunk(chunks: list[Record], dice: random.Random) -> None:
    inner = dice.choice(chunks).inner
    _rearrange(inner, *sorted(dice.randrange(len(inner)) for _ in range(2)), dice)


def _change_order(parts: list[Record], dice: random.Random) -> None:
    _rearrange(parts, *sorted(dice.randrange(len(parts) - 1) for _ in range(2)), dice)


def _rearrange(records: list[Record], a: int, b: int, dice: random.Random) -> None:
    """Exchange two records, remove those between them, or repeat one."""
    match dice.randrange(4):
        case 0:
            records[a], records[b] = records[b], records[a]
        case 1:
            del records[a:b]
        case _:
            records[b:b] = repeated(records[a], dice)


def _change_body(parts: list[Record], dice: random.Random) -> None:
    part = dice.choice(parts)
    if part.opcode not in (FOOTER, DATA_END):
        part.body = mutate.of_bytes(part.body, dice)[: 1 << 22]


def _add_channel(chunks: list[Record], dice: random.Random) -> None:
    chunk = dice.choice(chunks)
    channel = struct.pack("<HH", dice.choice((1, 2, 3, 900, 65535)), 1)
    topic = dice.choice(
        (*mutate.TEXTS, "/daq", "/daq/velocity", "/daq/x", "/preview/force", "/plan")
    )
    content = channel + _packed(topic) + _packed("protobuf") + struct.pack("<I", 0)
    chunk.inner.insert(dice.randrange(len(chunk.inner)), Record(CHANNEL, content))


def _add_metadata(parts: list[Record], dice: random.Random) -> None:
    values = {mutate.json_text(mutate.hostile(dice))[:40]: "x" * dice.choice((1, 60_000, 2**20))}
    name = dice.choice(("rig", "end", "session", "channels", "other", "x" * 70_000))
    parts.insert(dice.randrange(len(parts)), Record(METADATA, metadata(name, values)))


def oversized(data: bytes, dice: random.Random) -> bytes:
    """Give a chunk, a Metadata record or an inner string a length without sense."""
    places = [i for i in range(len(data) - 60) if data[i] in (CHUNK, METADATA)]
    place = dice.choice(places) + dice.choice([1, 25, 33, 41, 49])
    wide = dice.choice([2**31, 2**32 - 1, 2**40, 2**64 - 1, len(data), dice.randrange(2**20)])
    changed = data[:place] + wide.to_bytes(8, "little") + data[place + 8 :]
    return with_checksums(changed) if dice.random() < 0.5 else changed


def bomb(data: bytes, dice: random.Random) -> bytes:
    """Insert chunks of zeros with their true size or a wrong one, before the first chunk."""
    size, piece, crc = dice.choice([2**20, 2**25, 2**28]), bytes(2**20), 0
    compressor = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    frame = b""
    for _ in range(size // len(piece)):
        frame += compressor.compress(piece)
        crc = zlib.crc32(piece, crc)
    frame += compressor.flush()
    claimed = dice.choice([size, 1000, 2**63, 0])
    head = struct.pack("<QQQII", 0, 0, claimed, crc, 4) + b"zstd"
    body = head + struct.pack("<Q", len(frame)) + frame
    place = len(MAGIC)
    while data[place] != CHUNK:
        place += 9 + int.from_bytes(data[place + 1 : place + 9], "little")
    chunks = (PREFIX.pack(CHUNK, len(body)) + body) * dice.choice([1, 5])
    return with_checksums(data[:place] + chunks + data[place:])


def with_checksums(data: bytes) -> bytes:
    """Make the checksums of a file right again, whose records need not be readable."""
    end = data.rfind(PREFIX.pack(DATA_END, 4))
    body = data[: end + 9] + struct.pack("<I", zlib.crc32(data[:end]))
    summary, footer = data[end + 13 : -37], struct.pack("<BQQQ", FOOTER, 20, len(body), 0)
    crc = zlib.crc32(summary + footer)
    return body + summary + footer + struct.pack("<I", crc) + MAGIC


def change_metadata(parts: list[Record], dice: random.Random, name: str) -> None:
    """Change both copies of a Metadata record alike."""
    named = [p for p in parts if p.opcode == METADATA and first_name(p) == name]
    body = of_metadata(named[0].body, dice)
    for part in named:
        part.body = body


def change_volts(parts: list[Record], dice: random.Random) -> None:
    """Put other doubles into the samples of a recording, of a length of their own."""
    messages = [r for p in parts for r in p.inner if r.opcode == MESSAGE and len(r.body) > 4000]
    for record in messages if dice.random() < 0.5 else [dice.choice(messages)]:
        found = fields(record.body[MESSAGE_HEAD.size :])
        at = max(range(len(found)), key=lambda k: len(found[k][2]))
        number, kind, content = found[at]
        volts = np.frombuffer(content, "<f8").copy()
        a, b = sorted(dice.randrange(len(volts) + 1) for _ in range(2))
        match dice.randrange(5):
            case 0:
                volts[a:b] = float(dice.choice(mutate.NUMBERS[:23]))
            case 1:
                volts[a:b] *= float(dice.choice(mutate.NUMBERS[:23]))
            case 2:
                volts = np.roll(volts, a)
            case 3:
                volts[a:b] = volts[a:b][::-1]
            case _:
                volts = np.random.default_rng(a).normal(
                    0, 10.0 ** dice.randrange(-9, 9), len(volts)
                )
        found[at] = (number, kind, volts.tobytes())
        record.body = record.body[: MESSAGE_HEAD.size] + packed(found)


def repeated(record: Record, dice: random.Random) -> list[Record]:
    """Return a record once or as often as fits; messages are numbered as if they differed."""
    size = max(12, len(record.packed()))
    return [record] * min(dice.choice((1, 2, 1000, 10**6)), max(1, LARGEST // size))
