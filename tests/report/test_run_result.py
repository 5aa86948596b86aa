import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.logs.result_files import result_bytes
from selfmodel.report.run_folder import subject_of_run
from selfmodel.report.run_result import RESULT, read_run_result
from tests.cli.test_report import BANK

RUN_OF_0_1 = BANK.parents[2] / "tests" / "data" / "logs-0.1" / "recovery"


def changed(run: Path, folder: Path, change: Callable[[dict], object]) -> Path:
    """A copy of a run whose result was written with other values."""
    shutil.copytree(run, folder)
    values = json.loads((run / RESULT).read_text())
    for key in ("sha256", "made_with"):
        del values[key]
    change(values)
    (folder / RESULT).write_bytes(result_bytes(values))
    return folder


def test_the_result_has_the_values_of_the_file(run: Path):
    values = json.loads((run / RESULT).read_text())

    found = read_run_result(run)

    assert found is not None
    assert found.score.recovered == values["score"]["recovered"]
    assert found.trials["00-before"].score == values["trials"][0]["score"]
    assert found.trials["01-after"].predicted is None
    assert found.judgement in ("right", "wrong", "right except for severity")


@pytest.mark.parametrize(
    "change",
    [
        lambda values: values.pop("score"),
        lambda values: values.update(score=3),
        lambda values: values.update(gap=10**400),
        lambda values: values["score"].pop("unit"),
        lambda values: values.update(trials={"a": 1}),
        lambda values: values.update(kinds=None),
        lambda values: values.pop("correct"),
        lambda values: values["calibration"].pop("friction"),
        lambda values: values["calibration"].update(motor_gains=[1.0]),
        lambda values: values["calibration"].update(deviations=[[1.0]]),
        lambda values: values["calibration"].update(contact_damping=0),
        lambda values: values["calibration"].update(contact_stiffness=-1.0),
        lambda values: values["calibration"].update(contact_stiffness="hard"),
    ],
)
def test_a_result_without_what_a_report_needs_is_named(
    run: Path, tmp_path: Path, change: Callable[[dict], object]
):
    folder = changed(run, tmp_path / "run", change)

    with pytest.raises(InputError, match=r"result\.json: expected the result .*; move it away"):
        subject_of_run(folder, threads=1)


def test_the_contacts_of_a_calibration_are_those_of_the_file(run: Path, tmp_path: Path):
    hard = changed(
        run, tmp_path / "hard", lambda values: values["calibration"].update(contact_stiffness=2.0)
    )
    old = changed(
        run, tmp_path / "old", lambda values: values["calibration"].pop("contact_stiffness")
    )
    fits = [subject_of_run(folder, threads=1).calibration for folder in (hard, old)]

    assert [fit and fit.parameters.contact_stiffness for fit in fits] == [2.0, 1.0]
    assert [fit and fit.contacts for fit in fits] == [("contacts: stiffness x 2, damping x 1",), ()]


@pytest.mark.parametrize("key", ["comparator", "kinds"])
def test_a_report_imports_no_module_that_a_file_names(run: Path, tmp_path: Path, key: str):
    name = "antigravity:geohash"
    value = [name] if key == "kinds" else name
    folder = changed(run, tmp_path / "run", lambda values: values.update({key: value}))

    with pytest.raises(InputError, match="a report imports nothing that a file names"):
        subject_of_run(folder)


def test_a_comparator_that_is_named_by_hand_has_to_be_that_of_the_distances(
    run: Path, tmp_path: Path
):
    folder = changed(
        run, tmp_path / "run", lambda values: values.update(comparator="antigravity:geohash")
    )

    with pytest.raises(InputError, match="has distances by the comparator antigravity:geohash"):
        subject_of_run(folder, threads=1, comparator="gait-pattern")


def test_a_run_of_0_1_is_reported_without_its_result(tmp_path: Path):
    shutil.copytree(RUN_OF_0_1, tmp_path / "run")
    with pytest.raises(InputError, match="move it away, and the report is made of the logs"):
        subject_of_run(tmp_path / "run")
    (tmp_path / "run" / RESULT).unlink()

    assert subject_of_run(tmp_path / "run", threads=1).diagnoses
