"""Records that mcap's writer writes are read as written."""

import io
from itertools import takewhile

import pytest
from mcap import records as mcap
from mcap.writer import CompressionType, IndexType, Writer

from selfmodel.logs.log_file import verified_records

WRITES = {
    "Header": ("start", "profile", "library"),
    "Schema": ("register_schema", "name", "encoding", "data"),
    "Channel": ("register_channel", "topic", "message_encoding", "schema_id", "metadata"),
    "Message": ("add_message", "channel_id", "log_time", "data", "publish_time", "sequence"),
    "Attachment": ("add_attachment", "create_time", "log_time", "name", "media_type", "data"),
    "Metadata": ("add_metadata", "name", "metadata"),
}
"""Method of the writer by type of record, and the fields that it takes."""


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.parametrize("summary", [True, False])
@pytest.mark.parametrize("indexes", [IndexType.ALL, IndexType.NONE])
def test_records_of_every_kind_are_read_as_written(
    compression: CompressionType, indexes: IndexType, *, chunks: bool, summary: bool
):
    output = io.BytesIO()
    parts = (summary, summary, chunks, summary, summary)  # channels, schemas, statistics, offsets
    writer = Writer(output, 60, compression, indexes, *parts, enable_data_crcs=True)
    told = [mcap.Header("a library", ""), mcap.Schema(1, b"float64 x", "ros2msg", "type")]
    told += [mcap.Channel(k, "/ab"[k], "cdr", {}, 1) for k in (1, 2)]
    told += [mcap.Message(1 + k % 2, k, bytes([k] * k), k + 1, k) for k in range(9)]
    told += [mcap.Attachment(1, 2, "a", "text/plain", b"data"), mcap.Metadata("m", {"key": "text"})]
    for one in told:
        method, *fields = WRITES[type(one).__name__]
        getattr(writer, method)(*(getattr(one, name) for name in fields))
    writer.finish()

    found = [*verified_records(output.getvalue())]  # the whole file, its summary included
    read = takewhile(lambda one: not isinstance(one, mcap.DataEnd), found)
    read = [one for one in read if not isinstance(one, mcap.Chunk | mcap.MessageIndex)]

    assert sorted(map(repr, read)) == sorted(map(repr, told))  # a chunk ends after an attachment
