"""Mutations of the records of an MCAP file: metadata, attachments, messages, channels, schemas.

An operator changes a file in place, and returns a description of the change.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from mcap.records import Attachment, Message, Metadata

from selfmodel.logs.messages.cdr import decode_names
from selfmodel.logs.records import (
    CONTROLLER_FILE,
    DIGEST,
    MODEL_FILE,
    SETTINGS_FILE,
)
from tests.fuzz.mcap_file import COMPRESSIONS, McapFile, written
from tests.fuzz.mutate import cdrs, data as raw, jsons, npzs, xmls
from tests.fuzz.mutate.numbers import INTEGERS, number_text, text

Operator = Callable[[McapFile, np.random.Generator], str]


def mutated(
    file: McapFile, operators: Sequence[Operator], rng: np.random.Generator
) -> tuple[McapFile, list[str]]:
    """Returns a file with one to three mutations, and their names."""
    changed = file.copy()
    names = []
    for _ in range(int(rng.choice([1, 1, 1, 2, 3]))):
        operator = operators[rng.integers(len(operators))]
        names.append(f"{operator.__name__}: {operator(changed, rng)}")
    return changed, names


def packed(file: McapFile, rng: np.random.Generator, *, checksums: bool = True) -> bytes:
    """Returns the bytes of a file in a random packing."""
    packing = COMPRESSIONS[rng.integers(len(COMPRESSIONS))]
    chunk = (None, 2**10, 2**18)[rng.integers(3)]
    return written(file, packing, chunk, checksums=checksums)


def _pick(file: McapFile, kind: type, rng: np.random.Generator) -> int | None:
    """Index of a record of a kind."""
    found = [index for index, item in enumerate(file.items) if isinstance(item, kind)]
    return int(rng.choice(found)) if found else None


def _messages_like(file: McapFile, message: Message) -> list[tuple[int, Message]]:
    """Messages of the same channel, with their indices."""
    return [
        (index, item)
        for index, item in enumerate(file.items)
        if isinstance(item, Message) and item.channel_id == message.channel_id
    ]


def metadata_value(file: McapFile, rng: np.random.Generator) -> str:
    """Changes, adds, renames or removes an entry of a metadata record."""
    index = _pick(file, Metadata, rng)
    if index is None:
        return "none"
    item = file.items[index]
    texts = {key: value for key, value in item.metadata.items() if key != DIGEST}
    key = str(rng.choice(sorted(texts))) if texts else "format"
    kind = int(rng.integers(10))
    if kind == 0:
        texts.pop(key, None)
    elif kind == 1:
        texts[text(rng)] = text(rng)
    elif kind == 2:
        texts[key] = text(rng)
    elif kind == 3 and texts.get(key, "").startswith(("{", "[")):
        texts[key] = jsons.mutated(texts[key].encode(), rng)[0].decode("utf-8", "replace")
    elif kind == 4:
        texts[key] = texts[str(rng.choice(sorted(texts)))] if texts else ""
    else:
        texts[key] = number_text(rng)
    file.items[index] = Metadata(item.name, texts)
    return f"{item.name} {key} = {texts.get(key, '')!r:.80}"


def record_placed(file: McapFile, rng: np.random.Generator) -> str:
    """Removes, doubles, renames or moves a metadata record or an attachment."""
    index = _pick(file, Metadata if rng.random() < 0.5 else Attachment, rng)
    if index is None:
        return "none"
    item = file.items[index]
    kind = int(rng.integers(4))
    if kind == 0:
        del file.items[index]
    elif kind == 1:
        file.items.insert(int(rng.integers(len(file.items))), item)
    elif kind == 2:
        file.items[index] = dataclasses.replace(item, name=text(rng))
    else:
        file.items.insert(int(rng.integers(len(file.items))), file.items.pop(index))
    return f"{item.name} {kind}"


def attachment(file: McapFile, rng: np.random.Generator) -> str:
    """Changes the content of an attachment in its own format."""
    index = _pick(file, Attachment, rng)
    if index is None:
        return "none"
    item = file.items[index]
    mutate = MUTATE.get(item.name, raw.mutated)
    new, what = mutate(item.data, rng)
    file.items[index] = dataclasses.replace(item, data=new)
    return f"{item.name} {what}"


def model(file: McapFile, rng: np.random.Generator) -> str:
    """Changes the model."""
    for index, item in enumerate(file.items):
        if isinstance(item, Attachment) and item.name == MODEL_FILE:
            new, what = xmls.mutated(item.data, rng)
            file.items[index] = dataclasses.replace(item, data=new)
            return what
    return "none"


def payload(file: McapFile, rng: np.random.Generator) -> str:
    """Changes one message, or all of its topic alike."""
    index = _pick(file, Message, rng)
    if index is None:
        return "none"
    item = file.items[index]
    if rng.random() < 0.4:
        new, what = cdrs.mutated(item.data, rng)
        file.items[index] = dataclasses.replace(item, data=new)
        return f"message {index} {what}"
    seed = int(rng.integers(2**32))
    for at, other in _messages_like(file, item):
        new, what = cdrs.mutated(other.data, np.random.default_rng(seed))
        file.items[at] = dataclasses.replace(other, data=new)
    return f"every message of channel {item.channel_id} {what}"


def names(file: McapFile, rng: np.random.Generator) -> str:
    """Changes a name in every message of a topic, and keeps the length."""
    index = _pick(file, Message, rng)
    if index is None:
        return "none"
    chosen = file.items[index]
    try:
        held = decode_names(chosen.data)
    except ValueError:
        held = ()
    if not held:
        return "none"
    name = held[rng.integers(len(held))]
    new = (text(rng) * len(name))[: len(name)] if rng.random() < 0.7 else held[0]
    encoded = new.encode("utf-8", "replace").ljust(len(name.encode()), b"_")[: len(name.encode())]
    for at, other in _messages_like(file, chosen):
        data = other.data.replace(name.encode(), encoded)
        file.items[at] = dataclasses.replace(other, data=data)
    return f"{name} is {encoded!r:.40}"


def time(file: McapFile, rng: np.random.Generator) -> str:
    """Changes the time, the channel or the sequence number of a message."""
    index = _pick(file, Message, rng)
    if index is None:
        return "none"
    item = file.items[index]
    name, most = (("log_time", 64), ("publish_time", 64), ("sequence", 32), ("channel_id", 16))[
        rng.integers(4)
    ]
    value = INTEGERS[rng.integers(len(INTEGERS))] % 2**most
    if name == "channel_id" and rng.random() < 0.8:
        value = int(rng.choice(sorted(file.channels)))
    file.items[index] = dataclasses.replace(item, **{name: value})
    return f"message {index} {name} = {value}"


def messages(file: McapFile, rng: np.random.Generator) -> str:
    """Removes, doubles or swaps messages, or removes a whole topic or the last steps."""
    first, second = _pick(file, Message, rng), _pick(file, Message, rng)
    if first is None or second is None:
        return "none"
    kind = int(rng.integers(5))
    if kind == 0:
        del file.items[first]
    elif kind == 1:
        file.items.insert(second, file.items[first])
    elif kind == 2:
        file.items[first], file.items[second] = file.items[second], file.items[first]
    else:
        cut = file.items[first]
        file.items = [
            item
            for item in file.items
            if not isinstance(item, Message)
            or (item.channel_id != cut.channel_id if kind == 3 else item.log_time < cut.log_time)
        ]
    return f"{first}, {second}: {kind}"


def channel(file: McapFile, rng: np.random.Generator) -> str:
    """Changes the topic, encoding, schema or metadata of a channel, or swaps two channels."""
    number = int(rng.choice(sorted(file.channels)))
    other = int(rng.choice(sorted(file.channels)))
    held = file.channels[number]
    kind = int(rng.integers(5))
    if kind == 0:
        file.channels[number] = dataclasses.replace(held, topic=text(rng))
    elif kind == 1:
        file.channels[number] = dataclasses.replace(held, message_encoding=text(rng))
    elif kind == 2:
        choice = rng.choice([0, 999, *file.schemas])
        file.channels[number] = dataclasses.replace(held, schema_id=int(choice))
    elif kind == 3:
        file.channels[number] = dataclasses.replace(held, metadata={text(rng): text(rng)})
    else:
        file.channels[number], file.channels[other] = file.channels[other], held
    return f"{held.topic}: {kind}"


def schema(file: McapFile, rng: np.random.Generator) -> str:
    """Changes the name, encoding or text of a schema."""
    if not file.schemas:
        return "none"
    number = int(rng.choice(sorted(file.schemas)))
    held = file.schemas[number]
    kind = int(rng.integers(3))
    if kind == 0:
        file.schemas[number] = dataclasses.replace(held, name=text(rng))
    elif kind == 1:
        file.schemas[number] = dataclasses.replace(held, encoding=text(rng))
    else:
        new, _ = raw.mutated(held.data, rng)
        file.schemas[number] = dataclasses.replace(held, data=new)
    return f"{held.name}: {kind}"


MUTATE = {
    MODEL_FILE: xmls.mutated,
    SETTINGS_FILE: jsons.mutated,
    CONTROLLER_FILE: npzs.mutated,
}
"""Mutation of an attachment, by its name."""

BAG: tuple[Operator, ...] = (
    *(payload, payload, payload, names, time, messages, messages, channel, schema),
)
"""Operators for a bag, which has neither metadata nor attachments."""

LOG: tuple[Operator, ...] = (
    *(metadata_value, metadata_value, metadata_value, record_placed, attachment, attachment),
    *(model, model, model, payload, payload, payload, names, time, messages, channel, schema),
)
"""Operators for a trial log."""
