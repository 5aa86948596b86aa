"""Tables in the formats of a paper and of a program: CSV, Parquet, LaTeX, Markdown."""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from selfmodel.errors import InputError, unknown_name


@dataclass(frozen=True)
class Table:
    """A table for programs and for readers.

    Attributes:
        name: Name of its file, without an extension.
        names: Names of the columns for programs.
        records: Rows with all digits, with the ``names`` as keys.
        columns: Titles of the columns for readers.
        rows: Rows for readers, a text per column.
        texts: Number of leading columns that are texts; the others are numbers.
        kinds: Type of the values of a column for programs, by its name; ``float`` for others. It
            is the type in a Parquet file of a column in which all values are unknown.
    """

    name: str
    names: Sequence[str]
    records: Sequence[Mapping[str, Any]]
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    texts: int
    kinds: Mapping[str, type] = field(default_factory=dict)


def table_file(table: Table, wanted: str) -> tuple[str, bytes]:
    """Returns the name and the content of a table's file.

    CSV and Parquet files have the records, LaTeX and Markdown the rows for readers. The LaTeX is a
    ``tabular`` with the rules of the package booktabs.

    Args:
        table: The table.
        wanted: Name of a format, one of ``FORMATS``.

    Raises:
        InputError: The format is unknown, or needs a package that is missing.
    """
    if wanted not in FORMATS:
        raise unknown_name("table format", wanted, FORMATS)
    suffix, write = FORMATS[wanted]
    return f"{table.name}.{suffix}", write(table)


def check_format(wanted: str) -> None:
    """Checks, before the work on a table, that it can be written.

    Args:
        wanted: Name of a format.

    Raises:
        InputError: The format is unknown, or needs a package that is missing.
    """
    table_file(Table("none", ("n",), (), ("n",), (), 0), wanted)


def _csv(table: Table) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.names)
    for record in table.records:
        writer.writerow(str(v).lower() if isinstance(v, bool) else v for v in record.values())
    return text.getvalue().encode()


def _parquet(table: Table) -> bytes:
    try:
        import pyarrow as pa  # noqa: PLC0415  # an extra
        import pyarrow.parquet as pq  # noqa: PLC0415
    except ImportError as error:
        raise InputError(
            "a Parquet table needs pyarrow, which is not installed: pip install 'selfmodel[tables]'"
        ) from error
    data = io.BytesIO()
    types = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}
    columns = {}
    for name in table.names:
        values = pa.array([record[name] for record in table.records])
        known = values.type != pa.null()
        columns[name] = values if known else values.cast(types[table.kinds.get(name, float)])
    pq.write_table(pa.table(columns), data)
    return data.getvalue()


def _markdown(table: Table) -> bytes:
    lines = [table.columns, _rule(table, "---", "---:"), *table.rows]
    cells = ([" ".join(cell.translate(MARKDOWN).split("\n")) for cell in line] for line in lines)
    return "".join(f"| {' | '.join(line)} |\n" for line in cells).encode()


def _latex(table: Table) -> bytes:
    lines = [
        f"\\begin{{tabular}}{{{''.join(_rule(table, 'l', 'r'))}}}",
        "\\toprule",
        _latex_line(table.columns),
        "\\midrule",
        *map(_latex_line, table.rows),
        "\\bottomrule",
        "\\end{tabular}",
    ]
    return "".join(f"{line}\n" for line in lines).encode()


def _latex_line(cells: Sequence[str]) -> str:
    return " & ".join(cell.translate(LATEX) for cell in cells) + " \\\\"


def _rule(table: Table, text: str, number: str) -> list[str]:
    return [text if place < table.texts else number for place in range(len(table.columns))]


MARKDOWN = str.maketrans({"\\": "\\\\", "|": "\\|"})
"""Replacements of characters that would end a cell, or the replacement of one."""

LATEX = str.maketrans(
    {
        **{character: f"\\{character}" for character in "&%$#_{}"},
        "~": "\\textasciitilde{}",
        "^": "\\textasciicircum{}",
        "\\": "\\textbackslash{}",
        # In LaTeX's default encoding these are a Spanish !, a Spanish ? and a dash.
        **{character: f"${character}$" for character in "<>|"},
        "÷": "$\\div$",
        "−": "$-$",  # noqa: RUF001  # a minus sign
        "×": "$\\times$",  # noqa: RUF001  # a multiplication sign
    }
)
"""Replacements of characters that LaTeX reads as commands, or may lack."""

FORMATS: Mapping[str, tuple[str, Callable[[Table], bytes]]] = MappingProxyType(
    {
        "csv": ("csv", _csv),
        "parquet": ("parquet", _parquet),
        "latex": ("tex", _latex),
        "markdown": ("md", _markdown),
    }
)
"""Suffix and writer by the name of a format."""
