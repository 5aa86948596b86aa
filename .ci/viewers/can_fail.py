"""Proves that the proofs can fail: each tool must complain of the damage that it is there for.

Rerun tells of an undecodable message only in what it logs, and any tool's next version may say
things otherwise than ``check.py`` expects: without this, that would look like a sound log.

Usage: python .ci/viewers/can_fail.py SOUND.mcap
"""

import io
import sys
import tempfile
from pathlib import Path

from check import PROOFS, ProofError
from mcap.reader import make_reader
from mcap.writer import Writer

JOINTS = "/joint_states"
GARBAGE = b"\x00\x01\x00\x00" + b"\xa5" * 80
"""Begins as a message does."""


def main(log: Path) -> None:
    """Exits with 1 where a tool has nothing to say of a damaged log."""
    sound = log.read_bytes()
    middle = len(sound) // 2
    flipped = sound[:middle] + bytes([sound[middle] ^ 1]) + sound[middle + 1 :]
    damaged = {
        "a flipped bit": (flipped, ["foxglove", "pymcap-cli", "rerun"]),
        "a cut file": (sound[:middle], ["foxglove", "pymcap-cli", "rerun"]),
        # The file is as the specification wants it, so pymcap-cli has nothing to say.
        "another topic": (rewritten(sound, topic="/joints"), ["foxglove", "rerun"]),
        "an undecodable message": (rewritten(sound, payload=GARBAGE), ["foxglove", "rerun"]),
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.mcap"
        for damage, (data, tools) in damaged.items():
            path.write_bytes(data)
            silent = [tool for tool in tools if not complains(tool, path)]
            if silent:
                sys.exit(f"{damage}: expected a complaint of {tools}, got none of {silent}")
            sys.stdout.write(f"{damage}: {', '.join(tools)} complain\n")


def complains(tool: str, log: Path) -> bool:
    """Returns whether a tool's proof fails."""
    try:
        PROOFS[tool](log)
    except ProofError:
        return True
    return False


def rewritten(sound: bytes, *, topic: str = JOINTS, payload: bytes | None = None) -> bytes:
    """Returns a whole file with another name for the joints' topic, or one bad message on it."""
    stream = io.BytesIO()
    writer = Writer(stream, enable_data_crcs=True)
    writer.start(profile="ros2")
    reader = make_reader(io.BytesIO(sound))
    for attachment in reader.iter_attachments():
        writer.add_attachment(
            attachment.create_time,
            attachment.log_time,
            attachment.name,
            attachment.media_type,
            attachment.data,
        )
    for record in reader.iter_metadata():
        writer.add_metadata(record.name, record.metadata)
    channels: dict[str, int] = {}
    for schema, channel, message in reader.iter_messages():
        if schema is None:
            raise ValueError(f"expected a schema for {channel.topic}, got none")
        if channel.topic not in channels:
            name = topic if channel.topic == JOINTS else channel.topic
            definition = writer.register_schema(schema.name, schema.encoding, schema.data)
            channels[channel.topic] = writer.register_channel(name, "cdr", definition)
        bad = payload if (channel.topic, message.sequence) == (JOINTS, 500) else None
        writer.add_message(
            channels[channel.topic],
            message.log_time,
            bad or message.data,
            message.publish_time,
            message.sequence,
        )
    writer.finish()
    return stream.getvalue()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
