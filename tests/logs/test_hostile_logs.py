import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.records import Attachment, McapRecord, Metadata
from typer.testing import CliRunner

from selfmodel.cli.logs import app
from selfmodel.errors import InputError
from selfmodel.logs import LogError, read_log
from selfmodel.logs.mcap.framing import MAGIC, frames
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    MODEL_FILE,
    RESULT,
    SETTINGS_FILE,
    SOFTWARE,
    TRIAL,
    sha256,
    with_digest,
    without_digest,
)
from selfmodel.logs.salvage import salvage, salvageable_steps
from selfmodel.logs.verify import verify
from tests.logs.test_damage import rewritten


def says(record: str, **texts: str) -> Callable[[McapRecord], McapRecord]:
    """Changes what a record says, and its digest."""

    def change(found: McapRecord) -> McapRecord:
        if isinstance(found, Metadata) and found.name == record:
            bare = without_digest(record, found.metadata)
            return Metadata(record, with_digest(record, {**bare, **texts}))
        return found

    return change


def holds(name: str, data: bytes) -> Callable[[McapRecord], McapRecord]:
    """Changes an attachment."""

    def change(found: McapRecord) -> McapRecord:
        if isinstance(found, Attachment) and found.name == name:
            found.data = data
        return found

    return change


def attach(log: Path, name: str, field: str, data: bytes) -> None:
    """Changes an attachment and its SHA-256."""
    rewritten(log, holds(name, data))
    rewritten(log, says(TRIAL, **{field: sha256(data)}))


def put(log: Path, *more: bytes) -> None:
    """Writes a sound log again with more records before its end, and the checksums of all."""
    data = log.read_bytes()
    end = next(frame.offset for frame in frames(data) if frame.opcode == Opcode.DATA_END)
    data = data[:end] + b"".join(more)
    data += record(Opcode.DATA_END, struct.pack("<I", zlib.crc32(data)))
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, 0, 0)
    log.write_bytes(data + footer + struct.pack("<I", zlib.crc32(footer)) + MAGIC)


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(words: str) -> bytes:
    return struct.pack("<I", len(words.encode())) + words.encode()


def chunk(data: bytes, packing: str = "zstd", packed: bytes | None = None) -> bytes:
    if packed is None:
        packed = zstandard.ZstdCompressor().compress(data)
    head = struct.pack("<QQQI", 0, 0, len(data), zlib.crc32(data)) + text(packing)
    return record(Opcode.CHUNK, head + struct.pack("<Q", len(packed)) + packed)


def attachment(name: str, data: bytes) -> bytes:
    body = struct.pack("<QQ", 0, 0) + text(name) + text("x") + struct.pack("<Q", len(data)) + data
    return record(Opcode.ATTACHMENT, body + struct.pack("<I", zlib.crc32(body)))


def note(name: str, pairs: bytes = b"") -> bytes:
    return record(Opcode.METADATA, text(name) + struct.pack("<I", len(pairs)) + pairs)


def channel(number: int, topic: str) -> bytes:
    head = struct.pack("<HH", number, 1) + text(topic) + text("cdr") + bytes(4)
    return record(Opcode.CHANNEL, head)


def message(data: bytes = b"") -> bytes:
    return record(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0) + data)


@pytest.mark.parametrize(
    ("name", "said", "match"),
    [
        *[
            (TRIAL, {"control_timestep": step}, "control_timestep must be above 0 s")
            for step in ("1e-300", "5e-324", "1e300", "-0.01", "0", "nan", "inf", "1e-10")
        ],
        *[
            (TRIAL, {"seed": seed}, "its record selfmodel.trial is wrong")
            for seed in ("-1", str(2**63), "1.5", "nan", "9" * 900)
        ],
        (TRIAL, {"steps": str(10**15)}, "after 120 of 1000000000000000 steps"),
        (TRIAL, {"steps": "9" * 900}, "after 120 of 99999"),
        (TRIAL, {"steps": "9" * 5000}, "at most 1000 characters in steps"),
        (TRIAL, {"name": "x" * 10**7, "root": "y" * 10**6}, "1000 characters in name, root"),
        (TRIAL, {"stage": "../../etc/passwd"}, "stage must be one of"),
        (RESULT, {"steps": "9" * 5000}, "its record selfmodel.result is wrong"),
        (RESULT, {"steps": "-1"}, "after -1 of 120 steps"),
        (RESULT, {"displacement": "nan"}, "displacement is nan m in its result"),
        (RESULT, {"displacement": "1e999"}, "displacement is inf m in its result"),
    ],
)
def test_what_a_record_may_not_say_is_refused(
    log: Path, name: str, said: dict[str, str], match: str
):
    rewritten(log, says(name, **said))
    with pytest.raises(LogError, match=match) as caught:
        read_log(log)
    assert len(str(caught.value)) < 4000
    assert salvageable_steps(log) in (0, 120)


@pytest.mark.parametrize(
    "data",
    [
        b"[" * 10**5,
        b'{"a":' * 10**5,
        b'{"steps": ' + b"9" * 5000 + b"}",
        b'{"steps": ' + b"9" * 4000 + b"}",
        b'{"mutation": NaN}',
        b'{"mutation": Infinity}',
        b'{"mutation": -Infinity}',
        b'{"mutation": 1e400}',
        b'{"steps": -5}',
        b'{"steps": true}',
        b'{"genes": -99999999999999999999}',
        b'{"\\ud800": 1}',
        b"\xff\xfe\xff",
        b"null",
    ],
)
def test_settings_that_are_none_are_refused(log: Path, data: bytes):
    rewritten(log, holds(SETTINGS_FILE, data))
    with pytest.raises(LogError, match="an attachment cannot be read"):
        read_log(log)


def archive(genome: bytes, hidden: int = 3, more: dict[str, bytes] | None = None) -> bytes:
    """A controller's file with any bytes in the place of its weights."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, array in (
            ("kind", np.array("network")),
            ("sensors", np.array(["left_touch", "right_touch", "left_angle"])),
            ("motors", np.array(["left_hip_x", "left_hip_y", "right_hip_x", "right_hip_y"])),
            ("hidden", np.array(hidden)),
        ):
            member = io.BytesIO()
            np.save(member, array)
            packed.writestr(f"{name}.npy", member.getvalue())
        packed.writestr("genome.npy", genome)
        for name, data in (more or {}).items():
            packed.writestr(name, data)
    return file.getvalue()


def weights(shape: str, kind: str = "<f8", data: bytes = b"") -> bytes:
    header = f"{{'descr': {kind!r}, 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header.encode() + data


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (archive(weights("(10**12,)")), "expected a controller"),
        (archive(weights("(1000000000000,)")), "does not fit its size"),
        (archive(weights("(-1,)")), "expected a controller"),
        (archive(weights("(1,)", "|O", b"cposix\nsystem\n.")), "does not fit its size"),
        (archive(weights("(0,)"), hidden=10**9), "got a genome of shape"),
        (archive(bytes(10**8)), "unpacks to more than"),
        (archive(b"", more={"/etc/passwd": b"x"}), "it holds /etc/passwd"),
        (archive(b"", more={"../../x.npy": b"x"}), r"it holds \.\./\.\./x\.npy"),
        (b"PK\5\6" + bytes(18), "it holds nothing"),
    ],
)
def test_a_controller_that_is_none_is_refused(log: Path, data: bytes, match: str):
    attach(log, CONTROLLER_FILE, "controller_sha256", data)
    with pytest.raises(LogError, match=match):
        read_log(log)


def test_verify_looks_into_the_model(log: Path):
    attach(log, MODEL_FILE, "model_sha256", b'<mujoco><include file="/etc/passwd"/></mujoco>')
    read_log(log)  # nothing loads it
    with pytest.raises(LogError, match=r"has <include> \('/etc/passwd'\)"):
        verify(log)


def test_a_log_that_is_put_together_again_is_sound(log: Path):
    put(log, note("n"), chunk(b""))
    assert read_log(log).trial.behaviour.steps == 120


def test_names_are_harmless_in_a_terminal_and_as_paths(log: Path):
    evil = "../../etc/\x1b[2J\x1b]0;owned\x07\x9b31m\u202e"
    rewritten(log, says(TRIAL, robot=evil, name=evil))
    attached = Attachment(0, 0, evil, "x", b"x")
    rewritten(log, says(SOFTWARE, **{evil: evil}), more=[attached])
    put(log, note(evil), channel(90, evil))
    assert read_log(log).trial.robot == evil
    for command in ("info", "verify"):
        result = CliRunner().invoke(app, [command, str(log)])
        assert result.exit_code == 0
        assert all(char.isprintable() or char == "\n" for char in result.output)
    with pytest.raises(InputError, match="is valid"):
        salvage(log, log.with_name("new.mcap"))
    assert [path.name for path in log.parent.iterdir()] == ["trial.mcap"]


def test_a_seed_that_no_trial_can_have_is_refused_by_verify(log: Path):
    rewritten(log, says(TRIAL, seed="-5"))
    result = CliRunner().invoke(app, ["verify", str(log)])
    assert result.exit_code != 0
    assert "seed must be a whole number from 0 to" in result.output
