"""Tables of studies: summaries with intervals, files in every format, figures with their counts."""

import io
import itertools
import math
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from selfmodel.diagnosis.diagnosis import to_json
from selfmodel.errors import InputError
from selfmodel.studies import figures, tables as module
from selfmodel.studies.comparisons import compare
from selfmodel.studies.rows import KINDS, frame_of, outcomes_of
from selfmodel.studies.statistics import Interval
from selfmodel.studies.tables import (
    FORMATS,
    ablation_scores,
    check_format,
    csv_bytes,
    suite_results,
    suite_summaries,
    table_files,
    table_of,
)
from selfmodel.style import figure_style, look, read_style
from tests.helpers.study_rows import body, diagnosis

TABLE = table_of(
    "made",
    [{"name": "a|b_1", "n": 3, "share": Interval(0.5, 0.25, math.nan), "ok": True}],
    [{"name": "a|b_1", "n": "3", "share": "0.5 ÷ 50 %"}],
    texts=1,
)


def scored(comparator: str, case: int, seconds: float, *, correct: bool) -> dict:
    truth = f"the failure of case {case}"
    return diagnosis(comparator, case=case, truth=truth, seconds=seconds, correct=correct)


def test_time_is_compared_on_the_runs_that_both_have():
    rows = [scored("forward-displacement", case, 2.0, correct=case > 7) for case in range(10)]
    rows += [scored("other", case, 3.0, correct=True) for case in range(5, 15)]
    rows += [scored("other", 20, 1000.0, correct=True)]
    ours, other = ablation_scores(rows)

    assert (ours["right"], ours["runs"], ours["correct"].estimate) == (2, 10, 0.2)
    assert ours["correct"].low == pytest.approx(0.0567, abs=1e-4)
    assert ours["time"].estimate == 1
    assert other["time"].estimate == other["time"].low == 1.5
    assert ours["recovery"] is None


def test_summaries_are_medians_and_count_outcomes():
    rows = [body(), body(1, before=-1.0, regained=None, outcome="no effect", correct=False)]
    rows += [body(2, before=4.0, regained=None, outcome="fell", upright_best_trial=False)]
    rows += [body(3, before=2.0, regained=-0.25, outcome="not better", case=2, truth="break:y")]
    rows += [body(4, case=None, truth="friction=0.4", displacement_after=None)]
    none = {"robot": "b", "case": 1, "truth": "", "seed": 0, "reason": "no limb of two joints"}
    rows += [dict.fromkeys(KINDS["suite"].columns) | none]
    case, other, damage, single, lacking = suite_summaries(rows)

    keys = [(one["case"], one["truth"]) for one in (case, other, damage, single, lacking)]
    assert keys == [(1, "break:x"), (2, "break:y"), (None, "friction=0.4"), (None, ""), (1, "")]
    assert (case["right"], case["runs"], case["upright_best_trial"]) == (2, 3, 2)
    assert case["upright_before"] is None, "tables of earlier versions lack it"
    assert case["before"] == 2.0
    assert (case["regained"], case["outcomes"]) == (0.5, "1 better, 1 no effect, 1 fell")
    assert case["correct"].low < 2 / 3 < case["correct"].high
    assert single["runs"] == 4
    assert single["regained"] == 0.125
    assert (lacking["runs"], lacking["correct"], lacking["regained"]) == (0, None, None)
    assert lacking["reason"] == "no limb of two joints"


def test_the_table_of_bodies_says_score_steps_returns_falls_and_what_was_not_run(
    monkeypatch: pytest.MonkeyPatch,
):
    ends = {"return_before": 50.0, "return_after": 5.0, "return_best_trial": 40.0}
    found = {**ends, "return_most": 199, "control_steps": 200, "score": "return", "unit": ""}
    found |= {"before": 50.0, "after": 5.0, "best_trial": 40.0, "displacement_before": -1.0}
    found |= {"upright_before": True, "upright_after": False, "regained": 0.7777}
    ours = body(robot="quadruped", **found | {"return_most": None})
    fell = {"upright_best_trial": False, "regained": None, "outcome": "fell"}
    rows = [body(**found), body(1, **found | fell), ours]
    none = {"robot": "fish", "case": 1, "truth": "", "reason": "it has no limb of two joints"}
    rows += [dict.fromkeys(KINDS["suite"].columns) | none]
    tables = {None: rows, "trials": []}
    monkeypatch.setattr(module, "study_rows", lambda _kind, _folder, table=None: tables[table])
    results = suite_results(Path("unused"))
    first, second = results.shown.shown.to_dict("records")

    assert first["return before"] == "50.000 of 199"
    assert first["return best trial"] == "40.000 of 199"
    assert (first["loss regained, %"], first["outcome"]) == ("78", "1 better, 1 fell")
    assert first["upright"] == "2, 0, 1 of 2", "before, after, best trial"
    assert first["displacements, m"] == "-1.000, -, -"
    assert second["return best trial"] == "40.000", "speeds have no largest sum"
    assert "The score is return, of trials of 200 control steps" in results.legend
    assert "1,000 rewards of up to 1, of which these trials have 199" in results.legend
    assert "The rewards of quadruped are speeds, m/s, whose sum has no largest" in results.legend
    assert "quadruped is selfmodel's own robot; that of dm_control is suite-quadruped." in (
        results.legend
    )
    assert "gait before" not in results.legend, "no gait fell before the failure"
    assert results.legend.endswith("Not run: fish, case 1: it has no limb of two joints")
    assert results.tables[0].records["reason"].iloc[-1] == "it has no limb of two joints"
    assert {"results.csv", "trials.csv", "figures/bodies.png"} < results.files.keys()


def test_the_table_of_bodies_says_which_gaits_fell_before_the_failure(
    monkeypatch: pytest.MonkeyPatch,
):
    fell, stood = {"upright_before": False}, {"upright_before": True}
    rows = [body(0, **fell), body(1, **stood), body(0, case=2, truth="break:y", **fell)]
    rows += [body(robot="b", **stood), body(robot="c", **fell), body(robot="d")]
    tables = {None: rows, "trials": []}
    monkeypatch.setattr(module, "study_rows", lambda _kind, _folder, table=None: tables[table])
    legend = suite_results(Path("unused")).legend

    assert "The gait before the failure fell in 2 of 3 runs of a, 1 of 1 runs of c: a" in legend
    assert "--repair-generations" in legend
    assert "selfmodel's own robot" not in legend
    assert "speeds" not in legend


def test_a_fall_is_a_cross_in_the_figure_of_bodies():
    fell = [body(1, upright_best_trial=False), body(2, upright_after=False)]
    figure = figures.by_body([body(), *fell])
    drawn = {
        (line.get_label(), line.get_marker()): len(line.get_xdata())
        for line in figure.axes[0].lines
        if not line.get_label().startswith("_child0")
    }
    crosses = sum(n for (label, marker), n in drawn.items() if marker == "x" and label != "fell")

    assert [drawn[key] for key in drawn if key[0] in ("before", "after", "best trial")] == [3, 2, 2]
    assert crosses == 2
    assert ("fell", "x") in drawn
    assert figure.axes[0].get_yticklabels()[0].get_text() == "a, break:x (n = 3)"


def test_every_format_has_its_file():
    files = {name: table_files([TABLE], name) for name in FORMATS}
    latex = files["latex"]["made.tex"].decode()
    parquet = pd.read_parquet(io.BytesIO(files["parquet"]["made.parquet"]))

    head, values = files["csv"]["made.csv"].decode().splitlines()
    assert (head, values) == ("name,n,share,share_low,share_high,ok", "a|b_1,3,0.5,0.25,,true")
    assert files["markdown"]["made.md"].decode().splitlines() == [
        "| name | n | share |",
        "| --- | ---: | ---: |",
        r"| a\|b_1 | 3 | 0.5 ÷ 50 % |",
    ]
    assert r"a|b\_1 & 3 & 0.5 ÷ 50 \%" in latex
    assert all(rule in latex for rule in (r"\toprule", r"\midrule", r"\bottomrule", "{lrr}"))
    assert parquet["share_low"].tolist() == [0.25]
    assert table_files([table_of("none", [])], "csv") == {}
    exact = diagnosis("a", distance=0.1 + 0.2, case=None)
    assert b"0.30000000000000004" in csv_bytes(frame_of([exact], KINDS["ablate"].columns))
    with pytest.raises(InputError, match="unknown table format 'xls'"):
        check_format("xls")


def test_a_minus_and_a_bound_are_mathematics_in_latex_and_a_hyphen_is_none():
    shown = [{"difference": "segment-prediction -0.051 (-.2 to 0.2)", "p": "< 0.0001*"}]
    latex = table_files([table_of("a", [{"n": 1}], shown)], "latex")["a.tex"].decode()

    assert "segment-prediction $-$0.051 ($-$.2 to 0.2) & $<$ 0.0001*" in latex


def test_a_style_file_is_added_to_the_built_in_one_or_refused(tmp_path: Path):
    path = tmp_path / "own.mplstyle"
    path.write_text("axes.prop_cycle: cycler('color', ['red', 'blue'])\n")
    with figure_style(path):
        assert [look(number)["color"] for number in range(3)] == ["red", "blue", "red"]
        assert mpl.rcParams["legend.frameon"] is False
    assert look(0)["color"] != "red"
    for text, said in (("font.size: large?", "font.size"), ("", "got no setting")):
        path.write_text(text)
        with pytest.raises(InputError, match=f"expected column, page, or a style file.*{said}"):
            read_style(path)


def test_what_is_unknown_is_null_in_json():
    assert to_json({"a": [math.nan, Interval(1.0, math.nan, 2.0)]}) == {
        "a": [None, {"estimate": 1.0, "low": None, "high": 2.0}]
    }


def test_the_figures_of_an_ablation_have_the_numbers_of_diagnoses_and_one_look_a_comparator():
    rows = [
        diagnosis(name, robot=robot, gap=gap, case=case, truth=str(case), seed=seed)
        for name, robot, gap, case, seed in itertools.product(
            "ab", ("quadruped", "hexapod"), (0.0, 0.1), (1, 2), range(3)
        )
        if (name, robot) != ("b", "hexapod") and (name == "a" or seed == 0)
    ]
    scores = ablation_scores(rows)
    gap = figures.by_gap(scores)
    cases = figures.by_case("quadruped", 1, [r for r in rows if r["robot"] == "quadruped"])
    hexapod, quadruped = ([bar[0].get_color() for bar in axes.containers] for axes in gap.axes)

    names = {"gap", "cases-hexapod-1", "cases-quadruped-1"}
    files = figures.of_ablation(rows, scores)
    assert set(files) == {f"{name}.{end}" for name in names for end in ("png", "pdf", "svg")}
    assert files["gap.png"].startswith(b"\x89PNG")
    assert figures.of_ablation([], []) == {}
    assert [text.get_text() for text in gap.legends[0].get_texts()] == ["a (n = 6)", "b (n = 2)"]
    labels = [text.get_text() for text in cases.axes[0].get_yticklabels()]
    assert labels == ["a (n = 3)", "b (n = 1)"]
    assert hexapod == quadruped[:1] != quadruped[1:]


@pytest.mark.parametrize("width", [3.5, None])
def test_twelve_methods_differ_in_look_and_their_legend_takes_no_height_from_the_axes(
    tmp_path: Path, width: float | None
):
    (style := tmp_path / "own.mplstyle").write_text(
        "axes.prop_cycle: cycler('color', ['red', 'blue', 'green'])\n"
        + (f"figure.figsize: {width}, 3\nfont.size: 8\n" if width else "")
    )
    names = ("forward-displacement", "segment-prediction", "sensor-history", "dtw")
    rows = [
        diagnosis(name, diagnostic_search=search, gap=gap)
        for name, search, gap in itertools.product(
            names, ("ea", "stepwise", "ea+stepwise"), (0, 0.1)
        )
    ]
    heights = {}
    with figure_style(style):
        for few in (True, False):
            own = [r for r in rows if r["comparator"] == "dtw" or not few]
            figure = figures.by_gap(ablation_scores(own))
            figure.draw_without_rendering()
            heights[few] = figure.axes[0].get_window_extent().height
    legend = figure.legends[0].get_window_extent()
    lines = [bar[0] for bar in figure.axes[0].containers]

    assert heights[False] > 0.9 * heights[True]
    assert legend.x0 >= 0
    assert legend.x1 <= figure.bbox.width
    assert legend.y1 < figure.axes[0].get_window_extent().y0
    assert len({(line.get_color(), line.get_marker()) for line in lines}) == 12
    assert lines[0].get_linestyle() != lines[1].get_linestyle()
    assert len({line.get_color() for line in lines[:3]}) == 1


def test_a_pair_of_methods_has_its_difference_its_runs_and_a_filled_marker_if_it_is_better():
    rows = [diagnosis(n, seed=seed, correct=n == "a") for n in "a$^{" for seed in range(12)]
    found = compare(outcomes_of("ablate", rows))
    (axes,) = figures.paired_differences(found).axes
    markers = [line for line in axes.get_lines() if line.get_marker() == "o"]

    assert all("n = 12" in label.get_text() for label in axes.get_yticklabels())
    filled = sum(marker.get_markerfacecolor() != "white" for marker in markers)
    assert filled == found["better"].notna().sum() == 3
    ends = {tuple(map(float, line.get_xdata())) for line in axes.get_lines()}
    assert set(zip(found["difference_low"], found["difference_high"], strict=True)) <= ends
    assert all(figures.of_comparisons(found).values())  # "$^{" is no formula
    assert np.isfinite([marker.get_xdata() for marker in markers]).all()
