"""The way out of a command: lines, notes and JSON, on streams that may be closed or full.

Every line is one argument, and harmless: text of a file or an option cannot begin a line of its
own, or command a terminal. Results are on standard output: a failure to write them is an error.
Notes, progress and errors are on standard error: a failure to write them changes nothing.
"""

import io
import json
import os
import sys
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TextIO

import typer

from selfmodel.errors import WorkError, counted

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

STDIN, STDOUT, STDERR = 0, 1, 2


def plain(text: str) -> str:
    r"""Returns text as one line: every character that is not printable is escaped as by ``repr``.

    Examples:
        >>> plain("quadruped\nok: other.mcap")
        'quadruped\\nok: other.mcap'
    """
    return "".join(
        char if char.isprintable() else char.encode("unicode_escape").decode() for char in text
    )


def figure_text(text: str) -> str:
    """Returns ``plain`` text for matplotlib, which reads a formula between two ``$``."""
    return plain(text).replace("$", r"\$")


def print_lines(*lines: str) -> None:
    """Prints lines on standard output, each as ``plain`` text."""
    for line in lines:
        typer.echo(plain(line))


def print_notes(*lines: str) -> None:
    """Prints lines on standard error, each as ``plain`` text: notes, progress and errors."""
    for line in lines:
        typer.echo(plain(line), err=True)


def print_json(value: object, *, indent: int | None = 2) -> None:
    """Prints a JSON value without NaN and infinities on standard output, in ASCII."""
    # JSON leaves one control character as it is, and a text is the only place for it.
    typer.echo(json.dumps(value, indent=indent, allow_nan=False).replace("\x7f", "\\u007f"))


def open_streams() -> None:
    """Opens the standard streams of this process again, unless its caller has replaced them.

    A closed descriptor is opened on the null device. Otherwise the next file would get its number,
    and C libraries, which write their messages to descriptor 2, would write into a log.
    """
    for descriptor, mode in ((STDIN, os.O_WRONLY), (STDOUT, os.O_RDONLY), (STDERR, os.O_WRONLY)):
        try:
            os.fstat(descriptor)
        except OSError:
            null = os.open(os.devnull, mode)  # the lowest free number, which may be this one
            if null == descriptor:
                os.set_inheritable(null, True)
            else:
                os.dup2(null, descriptor)
                os.close(null)
    if sys.stdout is sys.__stdout__:
        sys.stdout = _text(_Results(STDOUT, "w", closefd=False), sys.__stdout__, "strict")
    if sys.stderr is sys.__stderr__:
        errors = _Messages(STDERR, "w", closefd=False)
        sys.stderr = _text(errors, sys.__stderr__, "backslashreplace")


def flush_output() -> None:
    """Writes the rest of the results.

    Raises:
        WorkError: Standard output is closed or full.
        BrokenPipeError: Standard output has no reader.
    """
    try:
        sys.stdout.flush()
    except (OSError, WorkError):
        # The interpreter would report the same failure again as it exits.
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, STDOUT)
        os.close(null)
        raise


class _Results(io.FileIO):
    """Standard output; its errors have its name."""

    def write(self, data: "ReadableBuffer", /) -> int:
        try:
            return super().write(data)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise WorkError(f"standard output could not be written: {error.strerror}") from error


class _Messages(io.FileIO):
    """Standard error; text that cannot be written is lost."""

    def write(self, data: "ReadableBuffer", /) -> int:
        with suppress(OSError):
            return super().write(data)
        return memoryview(data).nbytes


def _text(raw: io.FileIO, before: TextIO | None, errors: str) -> io.TextIOWrapper:
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=before.encoding if before else None,
        errors=(before and before.errors) or errors,
        line_buffering=raw.fileno() == STDERR or raw.isatty(),
    )


@contextmanager
def counted_warnings() -> Iterator[None]:
    """Collects warnings during a block, and prints each once with its number after the block."""
    found: Counter[str] = Counter()

    def count(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        found[f"Python warned {{}}: {category.__name__}: {message}"] += 1

    before = _mujoco_warnings()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", RuntimeWarning)  # each occurrence, not each place
            warnings.showwarning = count
            yield
    finally:
        found.update(_mujoco_warnings() - before)
        for text, number in found.items():
            sentence = text.replace("{}", counted(number, "time"), 1)
            print_notes(f"note: {' '.join(sentence.split())}")


def _mujoco_warnings() -> Counter[str]:
    """Returns the warnings of MuJoCo and their numbers; none where no command has loaded it."""
    module = sys.modules.get("selfmodel.robot.mujoco_errors")
    numbers = {} if module is None else module.mujoco_warnings()
    return Counter({f"MuJoCo warned {{}}: {text}": number for text, number in numbers.items()})
