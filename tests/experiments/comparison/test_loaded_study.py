"""Tests of studies that are loaded from a folder or a file of results."""

import dataclasses
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from selfmodel import experiments as selfmodel_experiments
from selfmodel.errors import InputError
from selfmodel.experiments.ablation import AblationRow, results as ablation_results
from selfmodel.experiments.baseline import results as baseline_results
from selfmodel.experiments.comparison import loaded_study
from selfmodel.experiments.comparison.loaded_study import LoadedStudy, load
from selfmodel.experiments.grid import FinishedPart
from selfmodel.experiments.paper import results as paper_results
from selfmodel.experiments.paper.plan import ON_ROBOT
from selfmodel.experiments.study.files import as_csv, as_dicts
from selfmodel.experiments.suite import results as suite_results
from selfmodel.experiments.suite.rows import SuiteRow
from selfmodel.settings import Settings
from tests.experiments.ablation.test_ablate import scored
from tests.experiments.baseline.test_results import row
from tests.helpers.command import selfmodel

ROOT = Path(__file__).parents[3]
ROWS = [
    dataclasses.replace(scored(name, case, 1.0, correct=name == "a"), next_trial="bank")
    for name in "ab"
    for case in (1, 3)
]


def parts(results: Mapping[str, Any], parameters: Mapping[str, Any]) -> list[FinishedPart]:
    """Finished parts with these results, by name, and nothing else that a study needs."""
    known = {"key": "run", "seed": 0, "path": Path("run.json"), "parameters": parameters}
    return [
        FinishedPart(
            **{
                field.name: {**known, "part": name, "result": result}.get(field.name, {})
                for field in dataclasses.fields(FinishedPart)
            }
        )
        for name, result in results.items()
    ]


TABLE = as_csv(AblationRow, ROWS)
BASELINE = as_dicts([row("oracle", [1.0])])[0]
RECOVERY = {
    "robot": "quadruped",
    "case": 1,
    "truth": "x",
    "seed": 0,
    "best": "x",
    "correct": True,
    "before": 1.0,
    "after": 0.0,
    "recovered": 1.0,
    "diverged": 0,
    "seconds": 1.0,
}
RESULTS: dict[str, dict[str, Any]] = {
    "ablate": {name: as_dicts([one for one in ROWS if one.comparator == name]) for name in "ab"},
    "baseline": {"oracle": as_dicts([row("oracle", [1.0])])[0]},
    "paper": {
        ON_ROBOT: {"evolution": []},
        "a": {
            "recoveries": [
                RECOVERY | {"comparator": "a", "compared_by": "a", "distinct_hypotheses": 1}
            ],
            "trials": [],
        },
    },
    "suite": {"recovery": [RECOVERY | {"verdict": "explained", "trials": 1}]},
}
"""Results of the parts of each kind of study."""


READERS = (loaded_study, ablation_results, baseline_results, paper_results, suite_results)
"""Modules that read the finished parts of a folder."""


@pytest.fixture
def load_kind(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[str], LoadedStudy]:
    """Loads a folder with the results of a kind of study."""

    def loaded(kind: str) -> LoadedStudy:
        settings = {"shared": {"settings": dataclasses.asdict(Settings())}}
        found = parts(RESULTS[kind], settings)
        for module in (
            loaded_study,
            ablation_results,
            baseline_results,
            paper_results,
            suite_results,
        ):
            monkeypatch.setattr(module, "finished", lambda _folder: iter(found))
        return load(tmp_path)

    return loaded


@pytest.mark.parametrize("kind", RESULTS)
def test_the_kind_of_a_folder_is_that_of_its_rows(
    load_kind: Callable[[str], LoadedStudy], kind: str
):
    found = load_kind(kind)

    assert found.kind == kind
    assert len(found.to_pandas()) == len(found.rows) == (4 if kind == "ablate" else 1)


def test_a_folder_is_loaded_as_a_data_frame_and_with_its_comparisons(
    load_kind: Callable[[str], LoadedStudy],
):
    found = load_kind("ablate")
    frame = found.to_pandas()

    assert sorted(found.rows, key=str) == sorted(ROWS, key=str)
    assert list(frame.columns) == [field.name for field in dataclasses.fields(AblationRow)]
    assert frame.groupby("comparator")["correct"].mean().to_dict() == {"a": 1, "b": 0}
    (pair,) = found.comparisons()
    assert (pair.first, pair.second, pair.runs) == ("a", "b", 2)
    assert [one.method for one in found.marginal_means()] == ["a", "b"]
    assert found.warnings() == ()


def test_a_csv_has_the_same_rows_as_the_folder_that_wrote_it(
    load_kind: Callable[[str], LoadedStudy], tmp_path: Path
):
    file = tmp_path / "results.csv"
    rows = load_kind("ablate").rows
    file.write_text(as_csv(AblationRow, rows), encoding="utf-8")

    assert load(file).rows == rows


@pytest.mark.process
def test_the_folder_of_an_ablation_is_loaded_and_compared(tmp_path: Path):
    done = selfmodel(
        *("ablate", "--robots", "quadruped", "--case", "1", "--kinds", "paper", "--seeds", "1"),
        *("--comparator", "forward-displacement,gait-pattern", "--steps", "40", "--trials", "1"),
        *("--population", "4", "--generations", "1", "--bank", str(ROOT / "benchmarks" / "bank")),
        *("--workers", "1", "--out", "study"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    compared = selfmodel("compare", "study", "--json", cwd=tmp_path)

    assert len(selfmodel_experiments.load(tmp_path / "study").rows) == 2
    assert json.loads(compared.stdout)["comparisons"][0]["n"] == 1
    assert (tmp_path / "study" / "comparison" / "comparisons.csv").exists()


def test_the_rows_of_baselines_are_one_json_object_per_line(tmp_path: Path):
    rows = [row(method, [1.0, 2.0]) for method in ("oracle", "random-search")]
    file = tmp_path / "results.jsonl"
    file.write_text("".join(json.dumps(one) + "\n" for one in as_dicts(rows)))
    found = load(file)

    assert (found.kind, list(found.rows)) == ("baseline", rows)


def test_the_published_rows_are_read_and_their_unequal_numbers_of_seeds_are_told():
    found = load(ROOT / "docs" / "comparators.csv")
    (warning,) = found.warnings()

    assert len(found.rows) == 6336
    assert "forward-displacement 432, gait-pattern 144" in warning


def test_a_row_of_a_version_without_a_column_is_read():
    (found,) = {type(one) for one in load(ROOT / "docs" / "robots.csv").rows}

    assert found is SuiteRow


@pytest.mark.parametrize("name", ["comparators", "robots"])
def test_a_row_of_a_version_that_did_not_record_the_repair_had_the_papers(name: str):
    rows = load(ROOT / "docs" / f"{name}.csv").rows

    assert {(row.repair, row.search) for row in rows} == {("paper", "ea")}


def test_a_row_whose_gaits_were_given_has_no_repair_also_in_its_file(tmp_path: Path):
    row = dataclasses.replace(scored("a", 1, 1.0, correct=True), repair=None, search=None)
    file = tmp_path / "results.csv"
    file.write_text(as_csv(AblationRow, [row]))

    assert [(one.repair, one.search) for one in load(file).rows] == [(None, None)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("robot,case\nant,1\n", "expected the rows of a study by ablate, baseline"),
        (
            as_csv(AblationRow, ROWS[:1]).replace(",true,", ",perhaps,"),
            "results.csv, line 2: expected a bool, got 'perhaps'",
        ),
        (
            as_csv(AblationRow, [dataclasses.replace(ROWS[0], gap=float("nan"))]),
            "results.csv, line 2: expected a finite number, got 'nan'",
        ),
        (TABLE.rstrip("\n") + ",7\n", "results.csv, line 5: expected 22 cells, got 23"),
        (TABLE + "quadruped,1\n", "results.csv, line 6: expected 22 cells, got 2"),
        (TABLE + '"quad', "results.csv: expected a CSV file, got unexpected end of data"),
        (TABLE + "\xff", "results.csv: expected results in UTF-8"),
        (as_csv(AblationRow, []), "results.csv: expected the rows of a study, got none"),
        ("", "expected the rows of a study by ablate, baseline"),
    ],
)
def test_a_file_of_something_else_is_refused(tmp_path: Path, content: str, message: str):
    file = tmp_path / "results.csv"
    file.write_bytes(content.encode("latin-1"))

    with pytest.raises(InputError, match=message):
        load(file)


def test_a_table_that_another_program_saved_again_is_read(tmp_path: Path):
    file = tmp_path / "results.csv"
    header, _, rest = TABLE.partition("\n")
    quoted = ",".join(f'"{name}"' for name in header.split(","))
    file.write_bytes(f"\ufeff{quoted}\n{rest}\n".replace("\n", "\r\n").encode())

    assert load(file).rows == tuple(ROWS)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("{", "line 2: expected a JSON object"),
        ("[]", "line 2: expected the row of a baseline with the keys best"),
        (BASELINE | {"best": []}, "line 2: expected best as .* got "),
        (BASELINE | {"upright": ["1"]}, "line 2: expected upright as .* got "),
        (BASELINE | {"best": [float("nan")]}, "line 2: expected best as .* got .NaN"),
        (BASELINE | {"gap": None}, "line 2: expected gap as float, got null"),
        (BASELINE | {"robot": 3}, "line 2: expected robot as str, got 3"),
    ],
)
def test_a_damaged_line_is_refused_by_its_number(
    tmp_path: Path, line: str | dict[str, Any], message: str
):
    file = tmp_path / "results.jsonl"
    second = line if isinstance(line, str) else json.dumps(line)
    file.write_text(f"{json.dumps(BASELINE)}\n{second}\n")

    with pytest.raises(InputError, match=message):
        load(file)


def test_a_place_without_a_study_is_an_error_that_says_so(tmp_path: Path):
    with pytest.raises(InputError, match="expected the folder of a study"):
        load(tmp_path / "missing")
    with pytest.raises(InputError, match="with a finished run, got none"):
        load(tmp_path)
