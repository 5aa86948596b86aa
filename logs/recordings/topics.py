"""Topics of a bag: messages as they are stored, decoded and gathered as series."""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from mcap import records as mcap
from rosbags.serde import SerdeError

from selfmodel.logs.recordings import messages
from selfmodel.logs.recordings.recording import MAX_TIME, Column, Series

if TYPE_CHECKING:
    from selfmodel.arrays import FloatArray


class Stored(NamedTuple):
    """Message in a file, or without ``data`` the announcement of its topic."""

    topic: str
    type: str
    encoding: str
    definition: str = ""
    time: int = 0
    data: bytes | None = None


class McapTopics:
    """Topics of an MCAP file, as its records announce them; ``count`` messages were read."""

    def __init__(self) -> None:
        self.count = 0
        self._types = {0: ("", "")}
        self._topics: dict[int, Stored] = {}

    def stored(self, record: mcap.McapRecord) -> Stored | None:
        """Returns the message, or the announcement of a topic, in the next record of the file."""
        match record:
            case mcap.Schema():
                self._types[record.id] = record.name, messages.text(record.encoding, record.data)
            case mcap.Channel():
                kind, text = self._types.get(record.schema_id, ("", ""))
                item = Stored(record.topic, kind, record.message_encoding, text)
                self._topics[record.id] = item
                return item
            case mcap.Message():
                self.count += 1
                topic = self._topics[record.channel_id]
                return topic._replace(time=record.log_time, data=record.data)
        return None

    def cut(self, file: Path) -> str:
        """Returns the warning about a file that has no end."""
        return (
            f"{file.name} has no end, as one that is still being recorded, or whose recorder was "
            f"stopped: {self.count} messages are read, up to the last whole one"
        )


@dataclass
class Topic:
    """Topic of a bag, with the messages that were decoded.

    Attributes:
        types: Message types, one in nearly every bag.
        times: Time stamp (0 without one) and log time of each decoded message, ns, and its place
            in the bag.
        layouts: Indices and rows of these by the names in them, nearly always the same.
        refused: Numbers of messages left out, by reason.
        listed: Columns to decode of the messages after the first.
        absent: Those that the first does not have: a list in another one may be longer.
        names: Names of the columns of the messages before.
    """

    types: dict[str, None] = field(default_factory=dict)
    count: int = 0
    times: list[tuple[int, int, int]] = field(default_factory=list)
    layouts: dict[tuple[str, ...], list[tuple[int, "FloatArray"]]] = field(default_factory=dict)
    refused: Counter[str] = field(default_factory=Counter)
    listed: tuple[str, ...] = ()
    absent: frozenset[str] = frozenset()
    names: dict[str, None] = field(default_factory=dict)

    def add(self, item: Stored, place: int, columns: Collection[str] | None) -> None:
        """Adds a message, or an announcement; ``columns`` of it, all if empty, or None."""
        package, _, name = item.type.rpartition("/")
        kind = item.type if package.endswith("/msg") else f"{package}/msg/{name}"  # old bags
        known = item.encoding in (messages.CDR, messages.ROS1)
        if not (isinstance(item.time, int) and 0 <= item.time < MAX_TIME):
            raise ValueError(f"a message has the log time {item.time!r} ns")
        self.types[(kind if package else name) + ("" if known else f" in {item.encoding!r}")] = None
        if item.data is None:
            return
        self.count += 1
        by_place = kind not in messages.DECODERS
        is_done = by_place and self.layouts and not self.listed
        if columns is None or not known or not package or is_done:
            return
        try:
            stamp, (names, rows) = messages.decode(
                item.data, kind, item.encoding, item.definition, self.listed
            )
        except (messages.UndefinedError, SerdeError) as failure:
            # Only a suggestion decodes what nobody has asked for.
            if isinstance(failure, SerdeError) and (columns or not by_place):
                raise
            return
        except messages.RefusedError as refused:
            self.refused[str(refused)] += 1
            return
        if by_place and not (self.layouts or self.listed):
            self.listed = tuple(columns)
            self.absent = frozenset(columns) - set(names)
            rows = np.append(rows, np.full((len(self.absent), 1), np.nan), axis=0)
            names = (*names, *sorted(self.absent))
        if names or not by_place:
            self.layouts.setdefault(names, []).append((len(self.times), rows))
            self.times.append((stamp, item.time, place))

    def series(self) -> Series:
        """Returns the messages as arrays; a column may be in messages of several layouts."""
        parts: dict[str, list[Column]] = {}
        for names, decoded in self.layouts.items():
            indices, blocks = zip(*decoded, strict=True)
            index, rows = np.array(indices, dtype=np.int64), np.array(blocks)
            for k, name in enumerate(names):
                parts.setdefault(name, []).append(Column(index, rows[:, k]))
        columns = {}
        for name, some in parts.items():
            index = np.concatenate([part.index for part in some])
            order = np.argsort(index)
            values = np.concatenate([part.values for part in some])
            if name not in self.absent or not np.isnan(values).all():
                columns[name] = Column(index[order], values[order])
        stamps, logged, places = np.array(self.times, dtype=np.int64).reshape(-1, 3).T
        kind, names, count = " and ".join(self.types), (*(self.names | columns),), self.count
        by_place = bool(names) and not self.types.keys() & messages.DECODERS.keys()
        return Series(
            kind, count, stamps, logged, places, names, columns, self.refused, by_place=by_place
        )

    def taken(self) -> Series:
        """Returns the messages since the last call, of which none is kept, but all are counted."""
        series = self.series()
        self.names |= dict.fromkeys(series.names)
        self.times, self.layouts = [], {}
        return series
