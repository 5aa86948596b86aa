import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from selfmodel.arguments import fitted
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.errors import InputError
from selfmodel.logs.journal import OPTIONS
from selfmodel.logs.result_files import result_bytes
from selfmodel.report.recorded.logs_subject import subject_of_logs
from selfmodel.report.run_folder import is_run, subject_of_run
from selfmodel.report.subject import Subject


def test_the_subject_has_the_trials_and_diagnoses_of_the_run(run: Path, subject: Subject):
    result = json.loads((run / "result.json").read_text())

    assert [trial.plan.stage for trial in subject.trials] == ["before", "after", "recovery"]
    assert [diagnosis.trials for diagnosis in subject.diagnoses] == [1, 2]
    ranking = [(str(one.hypothesis), one.distance) for one in subject.diagnosis.ranked]
    assert ranking == [(one["hypothesis"], one["distance"]) for one in result["diagnosis"]]


def test_the_calibration_of_the_result_is_that_of_the_trials(subject: Subject):
    again = fitted(subject.robot, subject.healthy, 1)

    assert subject.calibration is not None
    assert np.array_equal(subject.calibration.parameters.factors, again.parameters.factors)
    assert np.array_equal(subject.calibration.deviations, again.deviations)
    assert subject.calibration.robot.mjcf == again.robot.mjcf
    assert subject.calibration.error == again.error


def test_the_losses_of_the_report_are_the_distances_of_the_run(subject: Subject):
    hypotheses = [one.hypothesis for one in subject.diagnosis.ranked]

    distances = subject.evidence.distances(hypotheses, subject.damaged)

    assert np.array_equal(distances, [one.distance for one in subject.diagnosis.ranked])


def test_a_run_that_goes_on_is_reported_without_its_result(run: Path, tmp_path: Path):
    shutil.copytree(run, tmp_path / "run")
    (tmp_path / "run" / "result.json").unlink()
    diagnoses = json.loads((run / "diagnoses.json").read_text())
    (tmp_path / "run" / "diagnoses.json").write_text(json.dumps(diagnoses[:1]))

    subject = subject_of_run(tmp_path / "run", threads=1)

    assert subject.result is None
    assert [trial.plan.name for trial in subject.damaged] == ["01-after"]


def test_a_run_without_calibration_is_reported_without_also_before_its_result(
    run: Path, tmp_path: Path
):
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("result.json"))
    (tmp_path / "run" / OPTIONS).write_bytes(result_bytes({"calibrated": False}))

    assert subject_of_run(tmp_path / "run", threads=1).calibration is None


def test_the_result_of_a_run_is_a_diagnosis_of_its_logs(run: Path, subject: Subject):
    logs = sorted((run / "trials").glob("*.mcap"), reverse=True)

    found = subject_of_logs(logs, run / "result.json", threads=1)

    assert found.diagnosis.to_dict() == subject.diagnosis.to_dict()
    assert [trial.path for trial in found.trials] == [trial.path for trial in subject.trials]
    assert found.calibration is not None
    assert found.calibration.to_dict() == subject.calibration.to_dict()


def test_another_comparator_than_that_of_the_recorded_distances_is_refused(
    run: Path, subject: Subject
):
    logs, result = sorted((run / "trials").glob("*.mcap")), run / "result.json"
    own, other = subject.comparator.name, FORWARD_DISPLACEMENT.name
    assert own != other
    assert subject_of_run(run, threads=1, comparator=own).comparator is subject.comparator

    refused = rf"result\.json has distances by the comparator {own}, and .* is {other}: leave"
    with pytest.raises(InputError, match=refused):
        subject_of_run(run, threads=1, comparator=other)
    with pytest.raises(InputError, match=refused):
        subject_of_logs(logs, result, threads=1, comparator=other)


def test_a_result_that_was_changed_by_hand_is_refused(run: Path, tmp_path: Path):
    shutil.copytree(run, tmp_path / "run")
    path = tmp_path / "run" / "result.json"
    path.write_text(path.read_text().replace('"seed": 0', '"seed": 1'))

    with pytest.raises(InputError, match="its digest is missing or wrong"):
        subject_of_run(tmp_path / "run")


@pytest.mark.parametrize(
    "values",
    [
        {"trials": 0},
        {"trials": 3},
        {
            "change": {
                "trial": "a",
                "index": 2,
                "time": 0.2,
                "earliest": 0.1,
                "latest": 0.3,
                "before": "intact",
                "after": "intact",
            }
        },
    ],
)
def test_a_diagnosis_of_trials_that_are_not_there_is_refused(
    run: Path, tmp_path: Path, values: dict
):
    shutil.copytree(run, tmp_path / "run")
    diagnoses = json.loads((run / "diagnoses.json").read_text())
    diagnoses[-1].update(values)
    (tmp_path / "run" / "diagnoses.json").write_text(json.dumps(diagnoses))

    with pytest.raises(InputError, match=r"diagnoses\.json: expected diagnoses of 1 to 2 trials"):
        subject_of_run(tmp_path / "run", threads=1)


def test_other_folders_are_no_runs(tmp_path: Path):
    assert not is_run(tmp_path)
    (tmp_path / "trials").mkdir()
    (tmp_path / "diagnoses.json").write_text("[]")
    with pytest.raises(InputError, match="a run with logs in trials, got none"):
        subject_of_run(tmp_path)
