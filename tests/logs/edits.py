"""Sound files with other content: every checksum and digest is that of the changed records."""

import io
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.writer import Writer

from selfmodel.logs.log_file import verified_records
from selfmodel.logs.records import TRIAL, sha256, with_digest, without_digest

Change = Callable[[McapRecord], McapRecord | None]


def rewritten(path: Path, change: Change, *, more: Sequence[McapRecord] = ()) -> None:
    """Writes a log again.

    Args:
        path: The file.
        change: Returns the record in the place of another, or None for nothing.
        more: Records before the others.
    """
    output = io.BytesIO()
    writer = Writer(output, enable_data_crcs=True)
    writer.start("ros2")
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for original in [*more, *verified_records(path.read_bytes())]:
        match change(original):
            case Schema() as schema if schema.id not in schemas:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                schemas[schema.id] = number
            case Channel() as channel if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas.get(channel.schema_id, 0)
                )
            case Metadata() as metadata:
                writer.add_metadata(metadata.name, metadata.metadata)
            case Attachment() as file:
                writer.add_attachment(0, 0, file.name, file.media_type, file.data)
            case Message() as message:
                writer.add_message(
                    channels[message.channel_id],
                    message.log_time,
                    message.data,
                    message.publish_time,
                )
    writer.finish()
    path.write_bytes(output.getvalue())


def altered(data: bytes, **replaced: object) -> bytes:
    """Returns an archive with some of its arrays replaced, None for left out."""
    arrays = {**np.load(io.BytesIO(data), allow_pickle=False), **replaced}
    file = io.BytesIO()
    np.savez(file, **{name: array for name, array in arrays.items() if array is not None})
    return file.getvalue()


def says(name: str, /, **texts: str) -> Change:
    """Changes what a record of selfmodel says."""

    def change(record: McapRecord) -> McapRecord:
        if isinstance(record, Metadata) and record.name == name:
            bare = without_digest(name, record.metadata)
            return Metadata(name=name, metadata=with_digest(name, {**bare, **texts}))
        return record

    return change


def holds(name: str, change: Callable[[bytes], bytes]) -> Change:
    """Changes an attachment, or the text of a schema."""

    def changed(record: McapRecord) -> McapRecord:
        if isinstance(record, Attachment | Schema) and record.name == name:
            record.data = change(record.data)
        return record

    return changed


def attach(log: Path, name: str, field: str, data: bytes) -> None:
    """Changes an attachment and the SHA-256 of it in the record of the trial."""
    rewritten(log, holds(name, lambda _: data))
    rewritten(log, says(TRIAL, **{field: sha256(data)}))


def without(kind: type[McapRecord], name: str) -> Change:
    """Leaves a record out."""
    return lambda record: (
        None if isinstance(record, kind) and getattr(record, "name", "") == name else record
    )
