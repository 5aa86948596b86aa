"""Provenance of a log's messages: every batch is tied to its trial by a running digest.

A manifest, written before the first message, has the digests of the records and files of the
preamble; its own digest is the identity of the trial. A batch is the messages between two flushes.
Its last message, the seal, has the identity of the trial and the digest of the batch, which covers
the digest of the previous batch.
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256

from selfmodel.logs.mcap.framing import ContradictionError
from selfmodel.logs.records import DIGEST, MANIFEST, MAX_TEXT, with_digest

PROVENANCE = "/provenance"
SEAL_TYPE = "selfmodel_msgs/msg/Seal"

UNTIED = "an earlier version of selfmodel wrote it, which did not tie messages to their trial"

_LONGEST_NAME = 4 * MAX_TEXT
"""Maximum length of the trial's name in a seal, bytes."""


@dataclass(frozen=True)
class Batch:
    """Messages between two flushes, as columns in the order of the file.

    Attributes:
        keys: ``topic_key`` of each message.
        log_times: Log times, ns.
        publish_times: Publish times, ns.
        payloads: Bytes of the messages.
    """

    keys: Sequence[bytes]
    log_times: Sequence[int]
    publish_times: Sequence[int]
    payloads: Sequence[bytes]


@dataclass(frozen=True)
class Seal:
    """Last message of a batch.

    Attributes:
        trial: Name of the trial.
        index: Index of the batch in its log.
        messages: Number of messages in the batch, without the seal.
        identity: Identity of the trial, the SHA-256 of its manifest.
        previous: Digest of the previous batch; the identity for the first batch.
        digest: Digest of this batch.
    """

    trial: str
    index: int
    messages: int
    identity: bytes
    previous: bytes
    digest: bytes

    def payload(self, nanoseconds: int) -> bytes:
        """Returns the seal as a CDR message of ``SEAL_TYPE``."""
        name = self.trial.encode() + b"\0"
        header = struct.pack("<iII4s", *divmod(nanoseconds, 10**9), 1, b"")  # an empty frame
        text = struct.pack("<I", len(name)) + name + bytes(-len(name) % 4)
        counts = struct.pack("<II", self.index, self.messages)
        return b"".join(
            [_ENCAPSULATION, header, text, counts, self.identity, self.previous, self.digest]
        )


def seal_of(trial: str, identity: bytes, index: int, previous: bytes, batch: Batch) -> Seal:
    """Returns the seal of a batch."""
    count, name = len(batch.payloads), trial.encode()
    digest = sha256(
        b"".join(
            [
                identity,
                previous,
                struct.pack("<III", index, count, len(name)),
                name,
                *batch.keys,
                struct.pack(f"<{count}Q", *batch.log_times),
                struct.pack(f"<{count}Q", *batch.publish_times),
                struct.pack(f"<{count}Q", *map(len, batch.payloads)),
                *batch.payloads,
            ]
        )
    ).digest()
    return Seal(trial, index, count, identity, previous, digest)


def parse_seal(payload: bytes, nanoseconds: int) -> Seal:
    """Returns the seal in a message; the inverse of ``Seal.payload``.

    Raises:
        ContradictionError: The message has another layout.
    """
    wrong = ContradictionError("a seal of its messages has another layout than expected")
    if len(payload) < _NAME:
        raise wrong
    (length,) = struct.unpack_from("<I", payload, _NAME - 4)
    end = _NAME + length + -length % 4
    if not 1 <= length <= _LONGEST_NAME + 1 or len(payload) != end + _COUNTS + 3 * _DIGEST:
        raise wrong
    name = payload[_NAME : _NAME + length - 1].decode()
    index, messages = struct.unpack_from("<II", payload, end)
    digests = payload[end + _COUNTS :]
    parts = (digests[start : start + _DIGEST] for start in range(0, 3 * _DIGEST, _DIGEST))
    seal = Seal(name, index, messages, *parts)
    if seal.payload(nanoseconds) != payload:
        raise wrong
    return seal


def topic_key(topic: str, kind: str, encoding: str, schema: bytes) -> bytes:
    """Returns the digest of a topic, its type, encoding and definition, for use in a batch."""
    text = json.dumps([topic, kind, encoding, schema.decode("latin-1")])
    return sha256(text.encode()).digest()[:8]


def manifest(records: Mapping[str, str], files: Mapping[str, str]) -> dict[str, str]:
    """Returns the manifest of a preamble, as texts.

    Args:
        records: Digests of the metadata records by name.
        files: SHA-256 of the attachments by name.
    """
    return {
        **{f"{_RECORD}{name}": digest for name, digest in records.items()},
        **{f"{_FILE}{name}": digest for name, digest in files.items()},
    }


def manifest_parts(texts: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Returns the digests of records and of files in a manifest; the inverse of ``manifest``."""
    records, files = (
        {
            name.removeprefix(prefix): digest
            for name, digest in texts.items()
            if name.startswith(prefix)
        }
        for prefix in (_RECORD, _FILE)
    )
    return records, files


def identity_of(texts: Mapping[str, str]) -> bytes:
    """Returns the identity of the trial with this manifest."""
    return bytes.fromhex(with_digest(MANIFEST, texts)[DIGEST])


_RECORD, _FILE = "record ", "file "
_ENCAPSULATION = b"\0\1\0\0"
_NAME = 4 + 16 + 4
"""Offset of the trial's name in a seal, bytes: after encapsulation, header and length."""
_COUNTS = 8
_DIGEST = 32
