"""The cases of the MCAP conformance suite that can be rebuilt from their descriptions, all read."""

import dataclasses
import hashlib
import io
import json
from pathlib import Path
from typing import Any

import pytest
from mcap.records import Chunk, McapRecord, MessageIndex
from mcap.writer import CompressionType, IndexType, Writer

from selfmodel.logs.mcap.checksums import verified_records

CASES = Path(__file__).parents[4] / "shared" / "samples" / "mcap-conformance"
UNTOLD = (Chunk, MessageIndex)
"""What the suite leaves out of its descriptions: a chunk is told by what is in it."""


@pytest.mark.parametrize("case", sorted(CASES.glob("*/*.json")), ids=lambda path: path.stem)
def test_the_strict_pass_reads_a_case_as_its_description_says(case: Path):
    described = json.loads(case.read_text())
    data = built(described)
    assert hashlib.sha256(data).hexdigest() in (CASES / "sha256.txt").read_text()

    read = [
        as_described(record) for record in verified_records(data) if not isinstance(record, UNTOLD)
    ]

    assert read == [(told["type"], dict(told["fields"])) for told in described["records"]]


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
