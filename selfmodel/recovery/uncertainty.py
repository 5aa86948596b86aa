"""Uncertainty of a self-model: assumed, estimated from healthy trials, weighted by later trials.

Calibration predicts a tenth of a second at a time; the small differences of single limbs that make
a robot walk in a curve show only over a whole trial. Each trial that the recovery makes is compared
with rollouts of its controller under a sample of models (importance sampling). Continuous
self-modelling after Bongard, Zykov and Lipson, *Resilient machines through continuous
self-modeling* (Science 2006).
"""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.controllers.controller import CommandSource
from selfmodel.faults.hypothesis import INTACT, Hypothesis
from selfmodel.recovery.falls import fall_of
from selfmodel.robot.anatomy import Anatomy
from selfmodel.robot.robot import Robot
from selfmodel.rotation import directions, headings
from selfmodel.settings import Settings
from selfmodel.simulation.calibration import Calibration
from selfmodel.simulation.domain import DomainDistribution, DomainSample, StartSpread, draw_samples
from selfmodel.simulation.fit import EXACT_ERROR
from selfmodel.simulation.model_factors import LogNormal, Weighted, exact
from selfmodel.simulation.rollout import batch_bytes
from selfmodel.simulation.simulator import Simulator
from selfmodel.trials.estimation import encoder_noise
from selfmodel.trials.signals import Signal
from selfmodel.trials.trial import Trial

ASSUMED_NOISE = 0.05
"""Standard deviation of a reading, as a fraction of half its range, before the first trial."""

ASSUMED_WRONG_TOUCHES = 0.025
"""Probability of a wrong touch reading before the first trial."""

ASSUMED_START = StartSpread(0.01, 0.005)
"""Spread of the initial poses before the first trial, rad."""

ASSUMED_FACTORS = 0.1
"""Standard deviation of the logarithm of the factor of a mass or a motor before the first trial;
that of friction and of damping, which models often contain guesses of, is twice as large."""

GROUND = 0.35
"""As ``ASSUMED_FACTORS``, of the friction on a ground that is not in the robot's file, as of every
URDF: half to twice that of the import in 95 % of the draws."""

CALIBRATED = 0.65
"""Factor of the posterior deviations of a calibration of a robot with a floating base. Its
intervals of 68 % contain the truth in 86 to 89 % of the parameters (docs/results/calibration.md),
as those of deviations 0.65 times as large would in 68 %. Those of arms do in 74 %: they stay."""

BODIES = 0.1
"""Standard deviation of the logarithm of the factor of a single body's mass, and of its inertia: a
calibration fits only those that the bodies share, and a robot of unequal legs walks in curves."""

CONTACTS = 0.5
"""Standard deviation of the logarithms of the stiffness and of the damping of contacts, where a
calibration changed them, this one or an earlier one: its candidates are a factor of 2 apart. Also
of those on an unknown ground before a calibration."""

ASSUMED_DELAYS = (0, 1, 2)
"""Control delays in addition to the model's before the first trial, control steps."""

MIN_SHARE = 0.5
"""Smallest deviation of the initial pose, as a fraction of the noise with which it was measured: a
pose within the noise is not distinguished from the reference pose."""

NOISY: tuple[Signal, ...] = ("sensors", "joint_positions", "base_orientation")
"""Signals of a trial whose noise is estimated."""

MODELS = 128
"""Largest number of models of the sample. Each trial is simulated once per model."""

SAMPLE_COST = 1 / 12
"""Rollouts of a trial, one per model, relative to the evaluations of the paper's repair EA."""

BATCH = 36
"""Number of models that are simulated together, unless there are more threads: as fast as all, in
half of the memory."""

REPEATS = 16
"""Rollouts of one model, which measure how far noise alone moves the path."""

MARKS = 5
"""Times at which the path is compared, evenly spaced to the end of the trial."""

INDEPENDENT = 3.0
"""Independent differences that all differences of a trial count as: one for each of forward,
sideways and heading, because those at successive times are strongly correlated."""

MAX_DIFFERENCE = 6.0
"""Bound on a difference, in standard deviations: after a fall, paths differ by any amount."""

SHARE_OF_SPREAD = 0.15
"""Error of every model's path, relative to the spread of the models' paths: no model is exact."""

MIN_EFFECTIVE = 1 / 8
"""Smallest effective size of the weighted sample, relative to its size; below it, the likelihood is
flattened."""


def assumed_uncertainty(robot: Robot) -> DomainDistribution:
    """Returns the uncertainty of a robot before its first trial."""
    touch = _touch(robot.anatomy)
    factors = np.full(4 + robot.model.nu, ASSUMED_FACTORS)
    factors[2:4] *= 2  # friction and damping
    contacts = 0.0
    if robot.has_unknown_ground:
        factors[2], contacts = GROUND, CONTACTS
    return DomainDistribution(
        models=LogNormal(factors, np.full(robot.model.nbody, BODIES), contacts),
        reading_noise=np.where(touch, 0.0, ASSUMED_NOISE),
        wrong_touches=np.where(touch, ASSUMED_WRONG_TOUCHES, 0.0),
        start=ASSUMED_START,
        delays=ASSUMED_DELAYS,
    )


def estimated_uncertainty(
    simulator: Simulator, trials: Sequence[Trial], calibration: Calibration | None
) -> DomainDistribution:
    """Returns the uncertainty of a robot after its healthy trials.

    The noise is that of the trials in excess of the same estimate in noise-free simulations of
    them: a contact changes a reading within a step, too. A model that predicts the trials
    exactly is exact. Without a calibration, the parameters are as uncertain as before the trials.
    The simulator is of the self-model, calibrated if there is a calibration.
    """
    robot, assumed = simulator.robot, assumed_uncertainty(simulator.robot)
    touch = _touch(robot.anatomy)
    noise, wrong, angles, tilts = zip(*(_variances(simulator, one) for one in trials), strict=True)
    angle = _deviation(angles)
    measured = DomainDistribution(
        models=exact(robot),
        reading_noise=np.where(touch, 0.0, np.sqrt(np.mean(noise, axis=0))),
        wrong_touches=np.where(touch, np.mean(wrong, axis=0), 0.0),
        # A base that was not observed is assumed to tilt by half of the joints' deviation.
        start=StartSpread(angle, angle / 2 if np.isnan(tilts).all() else _deviation(tilts)),
    )
    if calibration is None:
        if measured.is_none:
            return measured
        return dataclasses.replace(measured, models=assumed.models, delays=assumed.delays)
    if calibration.error_before < EXACT_ERROR:
        return measured
    deviations = calibration.deviations * (1.0 if robot.has_fixed_base else CALIBRATED)
    bodies = np.full(robot.model.nbody, BODIES)
    contacts = CONTACTS if robot.has_fitted_contacts else 0.0
    return dataclasses.replace(measured, models=LogNormal(deviations, bodies, contacts))


def _touch(anatomy: Anatomy) -> BoolArray:
    return np.array([sensor.kind == "touch" for sensor in anatomy.sensors], dtype=bool)


def _variances(simulator: Simulator, trial: Trial) -> tuple[FloatArray, FloatArray, float, float]:
    """Returns the excess over a simulation of a trial: of readings, of the initial pose.

    These are the variance of the readings and the frequency of their flips, ``(sensors,)`` each;
    the variance of the initial joint angles, and of the initial roll and pitch; NaN if unknown.
    """
    logged = trial.trajectory
    runs = simulator.run([(INTACT, trial.plan.controller)], logged.steps, NOISY).trajectory
    readings, angles, orientations = ((logged[signal], runs[signal][0]) for signal in NOISY)
    roll_and_pitch = [directions(each)[:, 2:4] for each in orientations]
    logged_flips, simulated_flips = map(_flips, readings)
    return (
        _noise_variance(*readings),
        np.maximum(logged_flips - simulated_flips, 0.0),
        _start_variance(*angles),
        _start_variance(*roll_and_pitch),
    )


def _noise_variance(logged: FloatArray, simulated: FloatArray) -> FloatArray:
    one, other = (np.square(encoder_noise(series)) for series in (logged, simulated))
    return np.asarray(np.maximum(one - other, 0.0))


def _flips(series: FloatArray) -> FloatArray:
    """Returns the fraction of the steps at which a reading differs from both of its neighbours."""
    before, middle, after = series[:-2], series[1:-1], series[2:]
    return np.asarray(((before == after) & (middle != before)).mean(axis=0))


def _start_variance(logged: FloatArray, simulated: FloatArray) -> float:
    """Returns the mean variance of the initial pose; NaN if it was not observed."""
    noise = float(np.mean(_noise_variance(logged, simulated)))
    deviations = np.square(logged[0] - simulated[0])
    known = deviations[np.isfinite(deviations)]
    if not len(known):
        return np.nan
    return max(float(known.mean()) - noise, MIN_SHARE**2 * noise)


def _deviation(variances: Sequence[float]) -> float:
    known = [variance for variance in variances if np.isfinite(variance)]
    return float(np.sqrt(np.mean(known))) if known else 0.0


@dataclass(eq=False)
class Posterior:
    """The uncertainty of a self-model, updated by trials. It simulates nothing until it is needed.

    ``simulator``, ``healthy`` and ``calibration`` are the arguments of ``estimated_uncertainty``;
    the settings set the cost of the sample, whose random numbers are of ``rng``.
    """

    simulator: Simulator
    healthy: Sequence[Trial]
    calibration: Calibration | None
    settings: Settings
    rng: np.random.Generator
    _likelihoods: dict[tuple[Hypothesis, Any], FloatArray] = field(default_factory=dict, init=False)

    @cached_property
    def _models(self) -> int:
        return max(2, min(MODELS, round(SAMPLE_COST * self.settings.evaluations)))

    @cached_property
    def _uncertainty(self) -> DomainDistribution:
        return estimated_uncertainty(self.simulator, self.healthy, self.calibration)

    @cached_property
    def _conditions(self) -> tuple[DomainSample, ...]:
        """A condition per model, then ``REPEATS`` with the model of the first one."""
        count = self._models + REPEATS
        drawn = draw_samples((INTACT,), self._uncertainty, count, self.rng)
        repeats = [dataclasses.replace(one, model=drawn[0].model) for one in drawn[self._models :]]
        return (*drawn[: self._models], *repeats)

    def after(self, trials: Sequence[Trial], hypothesis: Hypothesis) -> DomainDistribution:
        """Returns an uncertainty whose models are weighted by their predictions of trials.

        Trials of the stage ``before`` are of the healthy robot, and all others of one with the
        faults of the hypothesis. Trials whose base was not observed are left out, and so is the
        time after a fall, which is chance.
        """
        sample = [condition.model for condition in self._conditions[: self._models]]
        if not any(model.differs for model in sample):
            return self._uncertainty
        likelihood = np.zeros(self._models)
        for trial in trials:
            faults = INTACT if trial.plan.stage == "before" else hypothesis
            track = _observed(trial)[: fall_of(self.simulator.robot, faults, trial)]
            if len(track) and np.isfinite(track).all():
                likelihood += self._likelihood(trial, track, faults)
        models = Weighted(sample, flattened_weights(likelihood))
        return dataclasses.replace(self._uncertainty, models=models)

    def _likelihood(self, trial: Trial, track: FloatArray, hypothesis: Hypothesis) -> FloatArray:
        key = (hypothesis, trial.content)
        if key not in self._likelihoods:
            conditions = [
                dataclasses.replace(each, hypothesis=hypothesis) for each in self._conditions
            ]
            controller, steps = trial.plan.controller, len(track)
            paths = _paths(self.simulator, self._uncertainty, controller, steps, conditions)
            # Relative to the first step, a value has the noise of two measurements.
            measured = np.sqrt(2) * np.repeat(encoder_noise(track), MARKS)
            self._likelihoods[key] = log_likelihood(
                _path(track), paths[: self._models], paths[self._models :], measured
            )
        return self._likelihoods[key]


def log_likelihood(
    observed: FloatArray, paths: FloatArray, repeats: FloatArray, measured: FloatArray
) -> FloatArray:
    """Returns the logarithm of the likelihood of each model, ``(models,)``.

    Args:
        observed: Path of the trial, ``(values,)``.
        paths: Path predicted by each model, ``(models, values)``; NaN if its simulation diverged.
        repeats: Paths of one model with different noise, ``(repeats, values)``.
        measured: Standard deviation of the measurement of the path, ``(values,)``.
    """
    # The noise is that of the trial and that of the rollout.
    noise = np.hypot(np.sqrt(2) * np.nanstd(repeats, axis=0), measured)
    scale = np.hypot(noise, SHARE_OF_SPREAD * np.nanstd(paths, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        differences = np.abs(paths - observed) / scale
    differences = np.nan_to_num(differences, nan=MAX_DIFFERENCE, posinf=MAX_DIFFERENCE)
    squares = np.square(np.minimum(differences, MAX_DIFFERENCE))
    return np.asarray(-0.5 * INDEPENDENT * squares.mean(axis=1), dtype=np.float64)


def flattened_weights(likelihood: FloatArray) -> FloatArray:
    """Returns the weights of models by the logarithms of their likelihoods, ``(models,)`` both.

    The likelihood is flattened until the effective size of the sample is large enough.
    """
    temperature = 1.0
    while True:
        weights = np.exp((likelihood - likelihood.max()) / temperature)
        weights /= weights.sum()
        if 1 / np.square(weights).sum() >= MIN_EFFECTIVE * len(weights):
            return np.asarray(weights)
        temperature *= 1.5


def _paths(
    simulator: Simulator,
    uncertainty: DomainDistribution,
    controller: CommandSource,
    steps: int,
    conditions: Sequence[DomainSample],
) -> FloatArray:
    """Returns the path of a controller under each condition, ``(conditions, values)``.

    The path of a simulation that diverged is NaN. The models of a batch take bounded memory.
    """
    affordable = batch_bytes() // int(simulator.robot.model.nbuffer)
    size = max(1, min(max(BATCH, simulator.threads), affordable))
    paths = []
    for first in range(0, len(conditions), size):
        outcome = simulator.run_under(
            conditions[first : first + size],
            uncertainty,
            [controller],
            steps,
            ("base_position", "base_orientation"),
        )
        simulated = outcome.trajectory
        position, orientation = simulated["base_position"][0], simulated["base_orientation"][0]
        paths += [
            np.full(3 * MARKS, np.nan) if diverged else _path(_track(*run))
            for *run, diverged in zip(position, orientation, outcome.diverged[0], strict=True)
        ]
    return np.array(paths)


def _observed(trial: Trial) -> FloatArray:
    """Returns forward and sideways position, m, and heading, rad, of a trial, ``(steps, 3)``.

    Steps at which the base was not observed are interpolated; all are NaN if it never was.
    """
    track = _track(trial.trajectory["base_position"], trial.trajectory["base_orientation"])
    steps = np.arange(len(track))
    for column in track.T:
        known = np.isfinite(column)
        if known.any():
            column[:] = np.interp(steps, steps[known], column[known])
    return track


def _track(position: FloatArray, orientation: FloatArray) -> FloatArray:
    """Returns forward and sideways position, m, and heading, rad, ``(steps, 3)``."""
    heading = headings(orientation)
    known = np.isfinite(heading)
    heading[known] = np.unwrap(heading[known])
    return np.column_stack([position[:, :2], heading])


def _path(track: FloatArray) -> FloatArray:
    """Returns a track at the marks, relative to its first step, ``(3 * MARKS,)``."""
    marks = np.linspace(0, len(track) - 1, MARKS + 1).round().astype(np.intp)[1:]
    return np.asarray((track[marks] - track[0]).T.ravel())
