"""Rows of the kinds of studies, from their folder or file, and the outcomes that they compare."""

import io
import json
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from types import MappingProxyType
from typing import Any

import pandas as pd

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.errors import InputError, counted, joined
from selfmodel.files import path_of, read_file
from selfmodel.plugins import RETURN
from selfmodel.recovery.scores import score_label
from selfmodel.studies import comparisons
from selfmodel.studies.recoveries import ENDS
from selfmodel.studies.statistics import proportion
from selfmodel.studies.study import Row, rows_in, shared_in

INTEGERS = (
    *("case", "seed", "trials", "rivals", "evaluations", "distinct_hypotheses", "diverged"),
    *("control_steps", "simulated_steps", "return_most", "fell_at_step"),
)
"""Columns of whole numbers, of which some may be unknown."""

MAX_BYTES = 2**30
"""Largest size of a file of results that is read, bytes."""

REFERENCE = FORWARD_DISPLACEMENT.name
"""The comparator whose time is 1 in the scores of an ablation: the paper's."""

AFTER = (1, 3, 20)
"""Numbers of physical trials after which methods other than selfmodel's are compared."""

ORACLE = "oracle"
"""Name of the method that is a bound, and is not compared."""

FORMER = {
    "recovered": "best_trial",
    "upright": "upright_best_trial",
    "displacement_recovered": "displacement_best_trial",
    "return_recovered": "return_best_trial",
}
"""Names of columns of a study of bodies by those that they had in version 0.1."""

UPRIGHT_AT_ENDS = tuple(f"upright_{end}" for end in ENDS)
MEASURED_AT_ENDS = tuple(f"{it}_{end}" for it in ("displacement", RETURN) for end in ENDS)
"""What is reported at these ends beside the score; the return of a robot with a task."""

OutcomeRows = Iterator[tuple[Any, ...]]


@dataclass(frozen=True)
class Kind:
    """Rows of a kind of study.

    Attributes:
        table: Name of the rows in the result of a cell.
        names: Names of the columns of the rows, in order, with spaces between them.
        may_lack: Those that published tables lack.
        sorted_by: Those by which rows are sorted.
        outcomes: Function of the rows to the outcomes that are compared.
    """

    table: str
    names: str
    may_lack: str
    sorted_by: str
    outcomes: Callable[[pd.DataFrame], OutcomeRows]

    @property
    def columns(self) -> list[str]:
        """Columns of the rows, in order."""
        return self.names.split()

    def order(self, row: Row) -> tuple[Any, ...]:
        """Returns the sort key of a row; of a run, the paper's comparator is the first."""
        key = [(row[name] is None, row[name]) for name in self.sorted_by.split()]
        return (*key, row.get("comparator") != REFERENCE)


def _of_ablation(rows: pd.DataFrame) -> OutcomeRows:
    """Yields right (1) and wrong (0) diagnoses by comparator: over all gaps, then at each alone."""
    gaps = sorted(rows["gap"].unique())
    for gap in [None, *gaps] if len(gaps) > 1 else [None]:
        alone = () if gap is None else (f"gap {gap:g}",)
        for row in (rows if gap is None else rows[rows["gap"] == gap]).itertuples():
            table = row.robot, counted(row.trials, "trial"), *alone
            cell = f"gap {row.gap:g}", failure_of(row.case, row.truth), row.next_trial
            yield table, row.method, cell, row.seed, float(row.correct), "share"


def _of_paper(rows: pd.DataFrame) -> OutcomeRows:
    """Yields right (1) and wrong (0) diagnoses, and recovered displacements, by comparator."""
    for row in rows.itertuples():
        run = row.method, (f"{row.case:2d}",), row.seed
        yield (row.robot, "right"), *run, float(row.correct), "share"
        yield (row.robot, "recovered, m"), *run, float(row.recovered), "number"


def _of_methods(rows: pd.DataFrame) -> OutcomeRows:
    """Yields displacements by method, m, and divided by the oracle's on the same physical robot.

    There is no table after more trials than any method had on the robot.
    """
    bounds = oracles(rows)
    compared = rows[rows["method"] != ORACLE]
    longest = compared["best"].map(len).groupby(compared["robot"]).max()
    for trials in AFTER:
        for row in compared.itertuples():
            if trials > longest[row.robot]:
                continue
            value = method_value(row, trials)
            bound = bounds.get((row.robot, row.case, row.gap, row.seed), 0.0)
            run = row.method, (f"gap {row.gap:g}", f"{row.case:2d}"), row.seed
            table = row.robot, f"after {counted(trials, 'trial')}"
            yield (*table, "m"), *run, value, "number"
            if bound > 0:
                yield (*table, "÷ oracle"), *run, value / bound, "number"


def oracles(rows: pd.DataFrame) -> dict[tuple[Any, ...], float]:
    """Returns the displacement of the oracle, m, by robot, case, gap and seed."""
    return {
        (row.robot, row.case, row.gap, row.seed): method_value(row, 1)
        for row in rows[rows["method"] == ORACLE].itertuples()
    }


def method_value(row: Any, trials: int) -> float:  # noqa: ANN401  # a row of a frame
    """Returns the best displacement up to a fall after a number of trials, m.

    The value of the oracle is the mean of all its trials.
    """
    if row.method == ORACLE:
        return float(mean(row.upright))
    return float(row.best[min(trials, len(row.best)) - 1])


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "ablate": Kind(
            "diagnoses",
            "robot case truth gap seed next_trial comparator comparator_name diagnostic_search "
            "trials best correct distance intact_distance verdict rivals evaluations "
            "distinct_hypotheses simulated_steps seconds before after recovered repair search",
            "comparator_name diagnostic_search simulated_steps repair search",
            "robot truth gap seed comparator diagnostic_search trials",
            _of_ablation,
        ),
        "rivals": Kind(
            "recoveries",
            "method robot case truth gap seed best upright displacement fallen steps "
            "simulated_steps seconds",
            "",
            "robot case gap seed method",
            _of_methods,
        ),
        "paper": Kind(
            "recoveries",
            "robot case truth seed comparator comparator_name compared_by best correct before "
            "after recovered distinct_hypotheses diverged seconds",
            "comparator_name",
            "robot case seed",
            _of_paper,
        ),
        "suite": Kind(
            "recoveries",
            "robot case truth seed best correct verdict trials score unit control_steps "
            f"{' '.join((*ENDS, 'regained', 'outcome', *UPRIGHT_AT_ENDS, *MEASURED_AT_ENDS))} "
            "return_most diverged simulated_steps seconds repair search reason",
            "score unit control_steps return_most simulated_steps repair search reason regained "
            f"outcome {' '.join((*UPRIGHT_AT_ENDS, *MEASURED_AT_ENDS))}",
            "robot case truth seed",
            lambda _rows: iter(()),  # its bodies have one comparator, and are no pairs
        ),
    }
)
"""Kinds of studies by their name; the columns of a row determine it."""


@dataclass(frozen=True, repr=False)
class LoadedStudy:
    """Rows of a study, one per diagnosis or recovery, with what they compare.

    The outcomes are those of ``comparisons.compare``; none for a study with one method.
    """

    kind: str
    path: Path
    rows: pd.DataFrame
    outcomes: pd.DataFrame

    def __repr__(self) -> str:
        shares = [
            f"\n  {name}: {right} of {runs} right{f' ({said})' if said else ''}"
            for name, right, runs, said in self._right()
        ]
        return f"<LoadedStudy {self.kind}, {counted(len(self.rows), 'row')}{''.join(shares)}>"

    def _right(self) -> list[tuple[str, int, int, str]]:
        """Returns the right diagnoses, their number and verdicts, by robot and comparator."""
        if "correct" not in self.rows:
            return []
        rows = self.rows[self.rows["correct"].notna()]  # a body cannot have every failure
        if "comparator" in rows:
            rows = rows.assign(method=methods_of(rows.to_dict("records")))
        axes = [name for name in ("robot", "method") if name in rows]
        axes += ["trials"] if self.kind == "ablate" else []
        groups = rows.astype(dict.fromkeys(axes, str)).groupby(axes)
        return [
            (
                *(", ".join(key), int(own["correct"].sum()), len(own)),
                ", ".join(f"{n} {verdict}" for verdict, n in own["verdict"].value_counts().items()),
            )
            for key, own in groups
        ]

    def to_pandas(self) -> pd.DataFrame:
        """Returns the rows."""
        return self.rows

    def plot(self) -> Any:  # noqa: ANN401  # matplotlib is slow to import
        """Returns right diagnoses with 95 % intervals by robot and comparator, as a figure.

        For rows without diagnoses, the marginal means of their methods.
        """
        from selfmodel.style import values_by_name  # noqa: PLC0415  # matplotlib is slow to import

        right, means = self._right(), whole(self.marginal_means())
        if not right:
            names = [f"{', '.join(row.table)}: {row.method}" for row in means.itertuples()]
            ends = list(zip(means["mean_low"], means["mean_high"], strict=True))
            return values_by_name(self.kind, "mean", names, list(means["mean"]), ends=ends)
        shares = [proportion(number, runs) for _, number, runs, _ in right]
        names = [f"{name} (n = {runs})" for name, _, runs, _ in right]
        values, ends = [one.estimate for one in shares], [(one.low, one.high) for one in shares]
        label = "right diagnoses (95 % interval)"
        return values_by_name(self.kind, label, names, values, ends=ends)

    def comparisons(self) -> pd.DataFrame:
        """Returns the paired comparisons of all methods; see ``comparisons.compare``."""
        return comparisons.compare(self.outcomes)

    def marginal_means(self) -> pd.DataFrame:
        """Returns the means of all methods over the cells that they share."""
        return comparisons.marginal_means(self.outcomes)

    def warnings(self) -> tuple[str, ...]:
        """Returns a sentence per kind of imbalance in the tables over all conditions."""
        return comparisons.balance_warnings(whole(self.outcomes))


def load(path: str | Path) -> LoadedStudy:
    """Returns the rows of a study and their statistics.

    Example::

        study = selfmodel.studies.load("runs/ablation")
        study.rows.groupby("robot")["correct"].mean()

    Args:
        path: Folder of ``selfmodel ablate``, ``paper`` or ``suite run``, finished or not; its
            ``results.csv``; or the ``results.jsonl`` of other methods.

    Raises:
        InputError: There is no study, it has no finished run, or a file is damaged.
    """
    place = path_of(path, "a study")
    if place.is_dir():
        name = str(shared_in(place).get("study"))
        if name not in KINDS:
            raise InputError(
                f"{place}: expected the folder of a study ({', '.join(KINDS)}) with a finished "
                f"run, got none in {place / 'runs'}: run the study first"
            )
        rows = frame_of(study_rows(name, place), KINDS[name].columns)
    else:
        rows = _rows_of_file(place)
        if not (name := kind_of(rows.columns)):
            raise InputError(
                f"{place}: expected the rows of a study by {', '.join(KINDS)}, got the columns "
                f"{', '.join(map(str, rows.columns))[:300]}"
            )
        rows = rows.rename(columns=FORMER) if name == "suite" else rows
    if not len(rows):
        raise InputError(f"{place}: expected the rows of a study, got none: run the study first")
    for column, kinds in (("correct", "b"), ("gap", "fi"), ("seed", "iu"), ("case", "iu")):
        known = rows[column].dropna().infer_objects() if column in rows else pd.Series()
        if len(known) and known.dtype.kind not in kinds:
            odd = known.astype(str).iloc[0]
            raise InputError(
                f"{place}: expected {'true or false' if kinds == 'b' else 'numbers'} in the column "
                f"{column}, got values such as {odd!r}"
            )
    try:
        return LoadedStudy(name, place, rows, outcomes_of(name, rows))
    except (TypeError, ValueError) as error:
        raise InputError(f"{place}: expected the rows of a study by {name}, got {error}") from error


def kind_of(columns: Collection[str]) -> str:
    """Returns the kind of study whose rows have these columns; an empty text if none has."""
    fitting = (
        name
        for given in (set(columns), {FORMER.get(column, column) for column in columns})
        for name, kind in KINDS.items()
        if set(kind.columns) - set(kind.may_lack.split()) <= given <= set(kind.columns)
    )
    return next(fitting, "")


def _rows_of_file(path: Path) -> pd.DataFrame:
    """Returns the rows in a CSV file, or in lines of JSON; numbers are exact."""
    what = "the folder of a study, its results.csv or its results.jsonl"
    if path.suffix not in (".csv", ".jsonl"):
        raise InputError(f"{path}: expected {what}, got a file with another ending")
    data = read_file(path, what, MAX_BYTES)
    try:
        text = data.decode("utf-8-sig")
        if path.suffix == ".jsonl":
            return frame_of([json.loads(line) for line in text.splitlines()])
        texts = pd.read_csv(io.StringIO(text), dtype=str, na_values=[""], keep_default_na=False)
        return _typed(texts.apply(_parsed))
    except (ValueError, RecursionError) as error:  # pandas' own errors are ValueErrors
        reason = " ".join(str(error).split())
        raise InputError(f"{path}: expected the rows of a study, got {reason}") from error


def _parsed(texts: pd.Series) -> pd.Series:
    """Returns a column as flags or numbers, if all of its texts are; exact, unlike pandas' own."""
    flags = texts.str.lower().map({"true": True, "false": False})
    if flags.notna().any() and (flags.notna() == texts.notna()).all():
        return flags
    try:
        return texts.map(float)
    except ValueError:
        return texts


def outcomes_of(name: str, rows: pd.DataFrame | Sequence[Row]) -> pd.DataFrame:
    """Returns what the rows of a kind of study compare, with the columns ``OUTCOME``."""
    frame = rows if isinstance(rows, pd.DataFrame) else frame_of(rows, KINDS[name].columns)
    if "comparator" in frame:
        frame = frame.assign(method=methods_of(frame.to_dict("records")))
    return pd.DataFrame(list(KINDS[name].outcomes(frame)), columns=list(comparisons.OUTCOME))


def methods_of(rows: Sequence[Row]) -> list[str]:
    """Returns the names of the methods of rows, as figures and tables show them.

    A method is a comparator, by the name of its object, which a row of a newer study has. With two
    objects of one name, it is that by which they were given, ``package.module:object``; with
    several searches of the diagnoses, the search is added: ``segment-prediction with ea``.
    """
    named = {row["comparator"]: row.get("comparator_name") for row in rows}
    names = {given: name if isinstance(name, str) else given for given, name in named.items()}
    shown = list(names.values())
    searches = {str(row.get("diagnostic_search")) for row in rows}
    methods = []
    for row in rows:
        given = row["comparator"]
        name = names[given] if shown.count(names[given]) == 1 else given
        methods.append(f"{name} with {row['diagnostic_search']}" if len(searches) > 1 else name)
    return methods


def ablation_notes(rows: Sequence[Row], folder: Path) -> tuple[str, ...]:
    """Returns what the scores of an ablation are, and with which search and cost it compares."""
    limit = shared_in(folder).get("settings", {}).get("max_simulated_steps")
    searches = {str(row["diagnostic_search"]): None for row in rows if row["diagnostic_search"]}
    same, ending = (" with the same search", "es") if len(searches) > 1 else ("", "")
    text = f"With 95 % intervals; time as a multiple of {REFERENCE}'s{same}; -: not measured."
    if limit is None:
        return (text,)
    return f"{text[:-1]}; simulated steps: the median.", (
        f"Each comparator has the search{ending} {joined([*searches])}, and simulated at most "
        f"{limit:,} control steps for each trial."
    )


def study_rows(name: str, folder: Path, table: str | None = None) -> list[Row]:
    """Returns the rows of all finished runs in the folder of a study of ``KINDS``, in order.

    Without the name of a table, they have the columns of the kind.
    """
    kind = KINDS[name]
    if not folder.is_dir():
        raise InputError(f"{folder}: expected the folder of a study, got none: run the study first")
    rows = rows_in(folder, table or kind.table)
    if table is None:
        former = {new: old for old, new in FORMER.items()} if name == "suite" else {}
        rows = [
            {column: row.get(column, row.get(former.get(column, ""))) for column in kind.columns}
            for row in rows
        ]
    return sorted(rows, key=kind.order)


def frame_of(rows: Sequence[Row], columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Returns rows as a frame; whole numbers remain whole where some are unknown."""
    return _typed(pd.DataFrame(rows, columns=None if columns is None else list(columns)))


def _typed(frame: pd.DataFrame) -> pd.DataFrame:
    counts = {name: frame[name].astype(float) for name in INTEGERS if name in frame and len(frame)}
    # A median of counts may have a half.
    whole_numbers = [name for name, one in counts.items() if (one.dropna() % 1 == 0).all()]
    return frame.astype(dict.fromkeys(whole_numbers, "Int64"))


def whole(tables: pd.DataFrame) -> pd.DataFrame:
    """Returns what is of the tables over all conditions: those with the fewest names."""
    lengths = tables["table"].map(len) if len(tables) else None
    return tables if lengths is None else tables[lengths == lengths.min()]


def failure_of(case: Any, truth: str) -> str:  # noqa: ANN401  # a whole number, or pandas' NA
    """Returns the name of a failure: its number in Table I, or its notation."""
    return truth if pd.isna(case) else f"{case:2d}"


def label_of(rows: Sequence[Row]) -> str:
    """Returns the label of the score of rows of bodies, a return with the most, if that is one."""
    score, unit = rows[0].get("score") or "score", rows[0].get("unit") or ""
    limits = {row.get("return_most") if score == RETURN else None for row in rows}
    return score_label(score, unit, limits.pop() if len(limits) == 1 else None)


def outcomes_text(rows: Sequence[Row]) -> str:
    """Returns the outcomes of recoveries with their numbers as text, the most frequent first."""
    counts = Counter(row["outcome"] for row in rows if row.get("outcome"))
    return ", ".join(f"{number} {outcome}" for outcome, number in counts.most_common())
