"""Records that mcap's writer writes are read as written, those of its conformance suite too."""

import dataclasses
import hashlib
import io
import json
from pathlib import Path
from typing import Any

import pytest
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
)
from mcap.writer import CompressionType, IndexType, Writer

from tests.logs.edits import records_of

CASES = Path(__file__).parents[3] / "shared" / "samples" / "mcap-conformance"
UNTOLD = (Chunk, MessageIndex)
"""What the suite leaves out of its descriptions: a chunk is told by what is in it."""


NONE = pytest.param(
    None,
    marks=pytest.mark.skip(reason=f"the cases of MCAP's conformance suite are not in {CASES.name}"),
)


@pytest.mark.parametrize(
    "case", sorted(CASES.glob("*/*.json")) or [NONE], ids=lambda path: path.stem if path else ""
)
def test_a_case_of_the_suite_is_read_as_its_description_says(case: Path):
    described = json.loads(case.read_text())
    data = built(described)
    assert hashlib.sha256(data).hexdigest() in (CASES / "sha256.txt").read_text()

    read = [as_described(record) for record in records_of(data) if not isinstance(record, UNTOLD)]

    assert read == [(told["type"], dict(told["fields"])) for told in described["records"]]


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.parametrize("indexes", [IndexType.ALL, IndexType.NONE])
def test_records_of_every_kind_are_read_as_written(
    compression: CompressionType, indexes: IndexType, *, chunks: bool
):
    output = io.BytesIO()
    writer = Writer(
        output,
        chunk_size=60,
        compression=compression,
        index_types=indexes,
        use_chunking=chunks,
        enable_data_crcs=True,
    )
    writer.start("", "a library")
    schema = writer.register_schema("type", "ros2msg", b"float64 x")
    topics = [writer.register_channel(name, "cdr", schema) for name in ("/a", "/b")]
    told = [(topics[k % 2], k, bytes([k] * k), k + 1, k) for k in range(9)]
    for message in told:
        writer.add_message(*message)
    writer.add_attachment(1, 2, "name", "text/plain", b"data")
    writer.add_metadata("note", {"key": "text"})
    writer.finish()
    read = records_of(output.getvalue())

    messages = [record for record in read if isinstance(record, Message)]
    assert [
        (m.channel_id, m.log_time, m.data, m.publish_time, m.sequence) for m in messages
    ] == told
    assert Attachment(1, 2, "name", "text/plain", b"data") in read
    assert Metadata("note", {"key": "text"}) in read
    assert {record.topic for record in read if isinstance(record, Channel)} == {"/a", "/b"}


def as_described(record: McapRecord) -> tuple[str, dict[str, Any]]:
    """A record in the words of the suite."""
    fields = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
    return type(record).__name__, {name: as_texts(value) for name, value in fields.items()}


def as_texts(value: object) -> object:
    if isinstance(value, bytes):
        return [str(byte) for byte in value]
    if isinstance(value, dict):
        return {str(key): str(item) for key, item in value.items()}
    return str(value)


def built(described: dict) -> bytes:
    """Rebuilds a case of the suite from its description."""
    features = set(described["meta"]["variant"]["features"])
    kinds = {"chx": "CHUNK", "mx": "MESSAGE", "ax": "ATTACHMENT", "mdx": "METADATA"}
    indexes = IndexType.NONE
    for feature in features & set(kinds):
        indexes |= IndexType[kinds[feature]]
    output = io.BytesIO()
    writer = Writer(
        output,
        compression=CompressionType.NONE,
        index_types=indexes,
        repeat_channels="rch" in features,
        repeat_schemas="rsh" in features,
        use_chunking="ch" in features,
        use_statistics="st" in features,
        use_summary_offsets="sum" in features,
        enable_data_crcs=True,
    )
    for record in described["records"]:
        fields = dict(record["fields"])
        data = bytes(int(b) for b in fields.get("data", []))
        match record["type"]:
            case "Header":
                writer.start(fields["profile"], fields["library"])
            case "Schema":
                writer.register_schema(fields["name"], fields["encoding"], data)
            case "Channel":
                writer.register_channel(
                    fields["topic"],
                    fields["message_encoding"],
                    int(fields["schema_id"]),
                    fields["metadata"],
                )
            case "Message":
                writer.add_message(
                    int(fields["channel_id"]),
                    int(fields["log_time"]),
                    data,
                    int(fields["publish_time"]),
                    int(fields["sequence"]),
                )
            case "Attachment":
                writer.add_attachment(
                    int(fields["create_time"]),
                    int(fields["log_time"]),
                    fields["name"],
                    fields["media_type"],
                    data,
                )
            case "Metadata":
                writer.add_metadata(fields["name"], fields["metadata"])
            case "DataEnd":
                break
    writer.finish()
    return output.getvalue()
