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


def log_digests(path: Path) -> dict[str, str]:
    """Returns the digests of one log.

    By topic, of all decoded messages with their log times; ``attachments``, of the names and bytes,
    the arrays of an ``.npz``, or the fields of a compiled MJCF; ``metadata``, of the records'
    fields, without those that are digests of whole files.
    """
    contents: dict[str, list[bytes]] = {}
    store = get_typestore(Stores.EMPTY)
    with path.open("rb") as file:
        reader = make_reader(file)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic in LEFT_OUT or schema is None:
                continue
            if channel.topic not in contents:
                types = get_types_from_msg(schema.data.decode(), schema.name)
                store.register({n: t for n, t in types.items() if n not in store.fielddefs})
            decoded = store.deserialize_cdr(message.data, schema.name)
            parts = contents.setdefault(channel.topic, [])
            parts += (str(message.log_time).encode(), *_flat(decoded))
        attached = {a.name: _attachment(a.name, a.data) for a in reader.iter_attachments()}
        records = {
            record.name: bytes_digest(
                repr(
                    sorted(
                        item
                        for item in record.metadata.items()
                        if not item[0].endswith(("sha256", "nonce"))
                    )
                ).encode()
            )
            for record in reader.iter_metadata()
            if record.name in RECORDS
        }
    return {
        **{topic: bytes_digest(*parts) for topic, parts in sorted(contents.items())},
        "attachments": bytes_digest(repr(sorted(attached.items())).encode()),
        "metadata": bytes_digest(repr(sorted(records.items())).encode()),
    }


def bytes_digest(*parts: bytes) -> str:
    """Returns 12 digits of a digest: 48 bits are enough where equal places are compared."""
    return hashlib.sha256(b"".join(parts)).hexdigest()[:12]


def _attachment(name: str, data: bytes) -> str:
    if name.endswith(".npz"):
        # An archive's bytes depend on the version of zlib; its arrays do not.
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            named = [(f"{key} {arrays[key].dtype}", arrays[key]) for key in sorted(arrays.files)]
    elif name.endswith(".xml"):
        # The text of a model may differ where its compiled fields are the same.
        try:
            model = mujoco.MjModel.from_xml_string(data.decode())
        except ValueError:  # it names assets of its own
            return bytes_digest(data)
        fields = ((field, getattr(model, field)) for field in sorted(dir(model)))
        named = [(field, value) for field, value in fields if isinstance(value, np.ndarray)]
    else:
        return bytes_digest(data)
    return bytes_digest(
        *(part for key, v in named for part in (f"{key} {v.shape}".encode(), v.tobytes()))
    )


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
