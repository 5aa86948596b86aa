"""Records of every kind that mcap's writer writes, in every form, are read as written."""

import io
from itertools import takewhile

import pytest
from mcap import records as mcap
from mcap.writer import CompressionType, IndexType, Writer

from selfmodel.logs.log_file import verified_records

WRITES = {
    mcap.Schema: ("register_schema", "name", "encoding", "data"),
    mcap.Channel: ("register_channel", "topic", "message_encoding", "schema_id", "metadata"),
    mcap.Message: ("add_message", "channel_id", "log_time", "data", "publish_time", "sequence"),
    mcap.Attachment: ("add_attachment", "create_time", "log_time", "name", "media_type", "data"),
    mcap.Metadata: ("add_metadata", "name", "metadata"),
}
"""Method of the writer by type of record, and the fields that it takes."""


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.parametrize("indexes", [*IndexType, IndexType.ALL])
@pytest.mark.parametrize("summary", ["channels", "schemas", "statistics", "offsets", "all"])
def test_records_of_every_kind_are_read_as_written(
    compression: CompressionType, indexes: IndexType, summary: str, *, chunks: bool
):
    output = io.BytesIO()
    repeated, schemas, statistics, offsets = (
        summary in (part, "all") for part in ("channels", "schemas", "statistics", "offsets")
    )
    options = (repeated, schemas, chunks, statistics, offsets)
    writer = Writer(output, 60, compression, indexes, *options, enable_data_crcs=True)
    writer.start("a profile", "a library")
    told = [mcap.Schema(1, b"float64 x", "ros2msg", "type")]
    told += [mcap.Channel(k, f"/{k}", "cdr", {}, schema) for k, schema in ((1, 1), (2, 0))]
    told += [mcap.Message(1 + k % 2, k, bytes([k] * k), k + 1, k) for k in range(9)]
    told += [mcap.Attachment(1, 2, "a", "text/plain", b"data"), mcap.Metadata("m", {"key": "text"})]
    for one in told:
        method, *names = WRITES[type(one)]
        getattr(writer, method)(*(getattr(one, name) for name in names))
    writer.finish()

    read = list(verified_records(output.getvalue()))

    data = takewhile(lambda one: not isinstance(one, mcap.DataEnd), read)
    found = [one for one in data if not isinstance(one, mcap.Chunk | mcap.MessageIndex)]
    # A chunk ends after an attachment.
    told.append(mcap.Header("a profile", "a library"))
    assert sorted(map(repr, found)) == sorted(map(repr, told))
    assert isinstance(read[-1], mcap.Footer)
