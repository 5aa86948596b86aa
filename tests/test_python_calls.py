"""Promises of the Python functions: a plain call is accepted, any other refused in a sentence."""

import dataclasses
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

import selfmodel
from selfmodel import RepairSettings, Settings, studies
from selfmodel.comparators import FORWARD_DISPLACEMENT, SENSOR_SERIES
from selfmodel.controllers.controller import Controller
from selfmodel.errors import InputError
from selfmodel.faults import JAMMED
from selfmodel.logs.controllers import save_controller
from selfmodel.physical.interface import PhysicalRobot
from selfmodel.recovery import ENERGY, Recovery, make_repertoire
from selfmodel.robot.designs import network_for
from selfmodel.robot.robot import Robot
from selfmodel.simulation import ClosedLoop
from selfmodel.tasks import entry
from selfmodel.testing import check_comparator, check_fault_kind
from selfmodel.trials.trial import Trial

SMALL = Settings(steps=60, generations=1, trials=1).scaled(4)
BY_EA = dataclasses.replace(SMALL, diagnostic_search="ea")
TWO = dataclasses.replace(SMALL, trials=2)

MINE = """
import dataclasses
from selfmodel.comparators import SENSOR_SERIES
from selfmodel.faults.joints import Jammed
from selfmodel.recovery import DISPLACEMENT
from selfmodel.recovery.cma_es import CmaEs

class Dtw:
    name = "dtw"

    def prepare(self, trial):
        return SENSOR_SERIES.prepare(trial)

DTW = Dtw()
SCORE = dataclasses.replace(DISPLACEMENT, name="mine", of=lambda *_: DISPLACEMENT.of(*_))
"""

MADE = """
import calls_plugins
from selfmodel.recovery.next_trial import by_disagreement
from selfmodel.robot.designs import network_for

OTHER = calls_plugins.Dtw()

def choice(loop):
    return by_disagreement(loop)

def wide(robot, hidden):
    return network_for(robot, 5)
"""


class Place(NamedTuple):
    """What the calls name: a robot, its trial and its controller, and a module of plug-ins."""

    robot: Robot
    walk: Controller
    trial: Trial
    physical: PhysicalRobot
    damaged: PhysicalRobot
    numbers: Callable[[], int]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Place:
    folder = tmp_path_factory.mktemp("calls")
    (folder / "calls_plugins.py").write_text(MINE, encoding="utf-8")
    (folder / "calls_made.py").write_text(MADE, encoding="utf-8")
    robot = selfmodel.load_robot("quadruped")
    design = network_for(robot)
    walk = Controller(design, np.linspace(-1, 1, design.weights))
    save_controller(folder / "walk.npz", walk)
    physical = selfmodel.simulated_robot(robot)
    trial = selfmodel.run_trial(physical, walk, folder / "walk.mcap", robot=robot, steps=60)
    damaged = selfmodel.simulated_robot(robot, "break:front_left_knee")
    return Place(robot, walk, trial, physical, damaged, iter(range(1000)).__next__)


@pytest.fixture(autouse=True)
def here(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = Path(place.trial.path).parent
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(str(folder))


def mine(name: str, module: str = "calls_plugins") -> object:
    return getattr(__import__(module), name)


def ran(place: Place, **options: object) -> tuple[object, ...]:
    given = {"physical": place.physical, "controller": place.walk, "robot": place.robot, "steps": 5}
    given |= {"path": f"{place.numbers()}.mcap", **options}
    trial = selfmodel.run_trial(**given)
    return trial.plan.steps, trial.plan.seed, trial.trajectory["base_position"].tobytes()


def evolved(place: Place, **options: object) -> bytes:
    found = selfmodel.evolve(place.robot, **{"settings": SMALL, **options})
    return found.genome.tobytes()


def diagnosed(**options: object) -> str:
    given = {"trials": "walk.mcap", "comparator": "forward-displacement", "kinds": "jam"}
    given |= {"settings": BY_EA, "calibrate": False, **options}
    return str(selfmodel.diagnose(given.pop("trials"), **given))


def recovered(place: Place, **options: object) -> tuple[object, ...]:
    given = {"comparator": FORWARD_DISPLACEMENT, "kinds": "jam", "repair": "paper"}
    given |= {"settings": BY_EA, "calibrate": False, "healthy": place.physical}
    given |= {"folder": f"run-{place.numbers()}", **options}
    found: Recovery = selfmodel.recover(
        given.pop("healthy"), place.damaged, place.robot, given.pop("folder"), **given
    )
    return tuple(trial.trajectory["commands"].tobytes() for trial in found.trials)


def planned(**options: object) -> list[tuple[str, str]]:
    given = {"robots": ["quadruped"], "cases": [1], "comparators": ["sensor-series"]}
    given |= {"gaps": [0.0], "seeds": [0], "settings": SMALL, "folder": Path("study"), **options}
    study = studies.ablation(given.pop("folder"), **given)
    return [(cell.name, cell.place) for cell in study.cells()]


def run_study(**options: object) -> object:
    study = studies.ablation("never", robots="quadruped", cases=1, comparators="sensor-series")
    return study.run(**options)


def filled(place: Place, **options: object) -> object:
    given = {"robot": place.robot, "design": place.walk.design, "evaluate": lambda _: None}
    return make_repertoire(**{**given, "steps": 20, "seed": 0, **options})


@cache
def environment() -> object:
    return entry("quadruped").suite["walk"]()


def driven(place: Place, **options: object) -> tuple[object, ...]:
    found = selfmodel.EnvironmentRobot(**{"env": environment(), "robot": place.robot, **options})
    return set(found.signals), tuple(found.critical), found.silent_neurons


Call = Callable[[Place], object]

ACCEPTED: dict[str, tuple[Call, Call]] = {
    "a whole float as a setting": (lambda _: Settings(steps=1e3), lambda _: Settings(steps=1000)),
    "a numpy number as a setting": (
        lambda _: repr(Settings(steps=np.int64(100))),
        lambda _: repr(Settings(steps=100)),
    ),
    "a robot to load": (lambda p: selfmodel.load_robot(p.robot), lambda p: p.robot),
    "a hypothesis to parse": (
        lambda p: selfmodel.parse_hypothesis(selfmodel.Hypothesis(), p.robot),
        lambda p: selfmodel.parse_hypothesis("intact", p.robot),
    ),
    "names of kinds in a notation": (
        lambda p: selfmodel.parse_hypothesis("jam:front_left_knee", p.robot, ["jam"]),
        lambda p: selfmodel.parse_hypothesis("jam:front_left_knee", p.robot),
    ),
    "a float as steps": (lambda p: ran(p, steps=5.0), ran),
    "a controller's file": (lambda p: ran(p, controller="walk.npz"), ran),
    "the name of a score": (
        lambda p: evolved(p, score="energy"),
        lambda p: evolved(p, score=ENERGY),
    ),
    "a score of a module": (lambda p: evolved(p, score="calls_plugins:SCORE"), evolved),
    "one controller as seeds": (
        lambda p: evolved(p, seeds="walk.npz"),
        lambda p: evolved(p, seeds=[p.walk]),
    ),
    "names of kinds": (lambda _: diagnosed(kinds=["jam"]), lambda _: diagnosed(kinds=JAMMED)),
    "a comparator of a module": (
        lambda _: diagnosed(comparator="calls_plugins:DTW"),
        lambda _: diagnosed(comparator=mine("DTW")),
    ),
    "no healthy trials": (lambda _: diagnosed(healthy=None), lambda _: diagnosed()),
    "the names of a score and of a next trial": (
        lambda p: recovered(p, score="displacement", next_trial="repair"),
        recovered,
    ),
    "a list of one trial": (
        lambda p: repr(selfmodel.replay(["walk.mcap"], "intact", p.robot)),
        lambda p: repr(selfmodel.replay(p.trial, "intact", "quadruped")),
    ),
    "a comparator of mine in a study": (
        lambda _: planned(comparators=[mine("DTW")]),
        lambda _: planned(comparators=["calls_plugins:DTW"]),
    ),
    "a comparator of a class of another module": (
        lambda _: planned(comparators=[mine("OTHER", "calls_made")]),
        lambda _: planned(comparators=["calls_made:OTHER"]),
    ),
    "a choice of the next trial in a study": (
        lambda _: planned(next_trial=mine("choice", "calls_made"), settings=TWO),
        lambda _: planned(next_trial="calls_made:choice", settings=TWO),
    ),
    "a design of a module": (
        lambda p: evolved(p, design="calls_made:wide"),
        lambda p: evolved(p, design=network_for(p.robot, 5)),
    ),
    "a search of a module": (
        lambda p: recovered(p, repair="robust", search="calls_plugins:CmaEs"),
        lambda p: recovered(p, repair="robust", search=mine("CmaEs")),
    ),
    "one comparator in a study": (
        lambda _: planned(comparators=SENSOR_SERIES),
        lambda _: planned(),
    ),
    "a text as the folder of a study": (lambda _: planned(folder="study"), lambda _: planned()),
    "kinds of a study": (
        lambda _: planned(kinds=["jam", JAMMED]),
        lambda _: planned(kinds="jam"),
    ),
    "one gap, seed, case and robot": (
        lambda _: planned(gaps=0, seeds=1, cases=1, robots="quadruped"),
        lambda _: planned(),
    ),
    "scores of a study": (
        lambda _: planned(score=mine("SCORE")),
        lambda _: planned(score="calls_plugins:SCORE"),
    ),
    "one signal and one neuron": (
        lambda p: driven(p, signals="sensors", critical="sensors", silent_neurons=1),
        lambda p: driven(p, signals=["sensors"], critical=["sensors"], silent_neurons=[1]),
    ),
    "a generator of signals": (
        lambda p: driven(
            p, signals=iter(["sensors"]), critical=iter(["sensors"]), silent_neurons=np.int64(1)
        ),
        lambda p: driven(p, signals=["sensors"], critical=["sensors"], silent_neurons=[1]),
    ),
    "every difference": (
        lambda p: repr(selfmodel.replay(p.trial, "intact", p.robot, tolerance=np.inf)),
        lambda p: repr(selfmodel.replay(p.trial, "intact", p.robot)),
    ),
    "an entry of a folder": (
        lambda _: [
            selfmodel.read_log(one).trial.plan.name
            for one in os.scandir()
            if one.name == "walk.mcap"
        ],
        lambda _: ["walk"],
    ),
    "a set, whose order is another in each process": (
        lambda _: planned(robots={"quadruped", "hexapod"}, gaps=0),
        lambda _: planned(robots=["hexapod", "quadruped"]),
    ),
    "numbers in arrays without axes": (
        lambda _: (planned(gaps=np.array(0.0), seeds=np.array(1)), Settings(steps=np.array(20))),
        lambda _: (planned(), Settings(steps=20)),
    ),
    "a share as on the command line": (
        lambda _: planned(seeds=range(4), only="2/3"),
        lambda _: planned(seeds=[1]),
    ),
    "the defaults of a study": (
        lambda _: planned(seeds=np.arange(1), cases=1, gaps=0.0, repair="robust"),
        lambda _: planned(),
    ),
    "no settings of a study": (
        lambda _: planned(settings=None),
        lambda _: planned(settings=Settings()),
    ),
    "a list of signals": (
        lambda _: ClosedLoop(record=["sensors"]).record,
        lambda _: ["sensors"],
    ),
    "a large seed": (
        lambda p: evolved(p, seed=10**400 + 1) != evolved(p, seed=10**400),
        lambda _: True,
    ),
    "a comparator alone": (lambda _: check_comparator("calls_plugins:DTW"), lambda _: None),
    "the name of a kind": (lambda _: check_fault_kind("jam", "quadruped"), lambda _: None),
}

REFUSED: dict[str, tuple[Call, str]] = {
    "a fraction": (lambda _: Settings(steps=10.5), "whole number as steps, got 10.5: give one"),
    "a bool": (lambda _: Settings(trials=True), "whole number as trials, got True"),
    "a number of 400 digits": (
        lambda _: Settings(steps=10**400),
        "steps must be at most 1000000, got 10000",
    ),
    "a float of 400 digits": (
        lambda _: Settings(mutation=10**400),
        "finite number as mutation, got 10000",
    ),
    "a bool as a watchdog": (
        lambda p: driven(p, watchdog=True, stop=lambda: None),
        "a watchdog needs a time of more than 0 s",
    ),
    "a case": (lambda _: planned(cases=-1), "unknown case of quadruped '-1'"),
    "a text": (lambda _: Settings(mutation="0.1"), "finite number as mutation, got '0.1'"),
    "infinity": (lambda _: Settings(trials=float("inf")), "whole number as trials, got inf"),
    "no robot": (lambda _: selfmodel.load_robot(5), "expected a Robot, a name such as"),
    "no log": (lambda p: selfmodel.read_log(p.trial), "expected the path of a log, got .* Trial$"),
    "a stage": (lambda p: ran(p, stage="bfore"), "unknown stage 'bfore': did you mean before"),
    "a robot's name": (
        lambda p: recovered(p, healthy="quadruped"),
        "expected a physical robot, .* got 'quadruped': give selfmodel.simulated_robot",
    ),
    "a mapping": (
        lambda p: evolved(p, settings={"steps": 20}),
        "expected settings such as .* dict",
    ),
    "a thread": (lambda p: evolved(p, threads=-1), "of 0 or above as threads, got -1"),
    "a class": (
        lambda _: diagnosed(comparator=mine("Dtw")),
        "'Dtw' is no comparator: .* not a class, .* got a class: <class",
    ),
    "comparators with commas": (
        lambda _: planned(comparators="dtw,segment-prediction"),
        r'comparators in a list, got .dtw,.*: give \["dtw", "segment-prediction"\]$',
    ),
    "no kinds of a study": (lambda _: planned(kinds=[]), "at least one fault kind, got none: give"),
    "half a check": (
        lambda p: check_comparator(SENSOR_SERIES, simulated=p.trial.trajectory),
        "expected the trial of simulations, got these alone: give both or none",
    ),
    "no answer": (lambda _: diagnosed(calibrate="no"), "expected True or False as calibrate"),
    "a folder": (lambda p: recovered(p, folder=5), "the path of a new or empty folder, got .* int"),
    "a tolerance": (
        lambda p: selfmodel.replay(p.trial, "intact", p.robot, tolerance=float("nan")),
        "of 0 or above as tolerance, got nan",
    ),
    "a gap": (lambda _: planned(gaps=["0.1"]), "real number as gaps, got '0.1': .* gaps=0.05"),
    "a seed": (lambda _: planned(seeds=[-1]), "of 0 or above as seeds, got -1"),
    "no seed": (lambda _: planned(seeds=0), "of 1 or above as seeds, got 0: give .* seeds=4"),
    "a robot in a study": (lambda p: planned(robots=[p.robot]), "names of robots .* got .* Robot"),
    "a score without a name": (
        lambda _: planned(score=dataclasses.replace(ENERGY, name="stranger")),
        "no variable of an imported module: .* or as package.module:object",
    ),
    "a repertoire": (
        lambda p: filled(p, robot="quadruped"),
        "robot of type Robot, got .quadruped.: give selfmodel.load_robot",
    ),
    "a batch": (lambda p: filled(p, batch=0), "of 1 or above as batch, got 0"),
    "a signal": (lambda p: driven(p, signals=["sensor"]), "unknown signal 'sensor': did you mean"),
    "patience": (lambda p: driven(p, patience=1.5), "as patience, got 1.5"),
    "an array": (lambda _: Settings(steps=np.array([20])), r"as steps, got array\(\[20\]\)"),
    "a truth in an array": (lambda _: Settings(trials=np.array(True)), "as trials, got True"),
    "a share of none": (lambda _: planned(only=(0, 1)), r"only=\(2, 8\), got \(0, 1\)"),
    "a share of three": (lambda _: planned(only=3), "such as 2/8, in Python .* got 3"),
    "settings of a repair": (
        lambda _: planned(repair_settings=60),
        r"settings of the repair such as selfmodel.RepairSettings\(generations=60\), got .* int",
    ),
    "the budget of a repair": (
        lambda p: recovered(p, repair_settings={"generations": 60}),
        "settings of the repair such as .* dict",
    ),
    "settings of a run": (
        lambda p: recovered(p, repair_settings=Settings(steps=99)),
        "settings of the repair such as selfmodel.RepairSettings.*, got .* Settings",
    ),
    "a repair in numbers": (
        lambda _: RepairSettings(population=10),
        r"population must exceed the 50 survivors.*scaled\(10\)",
    ),
    "a repair": (lambda p: evolved(p, repair="robst"), "unknown repair 'robst': did you mean"),
    "a layer around nothing": (lambda p: evolved(p, repair="compensate"), "needs a controller"),
    "a search": (lambda p: evolved(p, search="cma"), "unknown search 'cma': did you mean cma-es"),
    "no repertoire": (lambda p: evolved(p, search="repertoire"), "got the search repertoire"),
    "an observer of a fit": (
        lambda p: selfmodel.calibrate(p.trial, p.robot, on_event="print"),
        "expected a function as on_event, got 'print': leave it out",
    ),
    "an observer of a study": (lambda _: run_study(on_event=5), "a function as on_event, got 5"),
    "no workers": (lambda _: run_study(workers=-1), "of 1 or above as workers, got -1"),
    "an executor": (lambda _: run_study(executor="dask"), "an Executor of .* type str"),
    "a study to load": (lambda _: selfmodel.load(5), "the path of a study, got .* int"),
    "a definition": (lambda _: studies.read_study(5), "the path of a study, such .* int"),
    "cases": (lambda _: planned(cases="one"), "expected a whole number as cases, got 'one'"),
    "no robots": (lambda _: planned(robots=[]), "at least one of the robots of an ablation"),
    "no failures": (lambda _: planned(damages=5, cases=[]), "failures in notation, got .* int"),
    "a bank": (lambda _: planned(bank=5), "the path of a folder of gaits, got .* int"),
    "neurons": (
        lambda _: studies.suite("study", bodies="quadruped", cases=9, neurons="3"),
        "whole number as neurons, got '3'",
    ),
    "a function of observations": (
        lambda p: driven(p, observe=5),
        "expected a function as observe, got 5",
    ),
    "a number as a choice": (
        lambda p: recovered(p, next_trial=3),
        "3 is no choice of the next trial: expected a function",
    ),
    "a class as a design": (
        lambda p: evolved(p, design="calls_plugins:Dtw"),
        "no kind of controller: expected a function of the arguments robot, hidden, got .*Dtw",
    ),
    "a policy as a design": (
        lambda p: evolved(p, design="calls_made:choice"),
        "'calls_made:choice' is no kind .*, got the function choice .*; a policy .* network = ",
    ),
    "a trajectory to follow in an ablation": (
        lambda _: planned(score="tracking"),
        "the score tracking follows a gait, and .* evolves its gaits: give bank=",
    ),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_a_call_whose_meaning_is_plain_is_the_canonical_call(name: str, place: Place):
    call, canonical = ACCEPTED[name]

    assert call(place) == canonical(place)


@pytest.mark.parametrize("name", REFUSED)
def test_another_call_is_refused_in_a_sentence(name: str, place: Place):
    call, sentence = REFUSED[name]

    with pytest.raises(InputError, match=sentence) as refused:
        call(place)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "call",
    [
        lambda _: selfmodel.calibrate("walk.mcap", "hexapod"),
        lambda p: selfmodel.replay(p.trial, "break:front_left_knee", "hexapod"),
        lambda _: diagnosed(robot="hexapod"),
        lambda p: diagnosed(trials=p.trial, healthy="walk.mcap", robot="hexapod"),
    ],
)
def test_a_trial_of_another_robot_is_refused_by_its_parts(call: Call, place: Place):
    sentence = r"hexapod is another robot than that of \S*walk.mcap: it has 12 sensors, the other 8"
    with pytest.raises(InputError, match=sentence):
        call(place)


@pytest.mark.parametrize("at", ["healthy", "damaged"])
def test_a_physical_robot_of_another_self_model_is_refused_before_it_moves(at: str, place: Place):
    other = selfmodel.simulated_robot("hexapod")
    sentence = "quadruped is another robot than the physical robot hexapod: it has 8 sensors"
    with pytest.raises(InputError, match=sentence):
        selfmodel.recover(
            **{"healthy": place.physical, "damaged": place.damaged, at: other},
            robot=place.robot,
            folder="other",
        )
    assert not Path("other").exists()
    with pytest.raises(InputError, match=sentence):
        ran(place, physical=other)


@pytest.mark.parametrize("wrong", [{"next_trial": "reppair"}, {"comparator": "dtww"}])
def test_a_refused_recovery_leaves_no_folder(place: Place, wrong: dict[str, str]):
    with pytest.raises(InputError, match="unknown"):
        recovered(place, folder="refused", **wrong)
    assert not Path("refused").exists()


def test_a_comparator_of_a_script_is_no_comparator_of_other_processes(
    monkeypatch: pytest.MonkeyPatch,
):
    dtw = mine("Dtw")()
    monkeypatch.setattr(sys.modules["__main__"], "DTW", dtw, raising=False)

    with pytest.raises(InputError, match=r"which is no variable of an imported module: write it"):
        planned(comparators=[dtw])
