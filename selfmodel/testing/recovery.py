"""Contract checks of plug-ins of a recovery: a score, a next trial, a design and a search."""

from functools import partial
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from selfmodel import plugins
from selfmodel.arguments import RobotSource, check_robot, comparator_choice, entry_of
from selfmodel.arrays import FloatArray
from selfmodel.controllers.controller import Controller, Design, draw_genomes
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import PAPER_KINDS
from selfmodel.logs.controllers import controller_bytes, parse_controller
from selfmodel.logs.physical_trial import TrialRunner
from selfmodel.physical.simulated import SimulatedRobot
from selfmodel.progress import ignore
from selfmodel.recovery.recover import NextTrial, RecoveryLoop
from selfmodel.recovery.repair import MakeSearch, RepairSearch
from selfmodel.recovery.scores import Score, check_measurable, checked
from selfmodel.robot.designs import network_for
from selfmodel.settings import EA, Settings
from selfmodel.simulation.simulator import Simulator
from selfmodel.testing.contract import require, require_alone
from selfmodel.testing.diagnosis import CHECKED_STEPS
from selfmodel.trials.trajectory import Trajectory

RUNS = 3
"""Controllers of a batch that is checked."""

SMALL = Settings(steps=CHECKED_STEPS, trials=3, generations=1, diagnostic_search=EA).scaled(4)
"""Settings of the recovery in which a choice of the next trial is checked."""

GENERATIONS = 4
"""Generations of a search that is checked."""


def check_score(score: Score | str, robot: RobotSource = "quadruped") -> None:
    """Checks that a score fulfils the contract of ``Score``, of rollouts of a robot.

    Example:
        >>> import selfmodel
        >>> selfmodel.check_score("energy")

    Args:
        score: The score to check, its name, or ``package.module:object``.
        robot: A robot that has the score, its name, or the path of its MJCF or URDF file.

    Raises:
        ContractError: The score breaks its contract; the message names the broken rule.
        InputError: The name is unknown, the object is no score or names unknown signals, it gives
            other than one number per rollout, or the robot cannot have it.
    """
    entry = entry_of(robot)
    known = entry.robot()
    if isinstance(score, str):
        score = plugins.score(score, known.name, entry)
    if not isinstance(score, Score):
        raise InputError(f"expected a selfmodel.recovery.Score, got {score!r:.200}")
    score = checked(score, score.name)
    require(score.name and score.name == score.name.strip(), "a score needs a name")
    check_measurable(score, known)
    fault = next(chain(*(kind.candidates(known.anatomy) for kind in PAPER_KINDS)))
    controllers = _controllers(network_for(known))
    for hypothesis in (INTACT, Hypothesis((fault,))):
        runs = [(hypothesis, one) for one in controllers]
        rollouts = Simulator(known, 1).run(runs, CHECKED_STEPS, score.record).trajectory
        before = {name: values.tobytes() for name, values in rollouts.signals.items()}
        values = score.of(known, hypothesis, rollouts)
        again = score.of(known, hypothesis, rollouts)
        require(
            np.array_equal(values, again, equal_nan=True),
            f"the same rollouts must have the same score {score.name}, got {values} and {again}",
        )
        require(
            before == {name: values.tobytes() for name, values in rollouts.signals.items()},
            f"the score {score.name} must not change the rollouts",
        )
        for run in range(RUNS):
            alone = {name: signal[run : run + 1] for name, signal in rollouts.signals.items()}
            batch = Trajectory(rollouts.names, rollouts.time, alone)
            own = score.of(known, hypothesis, batch)
            require_alone(f"score {score.name} of run {run}", own, values[[run]])


def check_next_trial(choice: NextTrial | str) -> None:
    """Checks a choice of the next trial in a short recovery of the quadruped, without a gap.

    Example:
        >>> import selfmodel
        >>> selfmodel.check_next_trial("repair")

    Args:
        choice: The function to check, its name, or ``package.module:object``.

    Raises:
        ContractError: The choice breaks its contract; the message names the broken rule.
        InputError: The name is unknown, or the object is no function of a ``RecoveryLoop``.
    """
    choose, robot = plugins.next_trial(choice), entry_of("quadruped").robot()

    def watched(loop: RecoveryLoop) -> Controller:
        known, state = (loop.trials, loop.diagnoses), loop.rng.bit_generator.state
        chosen = choose(loop)
        require(
            isinstance(chosen, Controller),
            f"a choice of the next trial must return a Controller, got {chosen!r:.200}",
        )
        check_robot(chosen.design, robot, "the choice of the next trial")
        loop.rng.bit_generator.state = state
        again = choose(loop)
        require(
            chosen == again,
            f"the same recovery must choose the same controller, got {chosen} and then another: "
            f"draw random numbers from loop.rng",
        )
        require(
            known == (loop.trials, loop.diagnoses),
            "a choice of the next trial must not change the trials and diagnoses of the loop",
        )
        return chosen

    healthy, damaged = (
        SimulatedRobot(robot, parse(text, robot.anatomy))
        for text in ("intact", "break:front_left_knee")
    )
    with TemporaryDirectory() as folder:
        RecoveryLoop(
            simulator=Simulator(robot, 1),
            choose_comparator=comparator_choice("sensor-series"),
            run_trial=TrialRunner(Path(folder), robot, SMALL),
            store_diagnosis=ignore,
            settings=SMALL,
            seed=0,
            on_event=ignore,
            gait=_controllers(network_for(robot))[0],
            kinds=PAPER_KINDS,
            next_trial=watched,
            make_repair=RepairSearch,
        ).run(healthy, damaged)


def check_design(
    design: Design | plugins.MakeDesign | str, robot: RobotSource = "quadruped"
) -> None:
    """Checks that a design of controllers fulfils the contract of ``Design``.

    Example:
        >>> import selfmodel
        >>> selfmodel.check_design("cpg")

    Args:
        design: The design to check, a function from a robot and a number of hidden neurons to it,
            its name, or ``package.module:function``.
        robot: The robot, its name, or the path of its MJCF or URDF file.

    Raises:
        ContractError: The design breaks its contract; the message names the broken rule.
        InputError: The name is unknown, or the object is no design of the robot.
    """
    known = entry_of(robot).robot()
    made, again = (
        design if isinstance(design, Design) else plugins.design(design, known) for _ in range(2)
    )
    check_robot(made, known, "the design")
    require(made == again and hash(made) == hash(again), "two designs of one robot must be equal")
    require(
        made.weights >= 1 and made.description,
        f"a design needs at least one weight and a description, got {made.weights} weights",
    )
    controllers, simulator = _controllers(made), Simulator(known, 1)
    run = partial(simulator.run, steps=CHECKED_STEPS, record=["commands"])
    together = run([(INTACT, one) for one in controllers]).trajectory["commands"]
    outside = [
        motor
        for motor, (centre, half) in enumerate(made.ranges)
        if not (np.abs(together[..., motor] - centre) <= half * (1 + 1e-9)).all()
    ]
    require(
        not outside,
        f"commands must be finite and in the range of their motor, those of "
        f"{', '.join(made.motors[one] for one in outside)} are not",
    )
    for row, controller in enumerate(controllers):
        alone = run([(INTACT, controller)]).trajectory["commands"]
        require_alone(f"commands of run {row}", alone[0], together[row])
    try:
        read = parse_controller(controller_bytes(controllers[0]), made.name)
    except TypeError:  # a class without a format
        read = None
    require(
        read == controllers[0],
        f"a log must give the same controller of {made.name} again: expected a design of a class "
        f"that selfmodel writes, such as a Network; a further one needs the rows that "
        f"selfmodel/controllers/controller.py names",
    )


def check_search(search: MakeSearch | str) -> None:
    """Checks that a search over genomes fulfils the contract of ``GenomeSearch``.

    Example:
        >>> import selfmodel
        >>> selfmodel.check_search("cma-es")

    Args:
        search: The function that makes the search to check, its name, or ``package.module:object``.

    Raises:
        ContractError: The search breaks its contract; the message names the broken rule.
        InputError: The name is unknown, or the object is no function.
    """
    make = plugins.search(search)
    first, second = _asked(make), _asked(make)
    require(
        all(map(np.array_equal, first, second)),
        "the same seed must give the same genomes: draw random numbers from rng",
    )


def _asked(make: MakeSearch) -> list[FloatArray]:
    """Returns the genomes of the generations of a search, and its candidates at last."""
    length, evaluations = 5, 0
    settings, seed = Settings().scaled(8), np.full(length, 0.5)
    search = make(length, settings, np.random.default_rng(0), [seed])
    genomes: list[FloatArray] = []
    for _ in range(GENERATIONS):
        asked = search.ask()
        _check_genomes("ask", asked, length)
        require(np.array_equal(asked, search.ask()), "ask must return the same until tell")
        genomes.append(asked.copy())
        fitness = -((asked - 0.25) ** 2).sum(axis=1)
        fitness[-1] = -np.inf  # of a simulation that diverged
        told = fitness.copy()
        search.tell(fitness)
        require(np.array_equal(told, fitness), "tell must not change the fitness")
        evaluations += len(asked)
        require(
            search.evaluations == evaluations,
            f"evaluations must be {evaluations} after as many genomes, got {search.evaluations}",
        )
    require(
        (genomes[0] == seed).all(axis=1).any(),
        "the first generation must have the initial genomes",
    )
    best = search.candidates(2)
    _check_genomes("candidates", best, length)
    require(len(best) <= 2, f"candidates(2) must return at most 2 genomes, got {len(best)}")
    return [*genomes, best]


def _check_genomes(what: str, genomes: FloatArray, length: int) -> None:
    require(
        isinstance(genomes, np.ndarray)
        and genomes.ndim == 2
        and genomes.shape[1] == length
        and len(genomes)
        and (np.abs(genomes) <= 1).all(),
        f"{what} must return at least one genome, an array (n, {length}) of values in [-1, 1], got "
        f"{genomes!r:.200}",
    )


def _controllers(design: Design) -> list[Controller]:
    genomes = draw_genomes(np.random.default_rng(0), (RUNS, design.weights))
    return [Controller(design, genome) for genome in genomes]
