"""``selfmodel compare``: paired comparisons of the methods of a study, as tables and figures."""

from itertools import groupby
from typing import Any

import pandas as pd

from selfmodel.cli.commands import Compare
from selfmodel.cli.output import print_json, print_lines, print_notes
from selfmodel.cli.tables import show
from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.errors import InputError
from selfmodel.studies import figures, tables as formats
from selfmodel.studies.comparisons import p_text
from selfmodel.studies.rows import LoadedStudy, load, whole
from selfmodel.studies.study import Row
from selfmodel.style import figure_style, read_style

MEANS = "Means are over the cells that all methods have."
PAIRS = (
    "Differences are on the n runs that both methods have, with 95 % intervals over seeds, which "
    "are not corrected. p: the larger of a test over runs (exact McNemar, or sign flips) and one "
    "over seeds (Student's; of fewer than four seeds, or of seeds without variance, exact sign "
    "flips, whose p is 0.25 at least of three seeds), corrected for the number of pairs (Holm). "
    "Better (*): p below 0.05."
)


def compare(options: Compare) -> None:
    """Compare the methods of a study by pairs: tests, intervals, marginal means, figures."""
    formats.check_format(options.table)
    read_style(options.style)
    if options.out is None and not options.study.is_dir():
        raise InputError(
            f"{options.study} is no folder of a study: give the folder of the tables, -o DIR"
        )
    found = load(options.study)
    pairs, means = found.comparisons(), found.marginal_means()
    pair_rows, mean_rows = _records(pairs), _records(means)
    tables = [
        *([] if options.table in ("latex", "markdown") else [formats.table_of("rows", found.rows)]),
        formats.table_of("marginal-means", means, list(map(_mean_texts, mean_rows)), 2, MEANS),
        formats.table_of("comparisons", pairs, list(map(_pair_texts, pair_rows)), 2, PAIRS),
    ]
    with figure_style(options.style):
        content = formats.table_files(tables, options.table) | figures.of_comparisons(pairs)
    if options.out is None:  # within the study, where no linked folder is written to
        content = {f"comparison/{name}": data for name, data in content.items()}
    files = list(map(str, formats.write_files(options.out or options.study, content)))
    if options.as_json:
        facts = {
            "study": found.kind,
            "rows": len(found.rows),
            "warnings": list(found.warnings()),
            "comparisons": pair_rows,
            "marginal_means": mean_rows,
            "files": files,
        }
        print_json(to_json(facts), indent=1)
        return
    _print_comparison(found, pair_rows, means)
    print_lines(*files)


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Returns the rows of a frame of statistics; the names of a table as one text."""
    rows = to_json(frame.to_dict("records"))
    return [{**row, "table": ", ".join(row["table"])} for row in rows]


def _print_comparison(study: LoadedStudy, found: list[Row], means: pd.DataFrame) -> None:
    """Prints the tables that are over all conditions; the files have the others too."""
    if not len(means):
        print_lines(f"{study.path}: {len(study.rows)} rows of one method: nothing to compare")
        return
    print_notes(*(f"warning: {warning}" for warning in study.warnings()))
    for name, own in groupby(_records(whole(means)), key=lambda row: row["table"]):
        print_lines(f"{name}:")
        texts = pd.DataFrame(map(_mean_texts, own)).drop(columns="table")
        show(list(texts.columns), texts.to_numpy().tolist(), texts=1)
        print_lines(*(_pair_line(one) for one in found if one["table"] == name))
    print_lines(f"{MEANS} {PAIRS}")


def _pair_line(one: Row) -> str:
    pair = f"{one['first']} or {one['second']}, not decided"
    if one["better"]:
        pair = f"{one['first']} better than {one['second']}"
    return f"  {pair}: {_ends(one, 'difference')}, n {one['n']}, p {p_text(one['p_holm'])}"


def _mean_texts(one: Row) -> dict[str, str]:
    counts = {name: str(one[name]) for name in ("n", "seeds")}
    named = {"table": one["table"], "method": one["method"]}
    return {**named, **counts, "mean (95 %)": _ends(one, "mean")}


def _pair_texts(one: Row) -> dict[str, str]:
    """Returns the columns of a pair for a paper; the files of records have all."""
    better = "*" if one["better"] else ""
    return {
        "table": one["table"],
        "comparison": f"{one['first']} vs. {one['second']}",
        "difference (95 %)": _ends(one, "difference"),
        "n": str(one["n"]),
        "p": f"{p_text(one['p_holm'])}{better}",
    }


def _ends(one: Row, name: str) -> str:
    """Returns an estimate with the ends of its interval as text: 0.257 (0.036 to 0.413)."""
    low, high = one[f"{name}_low"], one[f"{name}_high"]
    if low is None or high is None:
        return f"{one[name]:.3f} (-)"
    return f"{one[name]:.3f} ({low:.3f} to {high:.3f})"
