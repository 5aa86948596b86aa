"""Strict TOML reader; each error names its line."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from selfmodel.errors import InputError, unknown_name
from selfmodel.files import load_toml

Name = TypeVar("Name", bound=str)

Keys = tuple[str, ...]
"""Path of an entry: names of its tables, then its key."""

_KEY = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*')"""
_KEYS = rf"{_KEY}(?:\s*\.\s*{_KEY})*"
_TABLE = re.compile(rf"\s*\[\s*({_KEYS})\s*\]")
_ENTRY = re.compile(rf"\s*({_KEYS})\s*=")


MAX_SHOWN = 100
"""Maximum length of a wrong value in an error, characters."""


@dataclass(frozen=True)
class Document:
    """TOML text with the lines of its entries.

    Attributes:
        name: Name of the text in errors.
        text: The text.
        lines: Line of each key and table, from 1; keys of inline tables are left out.
    """

    name: str
    text: str
    lines: Mapping[Keys, int]

    def error(self, path: Keys, sentence: str, item: str = "") -> InputError:
        """Returns an error that names the line of an entry.

        Args:
            path: Path of the entry; for an entry without its own line, the line of its table.
            sentence: Expected value, given value, and remedy.
            item: Text in a list under that key, which may be some lines below.
        """
        known = next((path[:n] for n in range(len(path), 0, -1) if path[:n] in self.lines), ())
        line = self.lines.get(known, 1)
        if item:
            below = self.text.split("\n")[line - 1 :]
            line += next((n for n, text in enumerate(below) if f'"{item}"' in text), 0)
        return InputError(f"{self.name}:{line}: {sentence}")

    def unknown(
        self, path: Keys, what: str, name: str, known: Iterable[str], item: str = ""
    ) -> InputError:
        """Returns the error for a name that is not in ``known``; see ``error``."""
        return self.error(path, str(unknown_name(what, name, known)), item)


def parse_document(text: str, name: str) -> tuple[Document, dict[str, Any]]:
    """Returns the document and the tables of a TOML text.

    Raises:
        InputError: The text is not TOML, or has a duplicate entry.
    """
    try:
        tables = load_toml(text)
    except ValueError as failure:
        reason = str(failure)
        found = re.search(r" \(at line (\d+), column \d+\)", reason)
        line = int(found[1]) if found else max(1, text.count("\n"))
        reason = reason.replace(found[0] if found else "", "")
        raise InputError(f"{name}:{line}: {_explained(reason, text, line)}") from failure
    return Document(name, text, _lines(text)), tables


def _explained(reason: str, text: str, line: int) -> str:
    entry = _ENTRY.match(text.split("\n")[line - 1])  # not splitlines: TOML has no other line end
    if reason == "Cannot overwrite a value" and entry:
        return f"{entry[1]} is listed twice: expected each name once, remove one of the two"
    if reason.startswith(("Cannot declare", "Cannot mutate")):
        return f"this table is listed twice ({reason}): merge its entries"
    return f"expected TOML: {reason}"


def _lines(text: str) -> dict[Keys, int]:
    found: dict[Keys, int] = {}
    table: Keys = ()
    for number, line in enumerate(text.split("\n"), start=1):
        if header := _TABLE.match(line):
            table = _names(header[1])
            found.setdefault(table, number)
        elif entry := _ENTRY.match(line):
            names = (*table, *_names(entry[1]))
            for end in range(len(table) + 1, len(names) + 1):
                found.setdefault(names[:end], number)
    return found


def _names(keys: str) -> Keys:
    return tuple(key.strip("\"'") for key in re.findall(_KEY, keys))


def shortened(value: object) -> str:
    """Returns the ``repr`` of an entry, or its beginning: a file may have any value."""
    text = repr(value)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."


class Table:
    """Table whose entries are taken one by one; an entry that is not taken is an error.

    Args:
        document: Document of the table.
        path: Path of the table.
        entries: Entries of the table.
    """

    def __init__(self, document: Document, path: Keys, entries: Mapping[str, Any]) -> None:
        self.document = document
        self.path = path
        self._entries = dict(entries)
        self._known: dict[str, None] = {}

    def text(self, key: str, default: str | None = None) -> str:
        """Takes a text.

        Raises:
            InputError: The entry is missing or not a text; likewise in the other methods.
        """
        value = self._take(key, default)
        if not isinstance(value, str):
            raise self._wrong(key, "a text in quotes", value)
        return value

    def choice(self, key: str, known: Iterable[Name], default: Name | None = None) -> Name:
        """Takes a text that is one of ``known``."""
        value = self.text(key, default)
        names = list(known)
        if value not in names:
            raise self.document.unknown((*self.path, key), key, value, names)
        return names[names.index(value)]

    def number(self, key: str, default: float | None = None) -> float:
        """Takes a finite number."""
        value = self._take(key, default)
        # A bool is an int to Python; infinity and nan are floats to TOML.
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < 1e15:
            raise self._wrong(key, "a number", value)
        return float(value)

    def texts(self, key: str) -> tuple[str, ...]:
        """Takes a list of distinct texts."""
        value = self._take(key, None)
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise self._wrong(key, "a list of texts", value)
        for item, count in Counter(value).items():
            if count > 1:
                sentence = f"{item} is listed twice in {key}: expected each name once"
                raise self.document.error((*self.path, key), sentence, item)
        return tuple(value)

    def table(self, key: str) -> "Table":
        """Takes a table."""
        value = self._take(key, None)
        if not isinstance(value, dict):
            raise self._wrong(key, "a table", value)
        return Table(self.document, (*self.path, key), value)

    def value(self, key: str) -> object:
        """Takes an entry of any type."""
        return self._take(key, None)

    def has(self, key: str) -> bool:
        """Returns whether there is an entry that has not been taken."""
        self._known[key] = None
        return key in self._entries

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys of the entries that have not been taken."""
        return tuple(self._entries)

    def done(self) -> None:
        """Checks that all entries have been taken.

        Raises:
            InputError: An entry has not been taken.
        """
        for key in self._entries:
            where = f"[{'.'.join(self.path)}]" if self.path else "the mapping"
            raise self.document.unknown((*self.path, key), f"key of {where}", key, self._known)

    def _take(self, key: str, default: object) -> object:
        self.has(key)
        if key in self._entries:
            return self._entries.pop(key)
        if default is None:
            where = f"[{'.'.join(self.path)}]" if self.path else "the mapping"
            raise self.document.error(self.path, f"{where} needs {key}, and has none: add it")
        return default

    def _wrong(self, key: str, expected: str, value: object) -> InputError:
        return self.document.error(
            (*self.path, key), f"{key} must be {expected}, got {shortened(value)}: change it"
        )
