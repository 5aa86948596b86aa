"""Tables of studies: summaries with intervals, and files in every format."""

import io
import math

import pandas as pd
import pytest

from selfmodel.errors import InputError
from selfmodel.studies.rows import KINDS, frame_of
from selfmodel.studies.statistics import Interval
from selfmodel.studies.tables import (
    FORMATS,
    ablation_scores,
    as_json,
    check_format,
    csv_bytes,
    suite_summaries,
    summary_table,
    table_files,
)
from tests.helpers.study_rows import body, diagnosis

PAPERS = "forward-displacement"
TABLE = summary_table(
    "made",
    [{"name": "a|b_1", "n": 3, "share": Interval(0.5, 0.25, math.nan), "ok": True}],
    [{"name": "a|b_1", "n": "3", "share": "0.5 ÷ 50 %"}],
    texts=1,
)


def scored(comparator: str, case: int, seconds: float, *, correct: bool) -> dict:
    truth = f"the failure of case {case}"
    return diagnosis(comparator, case=case, truth=truth, seconds=seconds, correct=correct)


def test_time_is_compared_on_the_runs_that_both_have():
    rows = [scored(PAPERS, case, 2.0, correct=case > 7) for case in range(10)]
    rows += [scored("other", case, 3.0, correct=True) for case in range(5, 15)]
    rows += [scored("other", 20, 1000.0, correct=True)]
    ours, other = ablation_scores(rows)

    assert (ours["right"], ours["runs"], ours["correct"].estimate) == (2, 10, 0.2)
    assert ours["correct"].low == pytest.approx(0.0567, abs=1e-4)
    assert ours["time"].estimate == 1
    assert other["time"].estimate == other["time"].low == 1.5
    assert ours["recovery"] is None


def test_summaries_are_medians_and_leave_out_ratios_that_mean_nothing():
    rows = [body(), body(1, before=-1.0, recovered=3.0, correct=False)]
    rows += [body(2, before=4.0, recovered=4.0, upright=False)]
    case, single = suite_summaries(rows)

    assert (case["case"], single["case"]) == (1, None)
    assert (case["right"], case["runs"], case["upright"]) == (2, 3, 2)
    assert case["before"] == 2.0
    assert case["recovery"] == 0.75  # of 0.5 and 1
    assert case["correct"].low < 2 / 3 < case["correct"].high


def test_a_csv_has_all_digits_lower_case_flags_and_empty_cells():
    rows = [diagnosis("a", distance=0.1 + 0.2, case=None)]
    line = csv_bytes(frame_of(rows, KINDS["ablate"].columns)).decode().splitlines()[1]

    assert line.startswith("quadruped,,break:front_left_knee,0.05,0,bank,a,1,intact,true,0.3000000")


def test_every_format_has_its_file():
    files = {name: table_files([TABLE], name) for name in FORMATS}
    markdown = files["markdown"]["made.md"].decode().splitlines()
    latex = files["latex"]["made.tex"].decode()
    parquet = pd.read_parquet(io.BytesIO(files["parquet"]["made.parquet"]))

    assert (
        files["csv"]["made.csv"]
        == b"name,n,share,share_low,share_high,ok\na|b_1,3,0.5,0.25,,true\n"
    )
    assert markdown == [
        "| name | n | share |",
        "| --- | ---: | ---: |",
        r"| a\|b_1 | 3 | 0.5 ÷ 50 % |",
    ]
    assert r"a|b\_1 & 3 & 0.5 ÷ 50 \%" in latex
    assert all(rule in latex for rule in (r"\toprule", r"\midrule", r"\bottomrule", "{lrr}"))
    assert parquet["share_low"].tolist() == [0.25]
    assert table_files([summary_table("none", [], [], 0)], "csv") == {}


def test_an_unknown_format_is_refused_before_the_work():
    check_format(None)
    for name in FORMATS:
        check_format(name)
    with pytest.raises(InputError, match="unknown table format 'xls'"):
        check_format("xls")


def test_what_is_unknown_is_null_in_json():
    assert as_json({"a": [math.nan, Interval(1.0, math.nan, 2.0)]}) == {
        "a": [None, {"estimate": 1.0, "low": None, "high": 2.0}]
    }
