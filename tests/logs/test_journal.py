import dataclasses
import json
import math
from pathlib import Path

import pytest

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, canonical
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.faults.notation import parse
from selfmodel.logs import CorruptError
from selfmodel.logs.journal import (
    OPTIONS,
    add_diagnosis,
    is_calibrated,
    make_run,
    read_diagnoses,
    trial_order,
)
from selfmodel.logs.results import result_bytes
from selfmodel.robot.robot import Robot

HEAD = '[{"trials": 1, "ranked": [{"hypothesis": "intact", "distance": 1}], "intact_distance": 1, '
"""The beginning of a diagnosis of which nothing is wrong so far."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make_run(tmp_path / "run", calibrated=True)
    return tmp_path / "run"


def read(folder: Path, robot: Robot, *kinds: FaultKind) -> tuple[Diagnosis, ...]:
    return read_diagnoses(folder, HypothesisSpace(robot.anatomy, kinds))


def diagnosis(robot: Robot) -> Diagnosis:
    worse = parse("break:left_hip", robot.anatomy)
    ranked = (Candidate(INTACT, 0.1 + 0.2), Candidate(worse, math.inf))
    return Diagnosis(
        ranked,
        trials=3,
        intact_distance=0.1 + 0.2,
        indistinguishable=(worse, parse("jam:left_hip", robot.anatomy)),
        verdict="ambiguous",
        test="by eye",
    )


def test_a_journal_reads_the_diagnoses_that_it_recorded(folder: Path, biped: Robot):
    first = diagnosis(biped)
    second = dataclasses.replace(
        first,
        ranked=first.ranked[1:],
        trials=4,
        intact_distance=math.inf,
        indistinguishable=(),
        verdict="unexplained",
        unsearched=UnsearchedFault(parse("wind=12", biped.anatomy), "wind"),
        undetectable=(parse("break:left_hip+jam:right_hip", biped.anatomy),),
    )
    add_diagnosis(folder, first)
    add_diagnosis(folder, second)

    assert read(folder, biped) == (first, second)


def test_the_hundredth_trial_comes_after_the_ninety_ninth():
    paths = [Path(f"{name}-before.mcap") for name in ("100", "99", "09")]

    assert sorted(paths, key=trial_order) == paths[::-1]


@pytest.mark.parametrize("calibrated", [True, False])
def test_the_folder_states_from_the_beginning_whether_the_self_model_is_calibrated(
    tmp_path: Path, *, calibrated: bool
):
    make_run(tmp_path / "run", calibrated=calibrated)

    assert is_calibrated(tmp_path / "run") is calibrated


@pytest.mark.parametrize(
    "data", [b"", b"[]", result_bytes({"calibrated": "no"}), b'{"calibrated": true, "sha256": "0"}']
)
def test_damaged_options_are_refused(tmp_path: Path, data: bytes):
    (tmp_path / OPTIONS).write_bytes(data)

    with pytest.raises(InputError, match=r"options\.json: expected the options .* move it away"):
        is_calibrated(tmp_path)


@pytest.mark.parametrize("held", ["trials/old.mcap", "diagnoses.json", "notes.txt"])
def test_a_folder_that_holds_something_is_refused(tmp_path: Path, held: str):
    (tmp_path / held).parent.mkdir(exist_ok=True)
    (tmp_path / held).write_text("precious")
    with pytest.raises(InputError, match=f"holds another run or other files.*{held[:6]}"):
        make_run(tmp_path, calibrated=True)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [tmp_path / held]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}x",
        "[1]",
        '[{"trials": 1}]',
        '[{"trials": 1, "ranked": [{"hypothesis": "break:nose", "distance": 1}]}]',
        '[{"trials": 1, "ranked": [{"hypothesis": 3, "distance": 1}]}]',
        HEAD.replace('{"hypothesis": "intact", "distance": 1}', "")
        + '"rivals": [], "verdict": "explained", "test": ""}]',
        HEAD.replace('"distance": 1', '"distance": "nan"')
        + '"rivals": [], "verdict": "explained", "test": ""}]',
        HEAD.replace('"distance": 1', f'"distance": {10**400}')
        + '"rivals": [], "verdict": "explained", "test": ""}]',
        HEAD + '"rivals": ["break:nose"], "verdict": "explained", "test": ""}]',
        HEAD + '"rivals": 3, "verdict": "explained", "test": ""}]',
        HEAD + '"rivals": [], "verdict": "certain", "test": ""}]',
        HEAD + '"rivals": [], "verdict": ["explained"], "test": ""}]',
        HEAD + '"rivals": [], "test": ""}]',
        "[" * 100_000,
        "\xff",
    ],
)
def test_damaged_diagnoses_are_said_so(folder: Path, biped: Robot, text: str):
    (folder / "diagnoses.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(CorruptError, match=r"diagnoses\.json: expected the diagnoses of a run"):
        read(folder, biped)


def test_diagnoses_are_json_without_surprises(folder: Path, biped: Robot):
    add_diagnosis(folder, diagnosis(biped))
    [item] = json.loads((folder / "diagnoses.json").read_text())
    assert item["ranked"] == [
        {"hypothesis": "intact", "distance": 0.1 + 0.2},
        {"hypothesis": "break:left_hip", "distance": None},
    ]
    assert (item["verdict"], item["test"]) == ("ambiguous", "by eye")
    assert item["indistinguishable"] == ["break:left_hip", "jam:left_hip"]
    assert item["intact_distance"] == 0.1 + 0.2
    assert not list(folder.glob("*.part"))


def test_rivals_of_a_third_party_s_kind_are_read_back(biped: Robot, folder: Path):
    haul = FaultKind(name="haul")
    loaded = canonical([Fault(haul, ENVIRONMENT)], biped.anatomy)
    told = dataclasses.replace(diagnosis(biped), indistinguishable=(loaded,))
    add_diagnosis(folder, told)

    assert read(folder, biped, haul) == (told,)
