"""What a report is about, from the folder of a run or from the file of a diagnosis of logs."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.errors import InputError
from selfmodel.files import file_digest
from selfmodel.logs.journal import OPTIONS
from selfmodel.logs.results import DiagnosisResult, as_json, result_bytes
from selfmodel.recovery.repertoire import self_model_digest
from selfmodel.report.subject import DiagnosisFile, Subject, is_run, subject_of_logs, subject_of_run

pytestmark = pytest.mark.usefixtures("coarse_calibration")


def test_a_run_has_its_result_trials_and_diagnoses_with_the_losses_of_the_run(
    run: Path, subject: Subject
):
    result = json.loads((run / "result.json").read_text())

    hypotheses = [one.hypothesis for one in subject.diagnosis.ranked]
    distances = [one.distance for one in subject.diagnosis.ranked]

    content = {key: value for key, value in result.items() if key not in ("made_with", "sha256")}
    assert json.loads(json.dumps(as_json(subject.result))) == content
    assert [trial.plan.stage for trial in subject.trials] == ["before", "after", "recovery"]
    assert [diagnosis.trials for diagnosis in subject.diagnoses] == [1, 2]
    assert distances == [one["distance"] for one in result["diagnosis"]]
    assert list(map(str, hypotheses)) == [one["hypothesis"] for one in result["diagnosis"]]
    assert np.array_equal(subject.losses.distances(hypotheses, subject.damaged), distances)
    assert json.loads(json.dumps(subject.calibration.to_dict())) == result["calibration"]


@pytest.mark.parametrize("calibrated", [True, False])
def test_a_run_that_is_not_finished_is_reported_without_its_result(
    run: Path,
    subject: Subject,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    *,
    calibrated: bool,
):
    fit = subject.calibration  # which takes seconds
    monkeypatch.setattr("selfmodel.report.subject.fitted", lambda *_given: fit)
    shutil.copytree(run, tmp_path / "run", ignore=shutil.ignore_patterns("result.json"))
    diagnoses = json.loads((run / "diagnoses.json").read_text())
    (tmp_path / "run" / "diagnoses.json").write_text(json.dumps(diagnoses[:1]))
    (tmp_path / "run" / OPTIONS).write_bytes(result_bytes({"calibrated": calibrated}))

    found = subject_of_run(tmp_path / "run", threads=1)

    assert found.result is None
    assert [trial.plan.name for trial in found.damaged] == ["01-after"]
    assert found.calibration is (subject.calibration if calibrated else None)


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
    assert subject_of_run(run, threads=1, comparator=own).comparator is subject.comparator

    for subject_with in (
        lambda: subject_of_run(run, threads=1, comparator=other),
        lambda: subject_of_logs(logs, result, threads=1, comparator=other),
    ):
        with pytest.raises(InputError, match=rf"result\.json .* {own}, and .* {other}"):
            subject_with()


def changed(run: Path, folder: Path, change: Callable[[dict], object]) -> Path:
    """A copy of a run whose result was written with other values."""
    shutil.copytree(run, folder)
    values = json.loads((run / "result.json").read_text())
    for key in ("sha256", "made_with"):
        del values[key]
    change(values)
    (folder / "result.json").write_bytes(result_bytes(values))
    return folder


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda values: values.pop("score"), "score"),
        (lambda values: values["trials"][0].update(score="far"), r"\$\.trials\[0\]\.score"),
        (lambda values: values.update(kinds=None), r"\$\.kinds"),
        (lambda values: values["calibration"].update(motor_gains=[1.0]), "factors"),
        (lambda values: values["calibration"].update(contact_damping=0), "contact_damping"),
    ],
)
def test_a_result_without_what_a_report_needs_is_refused_by_its_key(
    run: Path, tmp_path: Path, change: Callable[[dict], object], named: str
):
    folder = changed(run, tmp_path / "run", change)

    with pytest.raises(InputError, match=rf"result\.json.*{named}"):
        subject_of_run(folder, threads=1)
    path = folder / "result.json"
    path.write_text((run / "result.json").read_text().replace('"seed": 0', '"seed": 1'))
    with pytest.raises(InputError, match=r"result\.json.* digest"):
        subject_of_run(folder)


@pytest.mark.parametrize("key", ["comparator", "kinds"])
def test_a_report_imports_no_module_that_a_file_names(run: Path, tmp_path: Path, key: str):
    value: object = "antigravity:geohash" if key == "comparator" else ["antigravity:geohash"]
    folder = changed(run, tmp_path / "run", lambda values: values.update({key: value}))

    with pytest.raises(InputError, match=r"antigravity:geohash.* imports nothing"):
        subject_of_run(folder, threads=1)


CHANGE = {"trial": "a", "index": 2, "time": 0.2, "earliest": 0.1, "latest": 0.3}
CHANGE |= {"before": "intact", "after": "intact"}


@pytest.mark.parametrize("values", [{"trials": 0}, {"trials": 3}, {"change": CHANGE}])
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


COMMON = {
    "robot": "quadruped",
    "model": "0",
    "comparator": "x",
    "kinds": ["break"],
    "calibration": None,
    "diagnosis": [{"hypothesis": "intact", "distance": 1}],
    "verdict": "intact",
    "indistinguishable": [],
    "undetectable": [],
    "test": "none",
    "intact_distance": 1.0,
}
PRINTED = {**COMMON, "logs": ["a/after.mcap"], "intact": ["a/before.mcap"]}
RUN = {
    **COMMON,
    "trials": [
        {"log": "run/trials/before.mcap", "stage": "before"},
        {"log": "run/trials/after.mcap", "stage": "after"},
    ],
}


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    """Two files in place of logs: one from before a failure, and one from after it."""
    paths = [tmp_path / "before.mcap", tmp_path / "after.mcap"]
    for path in paths:
        path.write_text(path.stem)
    return paths


def written(folder: Path, values: object) -> Path:
    path = folder / "found.json"
    path.write_text(json.dumps(values))
    return path


@pytest.mark.parametrize(
    ("values", "names"),
    [
        (PRINTED, ("a/before.mcap", "a/after.mcap")),
        (RUN, ("trials/before.mcap", "trials/after.mcap")),
    ],
)
def test_logs_are_matched_by_their_digests_in_the_order_of_the_diagnosis(
    tmp_path: Path, logs: list[Path], values: dict, names: tuple[str, str]
):
    digests = {name: file_digest(path) for name, path in zip(names, logs, strict=True)}
    file = DiagnosisFile(written(tmp_path, {**values, "files": digests}), DiagnosisResult)
    renamed = logs[0].rename(tmp_path / "walk.mcap")
    assert file.matched([renamed, logs[1]]) == ([logs[1]], [renamed])
    for others in ([logs[1]], [renamed, logs[1], written(tmp_path, {})]):
        with pytest.raises(InputError, match=r"other logs: .* SHA-256"):
            file.matched(others)

    logs[1].write_text("another trial")

    with pytest.raises(InputError, match=r"other logs: .* SHA-256"):
        file.matched([renamed, logs[1]])


def test_another_self_model_of_the_same_name_is_refused(tmp_path: Path):
    own = SimpleNamespace(name="quadruped", mjcf="<mujoco/>", control_timestep=0.01, assets={})
    other = SimpleNamespace(**{**vars(own), "mjcf": '<mujoco model="b"/>'})
    file = DiagnosisFile(
        written(tmp_path, {**PRINTED, "model": self_model_digest(own)}), DiagnosisResult
    )

    file.check_self_model(own)

    with pytest.raises(InputError, match=r"another self-model of the name quadruped: .* --robot"):
        file.check_self_model(other)


@pytest.mark.parametrize(
    "values",
    [
        [],
        {},
        {**PRINTED, "logs": []},
        {**PRINTED, "files": []},
        {**PRINTED, "diagnosis": []},
        {**RUN, "trials": [{"log": "a.mcap"}]},
        {**PRINTED, "sha256": "0"},
    ],
)
def test_other_files_are_no_diagnosis(tmp_path: Path, values: object):
    with pytest.raises(InputError, match=r"found\.json: .*leave --diagnosis"):
        DiagnosisFile(written(tmp_path, values), DiagnosisResult)
