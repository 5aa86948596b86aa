"""Digests of the numbers in a trial log, read with the libraries ``mcap`` and ``rosbags`` alone.

Independent of selfmodel, so that logs of two versions of it are compared by the same code. Left out
are versions, digests of whole files and the clock of a robot: none of them is a result.
"""

import dataclasses
import hashlib
import io
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

LEFT_OUT = ("/timing", "/provenance")
"""Topics of a robot's own clock, and of digests."""

RECORDS = ("selfmodel.trial", "selfmodel.hidden", "selfmodel.result", "selfmodel.import")
"""Metadata records with results; ``selfmodel.software`` has versions."""

LENGTH = 12
"""Hexadecimal digits of a digest: 48 bits are enough where equal places are compared."""


def log_digests(path: Path) -> dict[str, str]:
    """Returns the digests of one log.

    Args:
        path: A trial log.

    Returns:
        By topic, the digest of all decoded messages with their log times; ``attachments``, the
        digest of the names, and of the bytes, of the arrays of an ``.npz``, or of the fields of a
        compiled MJCF; ``metadata``, the digest of the records' fields, without those that are
        digests of whole files.
    """
    hashes: dict[str, hashlib._Hash] = {}
    store = get_typestore(Stores.EMPTY)
    found: dict[str, str] = {}
    with path.open("rb") as file:
        reader = make_reader(file)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic in LEFT_OUT or schema is None:
                continue
            if channel.topic not in hashes:
                hashes[channel.topic] = hashlib.sha256()
                types = get_types_from_msg(schema.data.decode(), schema.name)
                store.register({n: t for n, t in types.items() if n not in store.fielddefs})
            content = store.deserialize_cdr(message.data, schema.name)
            hashes[channel.topic].update(str(message.log_time).encode())
            for part in _flat(content):
                hashes[channel.topic].update(part)
        found |= {topic: _short(digest) for topic, digest in sorted(hashes.items())}
        attached = {a.name: _attachment(a.name, a.data) for a in reader.iter_attachments()}
        found["attachments"] = bytes_digest(repr(sorted(attached.items())).encode())
        records: dict[str, str] = {}
        for record in reader.iter_metadata():
            if record.name in RECORDS:
                fields = sorted(
                    item
                    for item in record.metadata.items()
                    if not item[0].endswith(("sha256", "nonce"))
                )
                records[record.name] = bytes_digest(repr(fields).encode())
        found["metadata"] = bytes_digest(repr(sorted(records.items())).encode())
    return found


def bytes_digest(data: bytes) -> str:
    """Returns the digest of some bytes."""
    return _short(hashlib.sha256(data))


def _attachment(name: str, data: bytes) -> str:
    digest = hashlib.sha256()
    if name.endswith(".npz"):
        # An archive's bytes depend on the version of zlib; its arrays do not.
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            for array in sorted(arrays.files):
                digest.update(f"{array} {arrays[array].dtype} {arrays[array].shape}".encode())
                digest.update(np.ascontiguousarray(arrays[array]).tobytes())
    elif name.endswith(".xml"):
        # The text of a model may differ where its compiled fields are the same.
        try:
            model = mujoco.MjModel.from_xml_string(data.decode())
        except ValueError:  # it names assets of its own
            digest.update(data)
        else:
            for field in sorted(dir(model)):
                value = getattr(model, field)
                if isinstance(value, np.ndarray):
                    digest.update(f"{field} {value.shape}".encode())
                    digest.update(np.ascontiguousarray(value).tobytes())
    else:
        digest.update(data)
    return _short(digest)


def _flat(value: object) -> Iterator[bytes]:
    """Yields the fields of a message in the order of its definition, nested messages unfolded."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            yield from _flat(getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield value.tobytes()
    elif isinstance(value, list | tuple):
        yield str(len(value)).encode()
        for item in value:
            yield from _flat(item)
    elif isinstance(value, float):
        yield np.float64(value).tobytes()
    else:
        yield repr(value).encode()


def _short(digest: "hashlib._Hash") -> str:
    return digest.hexdigest()[:LENGTH]
