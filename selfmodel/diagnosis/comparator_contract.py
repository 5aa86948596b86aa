"""The contract of a comparator, as a check that anybody can run on theirs."""

import numpy as np

from selfmodel.arrays import FloatArray, IndexArray
from selfmodel.diagnosis.comparator import Comparator, Piecewise
from selfmodel.simulation.requests import ClosedLoop, Ensemble, Request, Segments, recordable
from selfmodel.trials.behaviour import Behaviour
from selfmodel.trials.trial import Trial

CROWDED = (
    "must not depend on the other runs, not in the last bit: numpy adds in the order of memory, "
    "which np.ascontiguousarray before a sum or a mean fixes"
)


def check_comparator(comparator: Comparator, trial: Trial, simulated: Behaviour) -> None:
    """Checks that a comparator does what ``Comparator`` says, and ``Piecewise`` if it is one.

    Args:
        comparator: The one to check.
        trial: A logged trial.
        simulated: What ``comparator.request(trial)`` asks to simulate, for at least two
            hypotheses, of which the first did what the trial shows, to the bit: ``shown`` makes
            such a one. Signals that it did not ask for do no harm: all signals, ``(n, steps,
            width)``, serve every ``ClosedLoop`` request.

    Raises:
        ValueError: It breaks its contract, or ``simulated`` is not what it asked for; the message
            says in which way.
    """
    if not comparator.name or comparator.name != comparator.name.strip():
        raise ValueError(f"a comparator needs a name, got {comparator.name!r}")
    request = comparator.request(trial)
    _check_request(request, trial)
    asked = _as_requested(request, trial, simulated)
    before = {signal: asked[signal].copy() for signal in request.record}
    distances = comparator.distances(asked, trial)
    runs = len(asked[request.record[0]])
    if distances.shape != (runs,):
        raise ValueError(f"expected a distance for each of {runs} runs, got {distances.shape}")
    if not np.all(np.isfinite(distances)) or np.any(distances < 0):
        raise ValueError(f"distances must be finite and at least 0, got {distances}")
    if distances[0] != 0:
        raise ValueError(f"a run that did what the trial shows must be at 0, got {distances[0]}")
    if not np.array_equal(distances, comparator.distances(asked, trial)):
        raise ValueError("the same arguments must give the same distances")
    for run in range(runs):
        alone = comparator.distances(_only(asked, run), trial)
        if not np.array_equal(alone, distances[run : run + 1]):
            raise ValueError(f"the distance of run {run} {CROWDED}")
    if isinstance(comparator, Piecewise):
        _check_pieces(comparator, trial, asked, distances)
    if any(not np.array_equal(before[signal], asked[signal]) for signal in request.record):
        raise ValueError("a comparator must not change what it is given")


def shown(request: Request, trial: Trial) -> Behaviour:
    """Returns what a simulation would give that does exactly what a trial shows.

    No simulation of segments does so to the bit, not even one of the truth, because the solver of
    the contacts starts from other guesses there than in one long run: some 1e-9 is left.

    Args:
        request: What a comparator asked for.
        trial: A logged trial; for segments, one without noise, in which the states that they begin
            with are found as they were logged.

    Returns:
        The signals that were asked for, with a leading axis of one run.

    Raises:
        ValueError: The trial does not show what a segment begins with.
    """
    behaviour, time = trial.behaviour, trial.behaviour.time
    rows: IndexArray = np.arange(behaviour.steps)
    if isinstance(request, Segments):
        rows = _starts(request, behaviour)[:, np.newaxis] + np.arange(request.horizon + 1)
        time = time[: request.horizon + 1]
    elif isinstance(request, Ensemble):
        rows = np.tile(rows, (request.members, 1))
    signals = {signal: behaviour[signal][rows][np.newaxis] for signal in request.record}
    return Behaviour(behaviour.names, time, signals)


def _starts(request: Segments, behaviour: Behaviour) -> IndexArray:
    """The step of the trial at which each segment begins."""
    horizon = request.horizon
    steps = np.arange(behaviour.steps - horizon)
    fits = np.ones((len(request.commands), len(steps)), dtype=bool)
    for signal, values in request.states.items():
        fits &= (values[:, np.newaxis] == behaviour[signal][steps]).all(axis=2)
    ahead = behaviour["commands"][steps[:, np.newaxis] + np.arange(horizon)]
    for segment, commands in enumerate(request.commands[:, request.lead :]):
        fits[segment] &= (ahead == commands).all(axis=(1, 2))
    if not fits.any(axis=1).all():
        raise ValueError(
            f"the trial shows no step at which segment {int(np.argmin(fits.any(axis=1)))} could "
            f"begin, with its states, its commands and {horizon} steps to go: a trial without "
            f"noise does, if the segments are cut from it"
        )
    return np.asarray(fits.argmax(axis=1))


def _check_request(request: Request, trial: Trial) -> None:
    """Checks that a request can be met."""
    if not isinstance(request, ClosedLoop | Segments | Ensemble):
        raise ValueError(  # noqa: TRY004  # every breach of the contract is a ValueError
            f"a request must be a ClosedLoop, Segments or an Ensemble, got {request!r}"
        )
    possible = recordable(request)
    if not request.record or not set(request.record) <= set(possible):
        raise ValueError(
            f"a request of {type(request).__name__} must record some of {possible}, got "
            f"{request.record}"
        )
    if isinstance(request, Ensemble) and not (request.members >= 1 and request.level >= 0):
        raise ValueError(
            f"an ensemble needs at least one member and a level of at least 0, got "
            f"{request.members} members at level {request.level}"
        )
    if isinstance(request, Segments):
        _check_segments(request, trial)


def _check_segments(request: Segments, trial: Trial) -> None:
    names, commands = trial.behaviour.names, request.commands
    if commands.ndim != 3 or commands.shape[2] != len(names.motors) or not len(commands):
        raise ValueError(
            f"the commands of segments must have shape (segments, lead + horizon, motors) = "
            f"(1 or more, ..., {len(names.motors)}), got {commands.shape}"
        )
    if not 0 <= request.lead < commands.shape[1]:
        raise ValueError(
            f"segments need a lead of at least 0 and a horizon of at least 1 step, got a lead of "
            f"{request.lead} in {commands.shape[1]} rows of commands"
        )
    for signal, values in request.states.items():
        expected = (len(commands), names.width(signal))
        if values.shape != expected:
            raise ValueError(
                f"the states of {signal} must have shape (segments, width) = {expected}, got "
                f"{values.shape}"
            )
    if not all(np.isfinite(values).all() for values in (commands, *request.states.values())):
        raise ValueError("the states and the commands of segments must all be known, got NaN")


def _as_requested(request: Request, trial: Trial, simulated: Behaviour) -> Behaviour:
    """What was asked for of what was simulated, once its shapes are seen to fit."""
    lengths: tuple[int, ...] = (trial.behaviour.steps,)
    if isinstance(request, Segments):
        lengths = (len(request.commands), request.horizon + 1)
    elif isinstance(request, Ensemble):
        lengths = (request.members, trial.behaviour.steps)
    for signal in request.record:
        if simulated[signal].shape[1:-1] != lengths:
            raise ValueError(
                f"its request is a {type(request).__name__}: {signal} must have been simulated as "
                f"(n, {', '.join(map(str, lengths))}, width), got {simulated[signal].shape}"
            )
    return Behaviour(
        simulated.names, simulated.time, {signal: simulated[signal] for signal in request.record}
    )


def _only(simulated: Behaviour, run: int) -> Behaviour:
    return Behaviour(
        simulated.names,
        simulated.time,
        {signal: values[run : run + 1] for signal, values in simulated.signals.items()},
    )


def _check_pieces(
    comparator: Piecewise, trial: Trial, simulated: Behaviour, distances: FloatArray
) -> None:
    losses = comparator.losses(simulated, trial)
    if losses.ndim != 2 or len(losses) != len(distances) or not losses.shape[1]:
        raise ValueError(
            f"expected losses of shape (n, pieces) = ({len(distances)}, 1 or more), got "
            f"{losses.shape}"
        )
    if not np.all(np.isfinite(losses)) or np.any(losses < 0):
        raise ValueError("losses must be finite and at least 0")
    if not np.allclose(losses.mean(axis=1), distances, rtol=1e-12, atol=0):
        raise ValueError(
            f"the mean of the losses must be the distance, got {losses.mean(axis=1)} for "
            f"{distances}"
        )
    if not np.array_equal(losses, comparator.losses(simulated, trial)):
        raise ValueError("the same arguments must give the same losses")
    for run in range(len(losses)):
        alone = comparator.losses(_only(simulated, run), trial)
        if not np.array_equal(alone, losses[run : run + 1]):
            raise ValueError(f"the losses of run {run} {CROWDED}")
