import dataclasses
import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from selfmodel.diagnosis.diagnosis import Candidate, Diagnosis, UnsearchedFault
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, canonical
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.kind import ENVIRONMENT, Fault, FaultKind
from selfmodel.faults.notation import parse
from selfmodel.logs import CorruptError, SchemaMismatchError, read_truth
from selfmodel.logs.journal import OPTIONS, FolderJournal, create_journal, is_calibrated
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.logs.results import result_bytes
from selfmodel.robot.robot import Robot
from selfmodel.settings import Settings
from selfmodel.trials.trial import Trial, TrialPlan
from tests.logs.conftest import MadeUpRobot, plan_of

HEAD = '[{"trials": 1, "ranked": [{"hypothesis": "intact", "distance": 1}], "intact_distance": 1, '
"""The beginning of a diagnosis of which nothing is wrong so far."""


Run = Callable[[TrialPlan], Trial]
"""A made-up robot's trial of a plan."""


@pytest.fixture
def journal(biped: Robot, tmp_path: Path) -> FolderJournal:
    return create_journal(tmp_path / "run", biped.anatomy, calibrated=True)


@pytest.fixture
def run(biped: Robot, journal: FolderJournal) -> Run:
    """Runs and logs a trial of the biped in the journal's folder."""
    runner = TrialRunner(journal.trials, biped, Settings(), {"before": "neuron:0"})
    return lambda plan: runner(MadeUpRobot(biped), plan)


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


def test_a_journal_reads_what_it_recorded(journal: FolderJournal, biped: Robot, run: Run):
    trials = [run(plan_of(biped, 30, f"{k:02d}-before")) for k in range(3)]
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
    journal.add(first)
    journal.add(second)
    for read, diagnoses in (
        journal.read(),
        FolderJournal(journal.folder, HypothesisSpace(biped.anatomy, ())).read(),
    ):
        assert [trial.plan for trial in read] == [trial.plan for trial in trials]
        assert diagnoses == (first, second)
    assert sorted(path.name for path in (journal.folder / "trials").iterdir()) == [
        "00-before.mcap",
        "01-before.mcap",
        "02-before.mcap",
    ]
    assert read_truth(trials[0].path) == "neuron:0"


def test_the_hundredth_trial_comes_after_the_ninety_ninth(
    journal: FolderJournal, biped: Robot, run: Run
):
    for name in ("100-before", "99-before", "09-before"):
        run(plan_of(biped, 3, name))
    names = [trial.plan.name for trial in journal.read()[0]]
    assert names == ["09-before", "99-before", "100-before"]


@pytest.mark.parametrize("calibrated", [True, False])
def test_the_folder_states_from_the_beginning_whether_the_self_model_is_calibrated(
    biped: Robot, tmp_path: Path, *, calibrated: bool
):
    create_journal(tmp_path / "run", biped.anatomy, calibrated=calibrated)

    assert is_calibrated(tmp_path / "run") is calibrated


@pytest.mark.parametrize(
    "data", [b"", b"[]", result_bytes({"calibrated": "no"}), b'{"calibrated": true, "sha256": "0"}']
)
def test_damaged_options_are_refused(tmp_path: Path, data: bytes):
    (tmp_path / OPTIONS).write_bytes(data)

    with pytest.raises(InputError, match=r"options\.json: expected the options .* move it away"):
        is_calibrated(tmp_path)


@pytest.mark.parametrize("held", ["trials/old.mcap", "diagnoses.json", "notes.txt"])
def test_a_folder_that_holds_something_is_refused(biped: Robot, tmp_path: Path, held: str):
    (tmp_path / held).parent.mkdir(exist_ok=True)
    (tmp_path / held).write_text("precious")
    with pytest.raises(InputError, match=f"holds another run or other files.*{held[:6]}"):
        create_journal(tmp_path, biped.anatomy, calibrated=True)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [tmp_path / held]


def test_a_run_of_another_robot_is_refused(
    journal: FolderJournal, biped: Robot, run: Run, quadruped: Robot
):
    run(plan_of(biped, 3))
    with pytest.raises(SchemaMismatchError, match="it is of the robot 'biped'"):
        FolderJournal(journal.folder, HypothesisSpace(quadruped.anatomy, ())).read()


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
def test_damaged_diagnoses_are_said_so(journal: FolderJournal, text: str):
    (journal.folder / "diagnoses.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(CorruptError, match=r"diagnoses\.json: expected the diagnoses of a run"):
        journal.read()


def test_diagnoses_are_json_without_surprises(journal: FolderJournal, biped: Robot):
    journal.add(diagnosis(biped))
    [item] = json.loads((journal.folder / "diagnoses.json").read_text())
    assert item["ranked"] == [
        {"hypothesis": "intact", "distance": 0.1 + 0.2},
        {"hypothesis": "break:left_hip", "distance": None},
    ]
    assert (item["verdict"], item["test"]) == ("ambiguous", "by eye")
    assert item["indistinguishable"] == ["break:left_hip", "jam:left_hip"]
    assert item["intact_distance"] == 0.1 + 0.2
    assert not list(journal.folder.glob("*.part"))


def test_rivals_of_a_third_party_s_kind_are_read_back(biped: Robot, tmp_path: Path):
    haul = FaultKind(name="haul")
    loaded = canonical([Fault(haul, ENVIRONMENT)], biped.anatomy)
    journal = create_journal(tmp_path / "run", biped.anatomy, [haul], calibrated=True)
    told = dataclasses.replace(diagnosis(biped), indistinguishable=(loaded,))
    journal.add(told)

    assert journal.read()[1] == (told,)
