"""Records that mcap's writer writes are read as written, those of its conformance suite too."""

import hashlib
import io
import json
from itertools import takewhile
from pathlib import Path
from typing import Any

import pytest
from mcap import records as mcap
from mcap.writer import CompressionType, IndexType, Writer

from selfmodel.logs.log_file import verified_records

CASES = Path(__file__).parents[3] / "shared" / "samples" / "mcap-conformance"
WRITES = {
    "Header": ("start", "profile", "library"),
    "Schema": ("register_schema", "name", "encoding", "data"),
    "Channel": ("register_channel", "topic", "message_encoding", "schema_id", "metadata"),
    "Message": ("add_message", "channel_id", "log_time", "data", "publish_time", "sequence"),
    "Attachment": ("add_attachment", "create_time", "log_time", "name", "media_type", "data"),
    "Metadata": ("add_metadata", "name", "metadata"),
}
"""Method of the writer by type of record, and the fields that it takes."""

INDEXES = {"chx": "CHUNK", "mx": "MESSAGE", "ax": "ATTACHMENT", "mdx": "METADATA"}


@pytest.mark.skipif(
    not CASES.exists(),
    reason="no cases in ../shared/samples/mcap-conformance: foxglove/mcap has them",
)
def test_every_case_of_the_suite_is_read_as_its_description_says(subtests: pytest.Subtests):
    digests, cases = (CASES / "sha256.txt").read_text(), sorted(CASES.glob("*/*.json"))
    assert len(cases) == len(digests.splitlines())
    for case in cases:
        with subtests.test(case.stem):
            described = json.loads(case.read_text())
            data = built(described)
            assert hashlib.sha256(data).hexdigest() in digests

            read = [(type(one).__name__, in_words(vars(one))) for one in records_of(data)]

            assert read == [(told["type"], dict(told["fields"])) for told in described["records"]]


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.parametrize("indexes", [IndexType.ALL, IndexType.NONE])
def test_records_of_every_kind_are_read_as_written(
    compression: CompressionType, indexes: IndexType, *, chunks: bool
):
    output = io.BytesIO()
    options = {"index_types": indexes, "use_chunking": chunks, "enable_data_crcs": True}
    writer = Writer(output, 60, compression, **options)
    told = [mcap.Header("a library", ""), mcap.Schema(1, b"float64 x", "ros2msg", "type")]
    told += [mcap.Channel(k, "/ab"[k], "cdr", {}, 1) for k in (1, 2)]
    told += [mcap.Message(1 + k % 2, k, bytes([k] * k), k + 1, k) for k in range(9)]
    told += [mcap.Attachment(1, 2, "a", "text/plain", b"data"), mcap.Metadata("m", {"key": "text"})]
    for one in told:
        write(writer, type(one).__name__, vars(one))
    writer.finish()

    read = takewhile(lambda one: not isinstance(one, mcap.DataEnd), records_of(output.getvalue()))

    assert sorted(map(repr, read)) == sorted(map(repr, told))  # a chunk ends after an attachment


def records_of(data: bytes) -> list[mcap.McapRecord]:
    """The records but those that the suite leaves out: a chunk is told by what is in it."""
    untold = mcap.Chunk | mcap.MessageIndex
    return [record for record in verified_records(data) if not isinstance(record, untold)]


def write(writer: Writer, kind: str, fields: dict[str, Any]) -> None:
    method, *names = WRITES[kind]
    getattr(writer, method)(*(fields[name] for name in names))


def in_words(value: object) -> object:
    """A value of a record, or its fields, in the words of the suite."""
    if isinstance(value, bytes):
        return [str(byte) for byte in value]
    if isinstance(value, dict):
        return {str(key): in_words(item) for key, item in value.items()}
    return str(value)


def parsed(value: object) -> object:
    """A value in the words of the suite, as the writer takes it."""
    if isinstance(value, list):
        return bytes(map(int, value))
    return int(value) if isinstance(value, str) and value.isdecimal() else value


def built(described: dict[str, Any]) -> bytes:
    """Rebuilds a case of the suite from its description."""
    features = set(described["meta"]["variant"]["features"])
    indexes = IndexType(sum(IndexType[INDEXES[name]].value for name in features & INDEXES.keys()))
    # Repeated channels and schemas, chunks, statistics, offsets of the summary.
    parts = (name in features for name in ("rch", "rsh", "ch", "st", "sum"))
    output = io.BytesIO()
    writer = Writer(output, 2**20, CompressionType.NONE, indexes, *parts, enable_data_crcs=True)
    for record in takewhile(lambda told: told["type"] != "DataEnd", described["records"]):
        write(writer, record["type"], {name: parsed(value) for name, value in record["fields"]})
    writer.finish()
    return output.getvalue()
