"""Rows of studies from their files and folders, and what they compare."""

import math
from pathlib import Path

import pandas as pd
import pytest

from selfmodel.errors import InputError
from selfmodel.studies.comparisons import compare
from selfmodel.studies.rows import KINDS, frame_of, load, methods_of, outcomes_of, whole
from selfmodel.studies.tables import csv_bytes
from tests.helpers.study_rows import body, diagnosis, recovery, rival

DATA = Path(__file__).parents[2] / "docs" / "results" / "data"
TABLES = {
    "ablate": [diagnosis("a"), diagnosis("b", correct=False, case=None, distance=0.1 + 0.2)],
    "suite": [body(), body(1, upright_best_trial=None)],
    "paper": [recovery(), recovery(comparator="b")],
}
PUBLISHED = {
    "ablate": ("comparators", "degrees", "environments", "next-trial", "onboard", "verdicts"),
    "suite": ("bodies-gap", "robots"),
    "rivals": ("baselines",),
}


def written(folder: Path, name: str, rows: list[dict]) -> Path:
    path = folder / "results.csv"
    path.write_bytes(b"\xef\xbb\xbf" + csv_bytes(frame_of(rows, KINDS[name].columns)))
    return path


@pytest.mark.parametrize("name", TABLES)
def test_rows_of_a_file_are_those_that_were_written(name: str, tmp_path: Path):
    found = load(written(tmp_path, name, TABLES[name]))

    assert found.kind == name
    assert list(found.rows.columns) == KINDS[name].columns
    for row, values in zip(found.rows.to_dict("records"), TABLES[name], strict=True):
        for column, value in values.items():
            assert row[column] == value if value is not None else pd.isna(row[column]), column


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind, names in PUBLISHED.items() for name in names]
)
def test_published_tables_are_read(kind: str, name: str):
    (path,) = DATA.glob(f"{name}.*")

    study = load(path)
    lines = repr(study).removesuffix(">").splitlines()[1:]
    (axes,) = study.plot().axes

    assert study.kind == kind
    if "correct" in study.rows:
        told = [line.partition(" (") for line in lines]
        right, runs = zip(*(one.split()[-4:-1:2] for one, _, _ in told), strict=True)
        assert sum(map(int, right)) == study.rows["correct"].sum()
        for number, (_, _, verdicts) in zip(runs, told, strict=True):  # none in old tables
            counts = [int(one.split()[0]) for one in verdicts.rstrip(")").split(", ") if one]
            assert sum(counts) in {0, int(number)}
        assert len(lines) == len(axes.get_yticklabels())
    else:
        assert len(axes.get_yticklabels()) == len(whole(study.marginal_means()))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("true", "perhaps", "true or false in the column correct"),
        (",0.05,", ",wide,", "numbers in the column gap.*wide"),
        ("robot,case", "robot,casus", "got the columns robot, casus"),
        ("quadruped,1", 'quadruped,"1', "expected the rows of a study"),
    ],
)
def test_a_file_that_is_no_table_of_a_study_is_refused(
    old: str, new: str, words: str, tmp_path: Path
):
    path = written(tmp_path, "ablate", [diagnosis("a"), diagnosis("b")])
    path.write_text(path.read_text().replace(old, new, 1))

    with pytest.raises(InputError, match=f"{path}: .*{words}"):
        load(path)
    renamed = path.rename(path.with_suffix(".mcap"))
    with pytest.raises(InputError, match="another ending"):
        load(renamed)


def test_a_place_without_a_study_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match="with a finished run, got none"):
        load(tmp_path)
    with pytest.raises(InputError, match=r"the folder of a study, its results\.csv"):
        load(tmp_path / "none.csv")
    with pytest.raises(InputError, match="got none: run the study first"):
        load(written(tmp_path, "ablate", []))
    path = tmp_path / "results.jsonl"
    path.write_text("{")
    with pytest.raises(InputError, match=f"{path}: expected the rows of a study"):
        load(path)


def test_comparators_are_compared_over_all_gaps_and_at_each():
    rows = [diagnosis(name, gap=gap, correct=name == "a") for name in "ab" for gap in (0.0, 0.05)]
    found = compare(outcomes_of("ablate", rows))

    assert [table[2:] for table in found["table"]] == [(), ("gap 0",), ("gap 0.05",)]
    assert found["n"].tolist() == [2, 1, 1]
    assert set(found["first"]) == {"a"}
    assert [table[1] for table in whole(found)["table"]] == ["1 trial"]
    alone = outcomes_of("ablate", [diagnosis("a"), diagnosis("b")])
    assert len(set(alone["table"])) == 1, "a study at one gap is compared once"


@pytest.mark.parametrize(
    ("given", "methods"),
    [
        ([("dtw:DTW", "dtw", "ea"), ("b", "b", "ea")], ["dtw", "b"]),
        ([("dtw:DTW", None, None), ("b", math.nan, None)], ["dtw:DTW", "b"]),
        ([("a:X", "dtw", "ea"), ("b:Y", "dtw", "ea")], ["a:X", "b:Y"]),
        ([("a:X", "b", "ea"), ("b", "b", "ea")], ["a:X", "b"]),
        (
            [("dtw:DTW", "dtw", "ea"), ("dtw:DTW", "dtw", "stepwise")],
            ["dtw with ea", "dtw with stepwise"],
        ),
    ],
)
def test_a_method_is_named_by_its_comparators_object_and_by_its_search_among_several(
    given: list[tuple], methods: list[str]
):
    columns = ("comparator", "comparator_name", "diagnostic_search")
    assert methods_of([dict(zip(columns, row, strict=True)) for row in given]) == methods


def test_the_papers_comparators_are_compared_by_diagnosis_and_by_recovery():
    rows = [recovery(recovered=1.5), recovery(comparator="b", correct=False, recovered=1.0)]
    found = compare(outcomes_of("paper", rows))

    assert [table[1] for table in found["table"]] == ["right", "recovered, m"]
    assert found["difference"].tolist() == [1, pytest.approx(0.5)]


def test_methods_are_compared_in_metres_and_by_the_oracle_of_the_same_physical_robot():
    rows = [rival("oracle", [2.0, 2.0]), rival("oracle", [4.0, 4.0] * 25, seed=1)]
    rows += [rival("random-search", [1.0, 2.0, 0.0], seed=seed) for seed in (0, 1, 2)]
    found = outcomes_of("rivals", rows)
    values = {(row.table[1:], row.seed): row.value for row in found.itertuples()}

    assert set(found["method"]) == {"random-search"}
    assert values[("after 1 trial", "÷ oracle"), 0] == 0.5
    assert values[("after 3 trials", "÷ oracle"), 1] == 0.5
    assert (("after 3 trials", "÷ oracle"), 2) not in values  # no oracle
    assert values[("after 3 trials", "m"), 2] == 2
    # No table after more trials than a method had, of the oracle apart.
    assert {table[1] for table in found["table"]} == {"after 1 trial", "after 3 trials"}
