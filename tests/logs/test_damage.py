import io
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import pytest
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    McapRecord,
    Message,
    Metadata,
    Schema,
    Statistics,
)
from mcap.writer import Writer

from selfmodel.errors import InputError
from selfmodel.logs import (
    CorruptError,
    IncompleteError,
    LogError,
    NotMcapError,
    SchemaMismatchError,
    TruncatedError,
    UnsupportedError,
    read_log,
    reader as reader_module,
)
from selfmodel.logs.mcap.chain import batch_of
from selfmodel.logs.mcap.checksums import verified_records
from selfmodel.logs.mcap.contents import Contents, read_contents
from selfmodel.logs.mcap.provenance import (
    PROVENANCE,
    identity_of,
    manifest,
    seal_of,
    topic_key,
)
from selfmodel.logs.records import (
    DIGEST,
    HIDDEN,
    LAST_BATCH,
    MANIFEST,
    OWN,
    RESULT,
    TRIAL,
    sha256,
    with_digest,
    without_digest,
)

CASES = Path(__file__).parents[3] / "shared" / "samples" / "mcap-conformance"
Change = Callable[[McapRecord], McapRecord | None]


@pytest.mark.parametrize(
    ("spoil", "error", "match"),
    [
        (lambda _: b"", NotMcapError, "empty or too short"),
        (lambda d: d[:5], NotMcapError, "empty or too short"),
        (lambda _: b"no log at all", NotMcapError, "not an MCAP file"),
        (lambda d: d[:9000], TruncatedError, "ends too early; .* messages .* complete"),
        (lambda d: d[:-1], TruncatedError, "625 messages on 7 topics"),
        (lambda d: d + b"x", CorruptError, "bytes follow its end"),
        (lambda d: d[:-8] + bytes(8), CorruptError, "last bytes are damaged"),
    ],
)
def test_damage_is_called_by_its_name(
    log: Path, spoil: Callable[[bytes], bytes], error: type[LogError], match: str
):
    log.write_bytes(spoil(log.read_bytes()))
    with pytest.raises(error, match=match):
        read_log(log)


def test_a_file_that_is_not_there_is_said_so(tmp_path: Path):
    with pytest.raises(InputError, match=r"nothing\.mcap: expected a log file that can be read"):
        read_log(tmp_path / "nothing.mcap")
    with pytest.raises(InputError, match="Is a directory"):
        read_log(tmp_path)


def rewritten(path: Path, change: Change, *, more: Sequence[McapRecord] = ()) -> None:
    """Writes a sound file, with new seals, of what ``change`` makes of each record.

    Args:
        path: The file.
        change: Returns the record in the place of another, or None for nothing.
        more: Records before the others.
    """
    records = [*more, *verified_records(path.read_bytes())]
    records.sort(key=lambda record: isinstance(record, Metadata) and record.name == RESULT)
    output = io.BytesIO()
    writer = Writer(output, enable_data_crcs=True)
    writer.start("ros2")
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    tie = Tie()
    for original in records:
        record: McapRecord | None = change(original)
        match type(record).__name__, record:
            case "Schema", schema if schema.id not in schemas:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                schemas[schema.id] = number
                tie.schemas[number] = schema
            case "Channel", channel if channel.id not in channels:
                number = schemas[channel.schema_id]
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, number
                )
                tie.channel(channel, tie.schemas[number])
            case "Metadata", metadata:
                writer.add_metadata(metadata.name, tie.record(metadata))
            case "Attachment", attached:
                tie.files[attached.name] = sha256(attached.data)
                writer.add_attachment(0, 0, attached.name, attached.media_type, attached.data)
            case "Message", told:
                data = tie.message(told)
                writer.add_message(
                    channels[told.channel_id], told.log_time, data, told.publish_time
                )
    writer.finish()
    path.write_bytes(output.getvalue())


class Tie:
    """What ties the records of a file to its trial, computed anew."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.files: dict[str, str] = {}
        self._records: dict[str, str] = {}
        self._keys: dict[int, bytes] = {}
        self._seals = -1
        self._batch: list[Message] = []
        self._index = 0
        self._identity = self._last = b""

    def channel(self, channel: Channel, schema: Schema) -> None:
        """Adds a channel."""
        self._keys[channel.id] = topic_key(
            channel.topic, schema.name, channel.message_encoding, schema.data
        )
        if channel.topic == PROVENANCE:
            self._seals = channel.id

    def record(self, record: Metadata) -> Mapping[str, str]:
        """Adds a metadata record, and returns its texts."""
        texts = record.metadata
        if record.name == MANIFEST:
            listed = manifest(self._records, self.files)
            self._identity = self._last = identity_of(listed)
            return with_digest(MANIFEST, listed)
        if record.name == RESULT:
            bare = {key: text for key, text in texts.items() if key != DIGEST}
            return with_digest(RESULT, {**bare, LAST_BATCH: self._last.hex()})
        if record.name.startswith(OWN):
            self._records[record.name] = texts[DIGEST]
        return texts

    def message(self, message: Message) -> bytes:
        """Adds a message, and returns its content."""
        if message.channel_id != self._seals:
            self._batch.append(message)
            return message.data
        batch = batch_of(self._batch, self._keys)
        seal = seal_of("00-before", self._identity, self._index, self._last, batch)
        self._batch, self._index, self._last = [], self._index + 1, seal.digest
        return seal.payload(message.log_time)


def metadata(name: str, **texts: str):
    def change(record: McapRecord) -> McapRecord:
        if isinstance(record, Metadata) and record.name == name:
            bare = without_digest(name, record.metadata)
            return Metadata(name, with_digest(name, {**bare, **texts}))
        return record

    return change


def attachment(name: str, old: bytes, new: bytes):
    def change(record: McapRecord) -> McapRecord:
        if isinstance(record, Attachment) and record.name == name:
            assert old in record.data
            record.data = record.data.replace(old, new)
        return record

    return change


def without(kind: type[McapRecord], name: str):
    return lambda r: None if isinstance(r, kind) and r.name == name else r


def later(record: McapRecord) -> McapRecord:
    if isinstance(record, Message) and record.log_time == 50 * 10**7:
        record.log_time += 1
    return record


def forged(record: McapRecord) -> McapRecord:
    if isinstance(record, Metadata) and record.name == TRIAL:
        return Metadata(TRIAL, {**record.metadata, "seed": "8"})
    return record


def stamped(record: McapRecord) -> McapRecord:
    if isinstance(record, Message) and record.log_time == 50 * 10**7:
        record.data = record.data[:4] + b"\1" + record.data[5:]  # a second later
    return record


def missing(record: McapRecord) -> McapRecord | None:
    return None if isinstance(record, Message) and record.log_time == 50 * 10**7 else record


def renamed(record: McapRecord) -> McapRecord:
    if isinstance(record, Message):
        record.data = record.data.replace(b"left_touch", b"left_torch")
    return record


def moved(record: McapRecord) -> McapRecord:
    if type(record).__name__ == "Channel" and record.topic == "/odom":
        record.topic = "/odometry"
    return record


def retyped(record: McapRecord) -> McapRecord:
    if type(record).__name__ == "Schema" and record.name == "nav_msgs/msg/Odometry":
        record.name = "nav_msgs/msg/Path"
    return record


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        (without(Metadata, TRIAL), SchemaMismatchError, r"no record selfmodel\.trial"),
        (without(Metadata, RESULT), IncompleteError, "did not finish; 625 messages"),
        (metadata(TRIAL, format="3"), UnsupportedError, "expected format 1 or 2, got '3'"),
        (metadata(TRIAL, format="2"), SchemaMismatchError, "no messages on /timing"),
        (metadata(TRIAL, stage="later"), SchemaMismatchError, "stage must be one of before"),
        (metadata(TRIAL, steps="many"), SchemaMismatchError, "invalid literal"),
        (metadata(TRIAL, steps=str(10**15)), IncompleteError, "after 120 of 1000000000000000"),
        (metadata(TRIAL, control_timestep="0.02"), SchemaMismatchError, "times on /joint_states"),
        (metadata(TRIAL, control_timestep="nan"), SchemaMismatchError, "must be above 0 s"),
        (metadata(TRIAL, root="hip"), SchemaMismatchError, "on /odom: message 0 has"),
        (metadata(RESULT, status="lost"), UnsupportedError, "the trial is 'lost'"),
        (
            metadata(RESULT, status="interrupted", steps="119"),
            CorruptError,
            "120 messages on /joint_states for 119 steps",
        ),
        (metadata(RESULT, steps="119"), IncompleteError, "after 119 of 120 steps"),
        (
            metadata(RESULT, displacement="1.5"),
            CorruptError,
            r"displacement is 1\.5 m in its result",
        ),
        (without(Attachment, "model.xml"), SchemaMismatchError, r"no attachment model\.xml"),
        (
            attachment("model.xml", b"0.6", b"0.7"),
            CorruptError,
            r"model\.xml is not the file of the trial",
        ),
        (attachment("controller.npz", b"<f8", b"<f4"), CorruptError, r"controller\.npz is not"),
        (
            attachment("settings.json", b"steps", b"stops"),
            SchemaMismatchError,
            "no setting 'stops'",
        ),
        (attachment("settings.json", b"1000", b"true"), SchemaMismatchError, "must be a number"),
        (attachment("settings.json", b"{", b"["), SchemaMismatchError, "cannot be read"),
        (later, SchemaMismatchError, "times on /joint_states are not the multiples"),
        (forged, CorruptError, r"digest of the record selfmodel\.trial is missing or wrong"),
        (stamped, SchemaMismatchError, "times on /joint_states are not the multiples"),
        (missing, CorruptError, "119 messages on /joint_states for 120 steps"),
        (renamed, SchemaMismatchError, "its controller is for the sensors"),
        (moved, SchemaMismatchError, "no messages on /odom"),
        (retyped, SchemaMismatchError, "expected nav_msgs/msg/Odometry in cdr on /odom"),
    ],
)
def test_a_sound_file_that_contradicts_itself_is_refused(
    log: Path, change: Change, error: type[LogError], match: str
):
    rewritten(log, lambda record: record)
    read_log(log)  # rewriting alone harms nothing
    rewritten(log, change)
    with pytest.raises(error, match=match):
        read_log(log)


def test_the_hidden_record_may_say_anything_or_be_missing(log: Path):
    before = read_log(log).trial.behaviour
    for change in (
        metadata(HIDDEN, truth="no notation at all", more="text"),
        without(Metadata, HIDDEN),
    ):
        rewritten(log, change)
        after = read_log(log).trial.behaviour
        assert all(after[signal].tobytes() == before[signal].tobytes() for signal in after.signals)


def test_the_hidden_record_does_not_reach_the_reader(log: Path, monkeypatch: pytest.MonkeyPatch):
    reached = []

    def watched(path: Path, unread: Collection[str]) -> Contents:
        contents = read_contents(path, unread)
        reached.append(HIDDEN in contents.metadata)
        return contents

    monkeypatch.setattr(reader_module, "read_contents", watched)
    read_log(log)
    assert reached == [False]


def test_a_file_without_checksums_is_refused(log: Path):
    output = io.BytesIO()
    writer = Writer(output)
    writer.start("ros2")
    writer.finish()
    log.write_bytes(output.getvalue())
    with pytest.raises(UnsupportedError, match=r"no checksum over its data: .* logs import"):
        read_log(log)


@pytest.mark.parametrize(
    ("count", "match"),
    [
        ("message_count", "629 messages, its records 630"),
        ("attachment_count", "2 attachments, its records 3"),
        ("metadata_count", "4 metadata records, its records 5"),
        ("schema_count", "6 schemas, its records 7"),
        ("channel_count", "7 channels, its records 8"),
    ],
)
def test_counts_that_do_not_agree_are_refused(
    log: Path, monkeypatch: pytest.MonkeyPatch, count: str, match: str
):
    honest = Statistics.write

    def wrong(self: Statistics, stream: RecordBuilder) -> None:
        setattr(self, count, getattr(self, count) - 1)
        honest(self, stream)

    monkeypatch.setattr(Statistics, "write", wrong)
    rewritten(log, lambda record: record)
    with pytest.raises(CorruptError, match=f"its statistics have {match}"):
        read_log(log)


def test_a_chunk_that_would_fill_the_memory_is_refused(log: Path, monkeypatch: pytest.MonkeyPatch):
    honest = Chunk.write

    def boastful(self: Chunk, stream: RecordBuilder) -> None:
        self.uncompressed_size = 2**40
        honest(self, stream)

    monkeypatch.setattr(Chunk, "write", boastful)
    rewritten(log, lambda record: record)
    with pytest.raises(CorruptError, match="a chunk claims 1099511627776 bytes"):
        read_log(log)
