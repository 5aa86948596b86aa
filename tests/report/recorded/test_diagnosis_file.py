import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from selfmodel.errors import InputError
from selfmodel.files import file_digest
from selfmodel.recovery.repertoire.model_digest import self_model_digest
from selfmodel.report.recorded import diagnosis_file
from selfmodel.report.recorded.diagnosis_file import read_diagnosis_file

COMMON = {"robot": "quadruped", "comparator": "x", "kinds": ["break"], "calibration": None}
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


@pytest.mark.parametrize("values", [PRINTED, RUN])
def test_logs_are_matched_by_name_in_the_order_of_the_diagnosis(
    tmp_path: Path, logs: list[Path], values: dict
):
    file = read_diagnosis_file(written(tmp_path, values))

    assert file.matched(logs) == ([logs[1]], [logs[0]])


@pytest.mark.parametrize(
    ("values", "names"),
    [
        (PRINTED, ("a/before.mcap", "a/after.mcap")),
        (RUN, ("trials/before.mcap", "trials/after.mcap")),
    ],
)
def test_a_log_with_the_name_and_another_content_is_refused(
    tmp_path: Path, logs: list[Path], values: dict, names: tuple[str, ...]
):
    digests = {name: file_digest(path) for name, path in zip(names, logs, strict=True)}
    file = read_diagnosis_file(written(tmp_path, {**values, "files": digests}))
    renamed = logs[0].rename(tmp_path / "walk.mcap")
    assert file.matched([renamed, logs[1]]) == ([logs[1]], [renamed])

    logs[1].write_text("another trial")

    with pytest.raises(InputError, match=r"a diagnosis of other logs: .* the same by SHA-256"):
        file.matched([renamed, logs[1]])


def test_logs_of_one_name_without_digests_are_told_apart_by_their_paths(tmp_path: Path):
    paths = [tmp_path / folder / "trial.mcap" for folder in ("b", "a", "healthy")]
    named = {"logs": [str(paths[1]), str(paths[0])], "intact": [str(paths[2])]}

    file = read_diagnosis_file(written(tmp_path, {**COMMON, **named}))

    assert file.matched(paths) == ([paths[1], paths[0]], [paths[2]])


def test_the_digest_of_each_file_is_computed_once(
    tmp_path: Path, logs: list[Path], monkeypatch: pytest.MonkeyPatch
):
    digests = {f"a/{path.name}": file_digest(path) for path in logs}
    file = read_diagnosis_file(written(tmp_path, {**PRINTED, "files": digests}))
    computed: list[Path] = []
    monkeypatch.setattr(
        diagnosis_file, "file_digest", lambda path: [computed.append(path), file_digest(path)][1]
    )

    file.matched(logs)

    assert sorted(computed) == sorted(logs)


def test_another_self_model_of_the_same_name_is_refused(tmp_path: Path):
    own = SimpleNamespace(name="quadruped", mjcf="<mujoco/>", control_timestep=0.01, assets={})
    other = SimpleNamespace(**{**vars(own), "mjcf": '<mujoco model="b"/>'})
    named = {**PRINTED, "model": self_model_digest(own)}
    file = read_diagnosis_file(written(tmp_path, named))
    earlier = read_diagnosis_file(written(tmp_path, PRINTED))

    file.check_self_model(own)
    earlier.check_self_model(other)

    assert file.notes() == ()
    assert "did not record the self-model" in earlier.notes()[0]
    with pytest.raises(InputError, match=r"another self-model of the name quadruped: .* --robot"):
        file.check_self_model(other)


def test_a_log_that_the_diagnosis_does_not_name_is_refused(tmp_path: Path, logs: list[Path]):
    file = read_diagnosis_file(written(tmp_path, {**PRINTED, "intact": []}))

    with pytest.raises(InputError, match=r"before\.mcap is no log of it"):
        file.matched(logs)


@pytest.mark.parametrize(
    "values",
    [
        [],
        {},
        {**PRINTED, "logs": []},
        {**PRINTED, "logs": 3},
        {**PRINTED, "files": []},
        {**PRINTED, "kinds": None},
        {**RUN, "trials": [{"log": "a.mcap"}]},
        {**PRINTED, "sha256": "0"},
    ],
)
def test_other_files_are_no_diagnosis(tmp_path: Path, values: object):
    with pytest.raises(InputError, match=r"found\.json: expected the output of .*leave --diag"):
        read_diagnosis_file(written(tmp_path, values))
