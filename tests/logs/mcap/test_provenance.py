"""Promises of provenance: a log is of one trial, and its digest covers all that is read of it."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given, strategies as st
from mcap.records import Attachment, McapRecord, Message, Metadata, Schema
from mcap.writer import CompressionType
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from selfmodel.logs import CorruptError, SchemaMismatchError, read_log, read_truth
from selfmodel.logs.mcap.checksums import verified_records
from selfmodel.logs.mcap.contents import read_contents
from selfmodel.logs.mcap.framing import ContradictionError
from selfmodel.logs.mcap.provenance import SEAL_TYPE, Seal, parse_seal
from selfmodel.logs.messages.schemas import schema_text
from selfmodel.logs.records import HIDDEN, RESULT, SETTINGS_FILE, SOFTWARE, TRIAL, TrialHeader
from selfmodel.logs.verify import verify
from selfmodel.logs.writing.writer import write_trial
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from tests.fuzz.mcap_file import of_records, read_file, written
from tests.logs.conftest import STEPS, made_up, plan_of
from tests.logs.test_damage import metadata, rewritten, without

COUNTS = st.integers(0, 2**32 - 1)
DIGESTS = st.binary(min_size=32, max_size=32)
SEALS = st.builds(Seal, st.text(max_size=50), COUNTS, COUNTS, DIGESTS, DIGESTS, DIGESTS)
TIMES = st.integers(0, 2**31 * 10**9 - 1)
OLD = Path(__file__).parents[2] / "data" / "logs-0.1" / "trials" / "kinds.mcap"

Records = list[McapRecord]


@given(seal=SEALS, time=TIMES)
def test_a_seal_comes_back_as_it_was(seal: Seal, time: int):
    assert parse_seal(seal.payload(time), time) == seal


@given(seal=SEALS, time=TIMES)
def test_a_seal_is_a_message_of_its_definition(seal: Seal, time: int):
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(schema_text(SEAL_TYPE).partition("=" * 80)[0], SEAL_TYPE))
    name = seal.trial.replace("\0", "")
    read = store.deserialize_cdr(Seal(name, *_numbers(seal)).payload(time), SEAL_TYPE)

    assert (read.trial, read.index, read.messages) == (name, seal.index, seal.messages)
    assert bytes(read.digest) == seal.digest
    assert read.header.stamp.sec * 10**9 + read.header.stamp.nanosec == time


def _numbers(seal: Seal) -> tuple[int, int, bytes, bytes, bytes]:
    return seal.index, seal.messages, seal.identity, seal.previous, seal.digest


@given(data=st.binary(max_size=200), time=TIMES)
def test_other_bytes_are_no_seal(data: bytes, time: int):
    with pytest.raises((ContradictionError, ValueError)):
        parse_seal(data, time)


@pytest.fixture
def other(biped: Robot, tmp_path: Path) -> Path:
    """A log of another trial of the robot, with the same plan and another fault."""
    path = tmp_path / "other" / "trial.mcap"
    path.parent.mkdir()
    header = TrialHeader(Settings(generations=7), hidden="sensor:left_touch")
    plan = plan_of(biped, STEPS, "01-after")
    return write_trial(path, biped, plan, made_up(biped, STEPS, seed=1), header)


def from_step(first: int, last: int) -> Callable[[McapRecord], bool]:
    """Returns whether a record is a message of these steps; a flush ends at 50 and at 100."""
    return lambda record: (
        isinstance(record, Message) and first * 10**7 <= record.log_time < last * 10**7
    )


def second_half(one: Records, other: Records) -> Records:
    late = from_step(51, STEPS)
    return [record for record in one if not late(record)] + list(filter(late, other))


def swapped(one: Records, other: Records) -> Records:
    batch = from_step(51, 101)
    foreign = filter(batch, other)
    return [next(foreign) if batch(record) else record for record in one]


def one_message(one: Records, other: Records) -> Records:
    number = next(number for number, record in enumerate(one) if from_step(70, 71)(record))
    return [*one[:number], other[number], *one[number + 1 :]]


def doubled(one: Records, _: Records) -> Records:
    return one + list(filter(from_step(51, 101), one))


def reordered(one: Records, _: Records) -> Records:
    early, late = (list(filter(from_step(*steps), one)) for steps in ((1, 51), (51, 101)))
    return [r for r in one if not from_step(1, 101)(r)] + late + early


def shortened(one: Records, _: Records) -> Records:
    return [record for record in one if not from_step(101, STEPS)(record)]


def of_the_other(kind: type[McapRecord], name: str) -> Callable[[Records, Records], Records]:
    def splice(one: Records, other: Records) -> Records:
        foreign = next(r for r in other if isinstance(r, kind) and r.name == name)
        return [foreign if isinstance(r, kind) and r.name == name else r for r in one]

    return splice


def more_files(one: Records, _: Records) -> Records:
    return [Attachment(0, 0, "mesh.obj", "", b"v 0 0 0"), *one]


@pytest.mark.parametrize(
    "splice",
    [
        *(second_half, swapped, one_message, doubled, reordered, shortened, more_files),
        of_the_other(Metadata, TRIAL),
        of_the_other(Metadata, RESULT),
        of_the_other(Attachment, SETTINGS_FILE),
    ],
)
def test_parts_of_two_trials_are_no_log_even_with_right_checksums(
    log: Path, other: Path, splice: Callable[[Records, Records], Records]
):
    one, two = (list(verified_records(path.read_bytes())) for path in (log, other))
    log.write_bytes(written(of_records(one), CompressionType.ZSTD, 2**20))
    read_log(log)  # writing the same records again harms nothing
    log.write_bytes(written(of_records(splice(one, two)), CompressionType.ZSTD, 2**20))
    with pytest.raises(CorruptError, match=r"batch|of another trial|not that of the trial"):
        read_log(log)


@pytest.mark.parametrize("size", [8 * 2**10, 2**20, None])
def test_a_log_in_another_packing_has_the_same_digest(log: Path, size: int | None):
    digest = read_contents(log).digest
    assert len(digest) == 64
    log.write_bytes(written(read_file(log.read_bytes()), CompressionType.LZ4, size))
    assert verify(log).digest == digest


@pytest.mark.parametrize(
    "change",
    [
        metadata(TRIAL, seed="8"),
        metadata(SOFTWARE, numpy="1"),
        metadata(HIDDEN, truth="sensor:left_touch"),
        metadata(RESULT, reason="none"),
        lambda r: Schema(r.id, r.data + b"\n", *_rest(r)) if _is_string(r) else r,
    ],
)
def test_the_digest_of_a_log_covers_each_record(log: Path, change: Callable):
    digest = read_contents(log).digest
    rewritten(log, change)
    assert read_contents(log).digest != digest


def _is_string(record: McapRecord) -> bool:
    return isinstance(record, Schema) and record.name == "std_msgs/msg/String"


def _rest(schema: Schema) -> tuple[str, str]:
    return schema.encoding, schema.name


def test_a_log_is_the_expected_one_or_verification_fails(log: Path, other: Path):
    digest = verify(log).digest
    assert verify(log, digest).log.trial.behaviour.steps == STEPS
    with pytest.raises(CorruptError, match=f"expected the log with the digest {digest}; .* has"):
        verify(other, digest)
    with pytest.raises(CorruptError, match="this log has no digest: an earlier version"):
        verify(OLD, digest)


def test_a_log_of_an_earlier_version_has_no_digest():
    assert verify(OLD).digest == ""
    assert read_log(OLD).trial.behaviour.steps == 60


@pytest.mark.parametrize("path", [OLD, None])
def test_a_changed_definition_is_not_read_as_ours(log: Path, tmp_path: Path, path: Path | None):
    copy = tmp_path / "copy.mcap"
    copy.write_bytes((path or log).read_bytes())

    def swapped_fields(record: McapRecord) -> McapRecord:
        if isinstance(record, Schema) and record.name == "sensor_msgs/msg/JointState":
            record.data = record.data.replace(
                b"float64[] position\nfloat64[] velocity", b"float64[] velocity\nfloat64[] position"
            )
        return record

    if path is None:
        rewritten(copy, swapped_fields)
    else:
        records = map(swapped_fields, verified_records(copy.read_bytes()))
        copy.write_bytes(written(of_records(records), CompressionType.ZSTD, 2**20))
    with pytest.raises(SchemaMismatchError, match="its definition of sensor_msgs/msg/JointS"):
        read_log(copy)


def test_the_truth_may_be_removed_but_not_replaced(log: Path, other: Path):
    whole = list(verified_records(log.read_bytes()))
    blind = [record for record in whole if without(Metadata, HIDDEN)(record)]
    log.write_bytes(written(of_records(blind), CompressionType.ZSTD, 2**20))
    digest = verify(log).digest
    assert read_truth(log) is None

    splice = of_the_other(Metadata, HIDDEN)
    records = splice(whole, list(verified_records(other.read_bytes())))
    log.write_bytes(written(of_records(records), CompressionType.ZSTD, 2**20))
    for read in (verify, read_truth):
        with pytest.raises(CorruptError, match=r"the record selfmodel\.hidden is not that of"):
            read(log)
    log.write_bytes(written(of_records(whole), CompressionType.ZSTD, 2**20))
    assert verify(log).digest == digest


def test_two_trials_with_equal_plans_are_told_apart_unless_they_repeat_exactly(
    biped: Robot, tmp_path: Path
):
    digests = {}
    for hidden in ("intact", None):
        for name in ("a", "b"):
            path = tmp_path / f"{name}-{hidden}.mcap"
            header = TrialHeader(Settings(), hidden=hidden)
            write_trial(path, biped, plan_of(biped, 3), made_up(biped, 3), header)
            digests[name, hidden] = read_contents(path).digest
    assert digests["a", "intact"] == digests["b", "intact"]
    assert digests["a", None] != digests["b", None]
