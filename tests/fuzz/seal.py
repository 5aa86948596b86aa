"""Seal of a changed log: digests, displacement, provenance and checksums are made right.

A sealed log passes every check that finds damage, so that the code behind these checks runs on
content that selfmodel would not write.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
from mcap.records import Attachment, Message, Metadata

from selfmodel.logs.mcap.chain import batch_of
from selfmodel.logs.mcap.provenance import (
    PROVENANCE,
    SEAL_TYPE,
    identity_of,
    manifest,
    seal_of,
    topic_key,
)
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    DIGEST,
    LAST_BATCH,
    MANIFEST,
    MODEL_FILE,
    RESULT,
    TRIAL,
    sha256,
    with_digest,
)
from tests.fuzz.mcap_file import McapFile

BASE = "/odom"

MAX_STAMP = 2**31 * 10**9
"""Bound of a time stamp in a message, ns."""


def seal(file: McapFile) -> None:
    """Corrects digests, the displacement, and the provenance of all batches, in place.

    A log without a nonce is one of an earlier version, whose messages are not tied to their trial.
    """
    files = {item.name: sha256(item.data) for item in _all(file, Attachment)}
    displacement = _displacement(file)
    records: dict[str, str] = {}
    for index, item in enumerate(file.items):
        if isinstance(item, Metadata) and item.name not in (MANIFEST, RESULT):
            file.items[index] = _record(item, _corrected(item, files))
            records[item.name] = file.items[index].metadata[DIGEST]
    listed = manifest(records, files)
    last = _seal_batches(file, identity_of(listed))
    for index, item in enumerate(file.items):
        if not isinstance(item, Metadata):
            continue
        if item.name == MANIFEST:
            file.items[index] = _record(item, listed)
        elif item.name == RESULT:
            texts = _without_digest(item)
            if displacement is not None and "displacement" in texts:
                texts["displacement"] = displacement
            if LAST_BATCH in texts:
                texts[LAST_BATCH] = last
            file.items[index] = _record(item, texts)


def _without_digest(item: Metadata) -> dict[str, str]:
    return {key: value for key, value in item.metadata.items() if key != DIGEST}


def _record(item: Metadata, texts: Mapping[str, str]) -> Metadata:
    return Metadata(item.name, with_digest(item.name, texts))


def _corrected(item: Metadata, files: Mapping[str, str]) -> dict[str, str]:
    """Texts of a record; in that of the trial, with the digests of its files."""
    texts = _without_digest(item)
    if item.name == TRIAL:
        for key, name in (("model_sha256", MODEL_FILE), ("controller_sha256", CONTROLLER_FILE)):
            if texts.get(key) and name in files:
                texts[key] = files[name]
    return texts


def _seal_batches(file: McapFile, identity: bytes) -> str:
    """Writes the seal of each batch anew, and returns the digest of the last, in hexadecimal."""
    keys, seals = {}, set()
    for number, channel in file.channels.items():
        schema = file.schemas.get(channel.schema_id)
        kind, text = (schema.name, schema.data) if schema else ("", b"")
        keys[number] = topic_key(channel.topic, kind, channel.message_encoding, text)
        if (channel.topic, kind) == (PROVENANCE, SEAL_TYPE):
            seals.add(number)
    previous, count, digest = identity, 0, ""
    pending: list[Message] = []
    for index, item in enumerate(file.items):
        if not isinstance(item, Message):
            continue
        if item.channel_id not in seals:
            pending += [item] if item.channel_id in keys else []
            continue
        made = seal_of("trial", identity, count, previous, batch_of(pending, keys))
        payload = made.payload(item.log_time % MAX_STAMP)
        file.items[index] = dataclasses.replace(item, data=payload)
        previous, count, digest = made.digest, count + 1, made.digest.hex()
        pending = []
    return digest


def _displacement(file: McapFile) -> str | None:
    """The displacement in the messages on ``/odom``, as text; None without such messages."""
    channels = {number for number, channel in file.channels.items() if channel.topic == BASE}
    rows = [item.data for item in _all(file, Message) if item.channel_id in channels]
    if not rows or len({len(row) for row in rows}) > 1:
        return None
    offset = first_float(rows[0])
    if offset + 8 > len(rows[0]):
        return None
    start, end = (np.frombuffer(row, "<f8", 1, offset)[0] for row in (rows[0], rows[-1]))
    with np.errstate(all="ignore"):
        return repr(float(end - start))


def first_float(payload: bytes) -> int:
    """Returns the offset of the first number of an Odometry: after a stamp and two names."""
    at = 4 + 8
    for _ in range(2):
        at += -(at - 4) % 4
        at += 4 + int.from_bytes(payload[at : at + 4], "little")
    return at + -(at - 4) % 8


def _all(file: McapFile, kind: type) -> list:
    return [item for item in file.items if isinstance(item, kind)]
