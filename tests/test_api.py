"""Promises of the public functions: names, paths and objects are equal arguments; clear errors."""

import dataclasses
import json
from pathlib import Path
from unittest.mock import Mock

import pytest
from matplotlib.figure import Figure

import selfmodel
from selfmodel import arguments
from selfmodel.arguments import kinds_of
from selfmodel.comparators import FORWARD_DISPLACEMENT
from selfmodel.diagnosis.choice import ChosenComparator
from selfmodel.errors import InputError
from selfmodel.faults import BROKEN, JAMMED
from selfmodel.recovery import RecoveryLoop
from selfmodel.trials.trial import Trial
from tests.helpers.calibration import coarse
from tests.helpers.command import selfmodel as command
from tests.helpers.hostile import lacking

LOGS = Path(__file__).parent / "data" / "logs-0.1" / "recovery" / "trials"
BEFORE, AFTER = LOGS / "00-before.mcap", LOGS / "01-after.mcap"
SMALL = selfmodel.Settings(steps=60, trials=1, generations=1, diagnostic_search="ea").scaled(4)
KNEE = "break:front_left_knee"


def diagnosis(
    trials: object = AFTER, healthy: object = BEFORE, **options: object
) -> selfmodel.Diagnosis:
    """A small diagnosis without a calibration."""
    return selfmodel.diagnose(
        trials,
        healthy=healthy,
        **{"settings": SMALL, "calibrate": False, "kinds": "paper"}
        | {"comparator": FORWARD_DISPLACEMENT, **options},
    )


@pytest.fixture(scope="module")
def reference() -> selfmodel.Diagnosis:
    return diagnosis()


def test_logs_whose_stages_say_the_opposite_are_refused_and_others_are_not():
    told = f"{BEFORE.name} is to be explained and .*{AFTER.name}, given as healthy, after it: swap"
    with pytest.raises(InputError, match=told):
        diagnosis(BEFORE, AFTER)
    both = diagnosis([BEFORE, AFTER], LOGS / "02-recovery.mcap")
    assert both.trials == 2, "given as healthy, whatever the stage"


def test_a_diagnosis_begins_from_what_is_known_and_has_as_many_faults_as_its_genes(
    reference: selfmodel.Diagnosis,
):
    def ranked(found: selfmodel.Diagnosis) -> list[selfmodel.Hypothesis]:
        return [one.hypothesis for one in found.ranked]

    payload = selfmodel.parse_hypothesis("payload=0.2", "quadruped")  # of no searched kind
    assert payload not in ranked(reference)
    few = dataclasses.replace(SMALL, genes=1)
    for known in (payload, str(payload)):
        found = ranked(diagnosis(hypothesis=known, settings=few))
        assert payload in found
        assert {len(one) for one in found} == {0, 1}


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ("break:front_left_knee+friction=0.4", "at most 1 faults .* got 2 in break:.*: allow more"),
        ("neuron:0", "no diagnosis may propose neuron:0: leave it out"),
    ],
)
def test_a_hypothesis_from_which_no_search_can_begin_is_refused(known: str, said: str):
    with pytest.raises(InputError, match=said):
        diagnosis(hypothesis=known, settings=dataclasses.replace(SMALL, genes=1))


def recovered(folder: Path, **options: object) -> selfmodel.Recovery:
    """A small recovery without a calibration."""
    healthy = selfmodel.simulated_robot("quadruped")
    damaged = selfmodel.simulated_robot("quadruped", KNEE)
    given = {"settings": SMALL, "calibrate": False, "comparator": FORWARD_DISPLACEMENT}
    given |= {"kinds": "paper"}
    return selfmodel.recover(healthy, damaged, "quadruped", folder, **given | options)


@pytest.fixture(scope="module")
def recovery(tmp_path_factory: pytest.TempPathFactory) -> selfmodel.Recovery:
    return recovered(tmp_path_factory.mktemp("paper") / "run", repair="paper")


@pytest.mark.parametrize(
    ("after", "before"),
    [(str(AFTER), (BEFORE,)), ([AFTER, BEFORE], ())],
    ids=["a text and a sequence", "the stage decides"],
)
def test_a_log_is_a_path_a_text_or_in_a_sequence(
    after: object, before: object, reference: selfmodel.Diagnosis
):
    assert diagnosis(after, before) == reference


def test_trials_are_diagnosed_as_their_logs_are(reference: selfmodel.Diagnosis):
    before, after = (selfmodel.read_log(path).trial for path in (BEFORE, AFTER))
    robot = selfmodel.load_robot("quadruped")

    assert diagnosis(after, before, robot=robot) == reference
    assert diagnosis([after], BEFORE, robot="quadruped", seed=after.plan.seed) == reference


def test_kinds_are_names_or_objects():
    for kinds in ("break, jam", ["break", JAMMED], [BROKEN, JAMMED]):
        assert kinds_of(kinds) == (BROKEN, JAMMED)


def test_a_diagnosis_is_that_of_the_command_line(tmp_path: Path, reference: selfmodel.Diagnosis):
    done = command(
        *("diagnose", str(BEFORE), str(AFTER), "--no-calibrate", "--json"),
        *("--population", "4", "--generations", "1", "--comparator", "forward-displacement"),
        *("--kinds", "paper", "--diagnostic-search", "ea"),
        cwd=tmp_path,
    )

    assert json.loads(done.stdout)["diagnosis"] == reference.to_dict()["ranked"]
    assert json.loads(done.stdout)["verdict"] == reference.verdict


def test_a_recovery_is_readable_serialisable_and_a_table(recovery: selfmodel.Recovery):
    first, heading, *lines = repr(recovery).removesuffix(">").splitlines()
    rows, warned = lines[:3], lines[3:]

    assert first == f"<Recovery: {recovery.diagnosis.best}, {recovery.diagnosis.verdict}"
    assert heading.split() == f"trial best hypothesis so far {recovery.score.name}, m".split()
    assert [row.split()[0] for row in rows] == ["00-before", "01-after", "02-recovery"]
    values = [float(row.split()[2].rstrip(",")) for row in rows]
    assert values == pytest.approx(recovery.scores, abs=5e-4)
    assert warned == [f"  warning: {text}" for text in recovery.warnings]
    values = json.loads(json.dumps(recovery.to_dict(), allow_nan=False))
    assert values["displacement"]["after"] == recovery.after
    table = recovery.to_pandas().astype(object)
    assert table.where(table.notna(), None).to_dict("records") == values["trials"]
    assert all(Path(row["log"]).is_file() for row in values["trials"])


def labels(figure: Figure) -> list[str]:
    """The names in a figure of values by name."""
    (axes,) = figure.axes
    return [label.get_text() for label in axes.get_yticklabels()]


def test_results_have_figures_of_their_tables(
    recovery: selfmodel.Recovery, reference: selfmodel.Diagnosis
):
    assert labels(reference.plot()) == list(reference.to_pandas()["hypothesis"])
    (axes,) = recovery.plot().axes
    assert labels(recovery.plot()) == list(recovery.to_pandas()["trial"])
    assert [bar.get_width() for bar in axes.patches] == list(recovery.scores)
    with coarse():
        fit = selfmodel.calibrate(BEFORE, "quadruped")
    assert [one.strip("()") for one in labels(fit.plot())] == list(fit.to_pandas()["name"])


def test_a_trial_runs_and_replays_to_the_bit(tmp_path: Path):
    walk = selfmodel.evolve("quadruped", KNEE, settings=SMALL)
    physical = selfmodel.simulated_robot("quadruped", KNEE)
    path = tmp_path / "walk.mcap"
    trial = selfmodel.run_trial(physical, walk, path, robot="quadruped", steps=60)

    assert trial.plan.controller == walk
    for source in (trial, path, str(path)):
        assert selfmodel.replay(source, KNEE, "quadruped").identical
    assert not selfmodel.replay(trial, "intact", "quadruped").identical


def test_a_controller_evolves_equally_from_names_and_objects():
    robot = selfmodel.load_robot("quadruped")
    knee = selfmodel.parse_hypothesis(KNEE, robot)

    named = selfmodel.evolve("quadruped", KNEE, design="cpg", settings=SMALL, seed=1)

    assert named.design.name == "cpg"
    assert named == selfmodel.evolve(
        robot, knee, design=named.design, settings=SMALL, seed=1, threads=1
    )


@pytest.mark.parametrize("options", [{}, {"repair": "paper"}, {"search": "ea", "seed": 3}])
def test_a_controller_evolves_as_the_first_gait_of_a_recovery(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict
):
    monkeypatch.setattr(RecoveryLoop, "_diagnose", Mock(side_effect=KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        recovered(tmp_path / "run", kinds="jam", **options)
    first = selfmodel.read_log(tmp_path / "run" / "trials" / "00-before.mcap").trial

    assert first.plan.controller == selfmodel.evolve("quadruped", settings=SMALL, **options)


@pytest.mark.search
def test_a_repair_may_have_another_budget_than_the_diagnosis(
    tmp_path: Path, recovery: selfmodel.Recovery
):
    larger = selfmodel.RepairSettings(generations=2).scaled(6)
    other = recovered(tmp_path / "1", kinds="jam", repair="paper", repair_settings=larger)
    whole = selfmodel.Settings(generations=2, steps=60).scaled(6)
    gait = selfmodel.evolve("quadruped", settings=whole, repair="paper")

    assert other.trials[0].plan.controller == gait
    assert (recovery.repair_evaluations, other.repair_evaluations) == (2 * 4, 2 * 9)
    budget = ("--repair-generations", "2", "--repair-population", "6", "--json", "--out", "run")
    small = ("--steps", "60", "--trials", "1", "--generations", "1", "--population", "4")
    few = ("--kinds", "jam", "--comparator", "forward-displacement", "--no-calibrate")
    few += ("--diagnostic-search", "ea")
    named = ("recover", "quadruped", "--damage", KNEE, "--repair", "paper")
    done = command(*named, *small, *few, *budget, cwd=tmp_path)
    assert json.loads(done.stdout)["evaluations"]["repair"] == other.repair_evaluations
    result = json.loads((tmp_path / "run" / "result.json").read_text())
    assert result["repair_settings"]["population"] == 6
    assert result["settings"]["population"] == 4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"trials": []}, "expected at least one trial to explain, got none"),
        ({"trials": 3}, "expected trials or paths of their logs, got an object of type int"),
        ({"trials": [3]}, "expected trials or paths of their logs, got an object of type int"),
        ({"trials": "no.mcap"}, r"no\.mcap: expected a log file"),
        ({"trials": [AFTER, AFTER]}, "are the same log: give each log once"),
        ({"healthy": AFTER}, "are the same log: give each log once"),
        ({"comparator": "gait"}, "unknown comparator 'gait'"),
        ({"kinds": "brake"}, "unknown kind 'brake'"),
        ({"kinds": ["brake"]}, "unknown kind 'brake'"),
        ({"kinds": [3]}, "expected a FaultKind or its name, got an object of type int"),
        ({"kinds": []}, "expected at least one fault kind, got none: give kinds="),
        ({"robot": "octopod"}, "unknown robot 'octopod'"),
        ({"robot": 3}, 'expected a Robot, a name such as "quadruped" .* got .* type int'),
        ({"seed": -1}, "expected a whole number of 0 or above as seed, got -1"),
    ],
)
def test_a_wrong_argument_is_refused_in_a_sentence(options: dict[str, object], message: str):
    with pytest.raises(InputError, match=message):
        diagnosis(**options)


def test_a_log_in_place_of_its_trial_is_refused_with_the_remedy():
    with pytest.raises(InputError, match="type TrialLog: give its attribute trial"):
        diagnosis([selfmodel.read_log(AFTER)])


def test_a_trial_without_a_log_requires_a_robot():
    with pytest.raises(InputError, match="a trial without a log has no model of its robot: give"):
        diagnosis(selfmodel.read_log(AFTER).trial)


def test_an_unknown_design_and_a_negative_seed_are_refused():
    with pytest.raises(InputError, match="unknown kind of controller 'net'"):
        selfmodel.evolve("quadruped", design="net", settings=SMALL)
    with pytest.raises(InputError, match="expected a whole number of 0 or above as seed, got -1"):
        selfmodel.evolve("quadruped", settings=SMALL, seed=-1)


def test_a_replay_of_wrong_notation_is_refused():
    with pytest.raises(InputError, match="unknown kind of fault"):
        selfmodel.replay(BEFORE, "brake:front_left_knee", "quadruped")
    with pytest.raises(InputError, match=r"expected a Hypothesis or notation .* type int"):
        selfmodel.replay(BEFORE, 3, "quadruped")


@pytest.fixture
def blind() -> Trial:
    """A failing trial without the base's position."""
    return lacking(selfmodel.read_log(AFTER).trial, ("base_position",))


def test_a_comparator_that_cannot_judge_is_refused_before_the_calibration(
    blind: Trial, monkeypatch: pytest.MonkeyPatch
):
    fits: list[object] = []
    monkeypatch.setattr(arguments, "fitted", lambda *given: fits.append(given))
    healthy = selfmodel.read_log(BEFORE).trial

    with pytest.raises(
        InputError, match=r"needs base_position.*: give the comparator segment-prediction-onboard"
    ):
        selfmodel.diagnose(
            blind, healthy=healthy, robot="quadruped", comparator="segment-prediction"
        )
    assert not fits


@pytest.mark.search
def test_the_default_is_the_best_comparator_that_the_trials_allow_and_is_reported(blind: Trial):
    events: list[object] = []
    selfmodel.diagnose(
        blind, robot="quadruped", kinds="jam", settings=SMALL, on_event=events.append
    )

    (chosen,) = [event for event in events if isinstance(event, ChosenComparator)]
    assert chosen.comparator.name == "segment-prediction-onboard"
    assert "segment-prediction needs base_position" in chosen.reason
