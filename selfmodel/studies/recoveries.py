"""Functions of the studies of this package: gaits, physical trials, diagnoses and recoveries.

Each is computed in a worker from JSON parameters: those of a point (``robot``, ``model``, ``case``,
``truth``, ``gap``, ``seed``, ``comparator``), and ``shared``, which all points of a study have.
"""

import base64
import dataclasses
import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from selfmodel import plugins
from selfmodel.arguments import (
    REPAIR_SETTINGS,
    comparator_choice,
    is_model,
    read_controller,
    robot_entry,
)
from selfmodel.arrays import finite_or_none
from selfmodel.controllers.controller import Controller, check_silent_neurons
from selfmodel.diagnosis.choice import chosen_comparator
from selfmodel.diagnosis.diagnose import DiagnosticSearch
from selfmodel.diagnosis.diagnosis import Diagnosis
from selfmodel.errors import InputError, check_type
from selfmodel.evolution import Generation
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.hypothesis_space import HypothesisSpace
from selfmodel.faults.sensors import silent_neurons
from selfmodel.logs.controllers import controller_bytes
from selfmodel.logs.files import replace_file
from selfmodel.logs.journal import RECOVERY
from selfmodel.logs.physical_trial import run_trial
from selfmodel.logs.reader import read_log
from selfmodel.logs.records import TrialHeader
from selfmodel.logs.results import RecoveryResult, TrialResult
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.recovery.recover import diagnose_trials, random_stream
from selfmodel.recovery.repair import MakeSearch, RepairSearch
from selfmodel.recovery.repertoire import model_digest
from selfmodel.recovery.result import Event, SearchBegins
from selfmodel.recovery.scores import DISPLACEMENT, UPRIGHT, Score
from selfmodel.recovery.uncertainty import assumed_uncertainty
from selfmodel.robot.robot import Robot
from selfmodel.settings import ADDED, RepairSettings, Settings
from selfmodel.simulation.calibration import calibrate
from selfmodel.simulation.simulator import Simulator
from selfmodel.studies import experiment as experiments
from selfmodel.studies.cells import Cell
from selfmodel.studies.study import Row
from selfmodel.tasks import Entry
from selfmodel.trials.trial import Stage, Trial, TrialPlan

GAIT, CALIBRATED = "gait.npz", "calibrated.xml"
"""Files of a gait, and of the self-model that was fitted to the healthy trials of a run."""

HEALTHY_TRIALS = 2
"""Number of trials before the failure, in a run whose trials all comparators share."""

REASON = "reason"
"""Parameter of a run that cannot be: why its failure does not apply to the robot."""

ON_ROBOT = "evolution-on-robot"
"""In place of a comparator: the paper's control, the repair EA on the damaged robot."""

REPAIR = "repair_settings"
"""Parameter with the settings of the repair, where they are others."""

ENDS = ("before", "after", "best_trial")
"""What is reported of a recovery: before and after the failure, and in its best trial since."""

NO_EFFECT = 0.05
"""Largest loss by a failure without an effect, as a share of the score before it."""

RULE = (
    f"The best trial is one without a fall, unless the robot fell in all, which is no recovery. A "
    f"failure has no effect if it took at most {100 * NO_EFFECT:g} % of the score, and the robot "
    f"did not fall because of it; it is worse if the best trial then lost more, or fell. Better is "
    f"a larger score than after the failure, or no fall where the failure made the robot fall."
)
"""What ``outcome_of`` means, for readers."""

TRIAL_COLUMNS = ("stage", "hypothesis", "score", "robust_mean", "displacement", "fell_at_step")
"""Columns of a trial of a recovery that are those of its result."""

DIAGNOSIS_SETTINGS = ("trials", "genes", "kept", *ADDED)
"""Names of the settings that do not affect a gait."""

Parameters = Mapping[str, Any]
Folders = Mapping[str, Path]
Rows = dict[str, list[Row]]
"""Rows by the name of their table."""


def planned(name: str, entry: Entry) -> dict[str, str]:
    """Returns the parameters of a cell that determine its robot, which its worker loads."""
    return {"robot": name, "model": model_digest(entry.robot())}


def planned_entry(parameters: Parameters) -> Entry:
    """Returns the robot of a cell with its cases and tasks.

    Raises:
        InputError: The model of that name is another one here.
    """
    entry = robot_entry(parameters["robot"])
    if model_digest(entry.robot()) != parameters["model"]:
        raise InputError(
            f"{parameters['robot']} is another model than when the command began, or than on the "
            f"machine of the command: restore the file, or run the command again"
        )
    return entry


def robot_key(robot: str) -> str:
    """Returns the robot's part of a file name: its name, or the name of its model file."""
    name = Path(robot).stem if is_model(robot) else robot
    return re.sub(r"[^\w.-]", "_", name, flags=re.ASCII).lstrip(".-") or "_"


def repair_parameters(
    repair: str | None,
    search: str | MakeSearch | None,
    score: Score | str | None,
    settings: RepairSettings | None = None,
    *,
    known: bool = False,
) -> dict[str, Any]:
    """Returns what determines a repair, with its defaults.

    It is the robust one by default, or with a known controller a layer around that. Its settings
    are left out unless they are given.
    """
    check_type(settings, RepairSettings | None, REPAIR_SETTINGS)
    repair = repair or (plugins.COMPENSATE if known else plugins.ROBUST)
    if search == plugins.REPERTOIRE:
        raise InputError(
            f"a repertoire is of one robot, and a study of many has none, got the search {search}: "
            f"give {' or '.join(plugins.SEARCHES)}, or recover one robot with `selfmodel "
            f"recover --repertoire FILE`"
        )
    if repair == plugins.FINETUNE and not known:
        raise InputError(
            f"the repair {repair} needs a policy, and this study evolves its gaits: give "
            f"{plugins.COMPENSATE}, or `selfmodel suite run --controller FILE`"
        )
    search = None if search is None else plugins.name_of("search", search)
    plugins.repair(repair, search)
    return {
        "repair": repair,
        "search": plugins.search_name(repair, search, None),
        "score": plugins.score_named(score) or plugins.DEFAULT_SCORES[repair],
        **({} if settings is None else {REPAIR: dataclasses.asdict(settings)}),
    }


def settings_of(parameters: Parameters) -> tuple[Settings, RepairSettings | None]:
    """Returns the settings of a point, and those of its repair; None for the same."""
    shared = parameters["shared"]
    settings, own = Settings(**shared["settings"]), shared.get(REPAIR)
    search = parameters.get("diagnostic_search", settings.diagnostic_search)
    settings = dataclasses.replace(settings, diagnostic_search=search)
    return settings, None if own is None else RepairSettings(**own)


def gait_cell(robot: Parameters, shared: Parameters, seed: int) -> Cell:
    """Returns the cell of the first gait of a recovery with the same seed.

    The robot is as ``planned``. Some of the parameters of the recoveries determine the gait.
    """
    own, of_repair = settings_of({"shared": shared})
    settings = dataclasses.asdict(own.of_repair(of_repair)).items()
    if shared["repair"] in plugins.FILES:  # a gait is evolved before anything is around it
        shared = {**shared, "repair": plugins.ROBUST}
    parameters = {
        **robot,
        "seed": seed,
        "settings": {name: value for name, value in settings if name not in DIAGNOSIS_SETTINGS},
        **{name: shared[name] for name in ("controller", "neurons", "repair", "search", "score")},
    }
    name = f"{robot_key(robot['robot'])}-seed{seed:03d}"
    modules = plugins.modules_of(parameters)
    return Cell(f"{__name__}:evolve_gait", name, parameters, kind="gaits", modules=modules)


def evolve_gait(parameters: Parameters, _needs: Folders, folder: Path) -> Row:
    """Evolves a gait, writes it, and returns the number of evaluations."""
    entry, settings = planned_entry(parameters), Settings(**parameters["settings"])
    robot, seed = entry.robot(), parameters["seed"]
    design = plugins.design(parameters["controller"], robot, parameters["neurons"])
    score, gait = experiments.choose_score(
        parameters["score"], entry, design, steps=settings.steps, seed=seed
    )
    evaluations = 0
    if gait is None:
        make_repair = plugins.repair(parameters["repair"], parameters["search"])
        repair = make_repair(Simulator(robot, threads=1), settings, design, score)
        assumed, stream = partial(assumed_uncertainty, robot), random_stream(seed, "repair")
        gait = repair((INTACT,), assumed, (), stream, lambda _: None)[0].controller
        evaluations = repair.evaluations
    replace_file(folder / GAIT, controller_bytes(gait))
    return {"evaluations": evaluations}


def given_gait_cell(gait: Controller, robot: Parameters, number: int) -> Cell:
    """Returns the cell of a gait that is known; its parameters contain the gait."""
    data = base64.b64encode(controller_bytes(gait)).decode()
    name, parameters = f"{robot_key(robot['robot'])}-{number}", {**robot, "controller": data}
    return Cell(f"{__name__}:keep_gait", name, parameters, kind="gaits")


def keep_gait(parameters: Parameters, _needs: Folders, folder: Path) -> Row:
    """Writes a given gait into the folder of its cell."""
    replace_file(folder / GAIT, base64.b64decode(parameters["controller"]))
    return {"evaluations": 0}


def bank_gait(bank: Path, robot: str, number: int) -> Controller:
    """Returns a gait of a bank: a folder with ``ROBOT-K.npz``, or the gaits of another study."""
    key = robot_key(robot)
    evolved = sorted(bank.glob(f"{key}-seed{number:03d}-*/{GAIT}"))
    given = bank / f"{key}-{number}.npz"
    path = evolved[0] if evolved and not given.exists() else given
    return read_controller(path, robot_entry(robot).robot())


def run_trials(parameters: Parameters, needs: Folders, folder: Path) -> list[str]:
    """Runs the trials of a run before and after the failure, and fits the self-model to the former.

    It returns the names of the trials.
    """
    settings = Settings(**parameters["shared"]["settings"])
    robot, seed = planned_entry(parameters).robot(), parameters["seed"]
    gaits = [read_controller(needs[f"gait-{number}"] / GAIT, robot) for number in range(len(needs))]
    truth = truth_of(parameters, robot)
    before: list[tuple[Stage, Hypothesis]] = [("before", INTACT)] * HEALTHY_TRIALS
    after: list[tuple[Stage, Hypothesis]] = [("after", truth)] * settings.trials
    gap = experiments.draw_reality(robot, seed, parameters["gap"])
    trials: list[Trial] = []
    for number, (stage, hidden) in enumerate([*before, *after]):
        name = f"{number:02d}-{stage}"
        gait = gaits[number if stage == "before" else number - HEALTHY_TRIALS]
        # Noise differs between trials and is the same for every comparator.
        physical = SimulatedRobot(robot, hidden, gap, stream=number)
        plan = TrialPlan(name, stage, gait, settings.steps, seed)
        header = TrialHeader(settings, hidden=str(hidden), gap=gap.text)
        trials.append(run_trial(physical, plan, folder / f"{name}.mcap", robot, header))
    calibrated = calibrate(robot, trials[:HEALTHY_TRIALS], threads=1).robot
    replace_file(folder / CALIBRATED, calibrated.mjcf.encode())
    return [trial.plan.name for trial in trials]


def truth_of(parameters: Parameters, robot: Robot) -> Hypothesis:
    """Returns the failure of the physical robot of a point."""
    kinds = plugins.kinds(parameters["shared"]["kinds"])
    return HypothesisSpace(robot.anatomy, kinds).parse(parameters["truth"])


def diagnose(parameters: Parameters, needs: Folders, _folder: Path) -> Rows:
    """Returns the diagnoses of the trials of a run, after the first and after the last of them."""
    folder, shared = needs["trials"], parameters["shared"]
    logged = [read_log(path).trial for path in sorted(folder.glob("*.mcap"))]
    trials = logged[HEALTHY_TRIALS:]
    robot, given = planned_entry(parameters).robot(), plugins.comparator(parameters["comparator"])
    mjcf = (folder / CALIBRATED).read_text(encoding="utf-8")
    # It refuses all trials at once.
    chosen = chosen_comparator((), robot, trials, given=given).comparator
    search = DiagnosticSearch(
        Simulator(dataclasses.replace(robot, mjcf=mjcf), threads=1),
        chosen,
        settings_of(parameters)[0],
        plugins.kinds(shared["kinds"]),
        healthy_trials=logged[:HEALTHY_TRIALS],
    )
    watch = _DiagnosisWatch()
    diagnose_trials(trials, search, parameters["seed"], watch, after={1, len(trials)})
    rows = watch.rows(shared, robot, truth_of(parameters, robot), trials)
    return {"diagnoses": [{**row, **_named(parameters)} for row in rows]}


def _named(parameters: Parameters) -> Row:
    """Returns the name of the comparator of a point as a column; ``auto`` is a choice of one."""
    given = parameters["comparator"]
    return {"comparator_name": plugins.comparator(given).name if ":" in given else given}


def recover(parameters: Parameters, needs: Folders, folder: Path) -> Rows:
    """Runs a recovery, and returns rows of its diagnoses, of its trials, and its own.

    In place of a recovery, the paper's control runs the repair EA on the robot. A failure that the
    robot cannot have, with the reason, has a row of its own and nothing else.
    """
    if parameters["comparator"] == ON_ROBOT:
        return _evolve_on_robot(parameters, needs)
    shared, entry = parameters["shared"], planned_entry(parameters)
    robot, (settings, of_repair) = entry.robot(), settings_of(parameters)
    if REASON in parameters:
        return {"recoveries": [{"robot": robot.name}]}
    truth, gait = truth_of(parameters, robot), read_controller(needs["gait"] / GAIT, robot)
    _, design, first = plugins.repaired_around(shared["repair"], gait.design, gait)
    check_silent_neurons(design, silent_neurons(truth))
    steps, seed = settings.steps, parameters["seed"]
    score, _ = experiments.choose_score(
        shared["score"], entry, design, steps=steps, seed=seed, gait=gait
    )
    experiment = experiments.Experiment(
        robot=robot,
        case=parameters["case"],
        truth=truth,
        choose_comparator=comparator_choice(parameters["comparator"]),
        kinds=plugins.kinds(shared["kinds"]),
        calibrated=shared["calibrated"],
        gap=parameters["gap"],
        settings=settings,
        seed=seed,
        threads=1,
        folder=folder / RECOVERY,
        gait=first,
        design=design,
        next_trial=shared["next_trial"],
        score=score,
        entry=entry,
        repair=shared["repair"],
        search=shared["search"],
        repair_settings=of_repair,
        ends_early=False,  # its rows are compared with those of other methods after each trial
    )
    watch = _DiagnosisWatch()
    outcome = experiments.run(experiment, watch)
    recovery, result = outcome.recovery, experiments.result_of(experiment, outcome)
    result.write(experiment.folder, settings, of_repair)
    before, after, *recoveries = recovery.scores
    diagnoses = watch.rows(shared, robot, truth, recovery.trials[1:])
    for row in diagnoses:
        best = max(filter(math.isfinite, recoveries[: row["trials"] - 1]), default=None)
        found = {"before": before, "after": after, "recovered": best}
        row |= {**found, **_named(parameters)}
    own = {
        "robot": robot.name,
        **_named(parameters),
        "compared_by": recovery.comparator.comparator.name,
        "best": str(recovery.diagnosis.best),
        "correct": outcome.correct,
        "verdict": recovery.diagnosis.verdict,
        "trials": len(recovery.trials) - 1,
        "recovered": diagnoses[-1]["recovered"],  # of the last one, in all trials
        **_ends(result, recovery.best_trial, entry, steps),
        "distinct_hypotheses": recovery.distinct_hypotheses,
        "diverged": outcome.stats.diverged,
        "simulated_steps": outcome.stats.steps,
        "seconds": outcome.seconds,
        "repair": shared["repair"],
        "search": shared["search"],
    }
    trials = [
        {
            "robot": robot.name,
            "number": number,
            **{name: getattr(one, name) for name in TRIAL_COLUMNS},
            "predicted": one.predicted_score,
            "return": one.reward_sum,
            "upright": finite_or_none(walked),
        }
        for number, (one, walked) in enumerate(
            zip(result.trials or (), recovery.scores_by(UPRIGHT, robot), strict=True)
        )
    ]
    return {"diagnoses": diagnoses, "recoveries": [own], "trials": trials}


def _ends(result: RecoveryResult, best: int, entry: Entry, steps: int) -> Row:
    """Returns what was reached before and after the failure, and in the best recovery trial."""
    trials, task = result.trials or (), entry.episode_return
    row: Row = {"score": result.score.name, "unit": result.score.unit, "control_steps": steps}
    ends = trials[0], trials[1], trials[best]
    for name, one in zip(ENDS, ends, strict=True):
        row[name] = one.score
        row[f"upright_{name}"] = one.fell_at_step is None
        row[f"displacement_{name}"] = one.displacement
        row[f"return_{name}"] = one.reward_sum
    row["regained"], row["outcome"] = outcome_of(*ends)
    return {**row, "return_most": None if task is None else task.most(steps)}


def outcome_of(
    before: TrialResult, after: TrialResult, best: TrialResult
) -> tuple[float | None, str | None]:
    """Returns the share of the lost score that the best recovery trial regained, and the outcome.

    The outcome is by the ``RULE`` ``no effect`` or ``worse``, or ``fell``; or else ``better`` or
    ``not better`` than after the failure, with a share unless the failure took no score. A fall
    that there was before the failure too is not its effect. Both are None without all scores.
    """
    if before.score is None or after.score is None or best.score is None:
        return None, None
    loss, limit = before.score - after.score, NO_EFFECT * abs(before.score)
    has_lost, falls = loss > limit, best.fell_at_step is not None
    if not has_lost and (after.fell_at_step is None or before.fell_at_step is not None):
        is_worse = before.score - best.score > limit or (falls and after.fell_at_step is None)
        return None, "worse" if is_worse else "no effect"
    if falls:
        return None, "fell"
    share = (best.score - after.score) / loss if has_lost else None
    return share, "better" if share is None or share > 0 else "not better"


def _evolve_on_robot(parameters: Parameters, needs: Folders) -> Rows:
    """Runs the paper's control, and returns a row per generation.

    Without a reality gap, an evaluation on the robot is a simulation with the true failure. The
    search begins from the gait before the failure and random controllers, as a repair does.
    """
    robot = planned_entry(parameters).robot()
    settings = Settings(**parameters["shared"]["settings"])
    simulator, gait = Simulator(robot, threads=1), read_controller(needs["gait"] / GAIT, robot)
    walk = simulator.run([(INTACT, gait)], settings.steps, DISPLACEMENT.record).trajectory
    before = float(DISPLACEMENT.of(robot, INTACT, walk)[0])
    rows: list[Row] = []

    def keep(generation: Generation) -> None:
        if math.isfinite(best := float(generation.best)):
            rows.append({"before": before, "evaluations": generation.evaluations, "best": best})

    # A stream that no repair of the recovery draws from: the control is an independent search.
    stream = random_stream(parameters["seed"], "repair", settings.trials + 1)
    truths, assumed = [truth_of(parameters, robot)], partial(assumed_uncertainty, robot)
    RepairSearch(simulator, settings)(truths, assumed, [gait], stream, keep)
    return {"evolution": rows}


class _DiagnosisWatch:
    """Keeps each diagnosis with what it took until then."""

    def __init__(self) -> None:
        self._costs = list[tuple[Diagnosis, Row]]()
        self._evaluations, self._seconds, self._start, self._diagnosing = 0, 0.0, 0.0, False

    def __call__(self, event: Event) -> None:
        match event:
            case SearchBegins(kind):
                self._diagnosing = kind == "diagnostic"
                self._start = perf_counter()
            case Generation() if self._diagnosing and event.number == event.total:
                self._evaluations += event.evaluations
            case Diagnosis():
                self._seconds += perf_counter() - self._start
                cost = {
                    "evaluations": self._evaluations,
                    "distinct_hypotheses": event.cost.hypotheses,
                    "simulated_steps": event.cost.control_steps,
                    "seconds": self._seconds,
                }
                self._costs.append((event, cost))

    def rows(
        self, shared: Parameters, robot: Robot, truth: Hypothesis, trials: Sequence[Trial]
    ) -> list[Row]:
        """Returns a row per diagnosis, without displacements."""
        simulator = Simulator(robot, threads=1)  # scoring is no cost of the diagnosis
        evolved = shared["evolves"]
        return [
            {
                "next_trial": shared["next_trial"],
                "trials": found.trials,
                "best": str(found.best),
                "correct": experiments.is_correct(
                    found.best, truth, trials[: found.trials], simulator
                ),
                "distance": finite_or_none(found.ranked[0].distance),
                "intact_distance": finite_or_none(found.intact_distance),
                "verdict": found.verdict,
                "rivals": len(found.indistinguishable),
                **cost,
                **dict.fromkeys(("before", "after", "recovered")),
                "repair": shared["repair"] if evolved else None,
                "search": shared["search"] if evolved else None,
            }
            for found, cost in self._costs
        ]
