"""An MCAP file as a list of records, which can be changed and written with right checksums."""

import dataclasses
import io
from collections.abc import Iterable
from dataclasses import dataclass, field

from mcap.records import Attachment, Channel, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

COMPRESSIONS = (CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE)

Item = Message | Metadata | Attachment
"""Record whose place in the file matters."""


@dataclass
class McapFile:
    """Records of a file.

    Attributes:
        profile: Profile of the file.
        schemas: Schemas, by id.
        channels: Channels, by id.
        items: Messages, metadata records and attachments, in order.
    """

    profile: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    items: list[Item] = field(default_factory=list)

    def copy(self) -> "McapFile":
        """Returns a copy whose records can be replaced."""
        return McapFile(self.profile, dict(self.schemas), dict(self.channels), list(self.items))


def read_file(data: bytes) -> McapFile:
    """Returns the records of an undamaged file."""
    return of_records(StreamReader(io.BytesIO(data)).records)


def of_records(records: Iterable[McapRecord]) -> McapFile:
    """Returns records as a file; those of the summary, which repeat others, are left out."""
    found = McapFile()
    for record in records:
        match record:
            case Header():
                found.profile = record.profile
            case Schema():
                found.schemas.setdefault(record.id, record)
            case Channel():
                found.channels.setdefault(record.id, record)
            case Message() | Metadata() | Attachment():
                found.items.append(record)
    return found


def written(
    file: McapFile,
    compression: CompressionType = CompressionType.ZSTD,
    chunk_size: int | None = 256 * 2**10,
    *,
    checksums: bool = True,
) -> bytes:
    """Returns the bytes of a file; without a chunk size, without chunks.

    A message of an unknown channel is written as it is.
    """
    output = io.BytesIO()
    writer = Writer(
        output,
        chunk_size=chunk_size or 1,
        compression=compression,
        use_chunking=chunk_size is not None,
        enable_crcs=checksums,
        enable_data_crcs=checksums,
    )
    writer.start(file.profile)
    schemas = {
        number: writer.register_schema(schema.name, schema.encoding, schema.data)
        for number, schema in file.schemas.items()
    }
    channels: dict[int, int] = {}
    for item in file.items:
        match item:
            case Metadata():
                writer.add_metadata(item.name, item.metadata)
            case Attachment():
                writer.add_attachment(
                    item.create_time, item.log_time, item.name, item.media_type, item.data
                )
            case Message(channel_id=number) if number not in channels:
                channel = file.channels.get(number)
                if channel is not None:
                    schema = schemas.get(channel.schema_id, 0)
                    channels[number] = writer.register_channel(
                        channel.topic, channel.message_encoding, schema, channel.metadata
                    )
                _write(writer, channels.get(number, number), item)
            case Message(channel_id=number):
                _write(writer, channels[number], item)
    writer.finish()
    return output.getvalue()


def _write(writer: Writer, channel: int, message: Message) -> None:
    writer.add_message(
        channel, message.log_time, message.data, message.publish_time, message.sequence
    )


def replaced(item: Item, **fields: object) -> Item:
    """Returns a record with other fields."""
    return dataclasses.replace(item, **fields)
