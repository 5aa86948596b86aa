"""A diagnosis: hypotheses ranked by distance to all trials, a verdict and its numbers, as JSON."""

import dataclasses
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

import msgspec

from selfmodel.arrays import data_frame, finite_or_none
from selfmodel.errors import counted
from selfmodel.faults.hypothesis import Hypothesis
from selfmodel.trials.trial import Trial, TrialPart

Verdict = Literal["intact", "explained", "ambiguous", "unexplained", "not judged"]
"""Verdicts on the best hypothesis.

``intact``: the empty hypothesis predicts the trials about as well as the self-model predicts the
healthy robot, and no other hypothesis except ``undetectable`` ones does. ``explained``: the same
for a hypothesis with faults. ``ambiguous``: other hypotheses are indistinguishable from the best.
``unexplained``: the best hypothesis predicts significantly worse than the self-model predicts the
healthy robot, or significantly worse than with a fault of an unsearched kind, so a fault is
missing; requires a trial of the healthy robot. A diagnosis is also ``unexplained`` if the
simulation of every hypothesis diverged. ``not judged``: a fault or an error of the self-model
explains the trials, and neither the healthy trials nor the comparator decide between them; see
``adequacy``. Or a fault explains most of the loss of an intact robot, and few pieces tell."""


@dataclass(frozen=True)
class Candidate:
    """A hypothesis in canonical form, and the sum of its distances from the trials.

    The distance is in the comparator's unit.
    """

    hypothesis: Hypothesis
    distance: float


@dataclass(frozen=True)
class UnsearchedFault:
    """A hypothesis with one fault of an unsearched kind, and the name of that kind.

    ``others`` are the best hypotheses of each other unsearched kind that predicts the trials
    significantly better too, by the kind's name.
    """

    hypothesis: Hypothesis
    kind: str
    others: Mapping[str, Hypothesis] = field(default_factory=dict)

    @property
    def named(self) -> tuple[Hypothesis, ...]:
        """The hypothesis and the others."""
        return (self.hypothesis, *self.others.values())


@dataclass(frozen=True)
class Fit:
    """How well the best hypothesis predicts the trials, in the loss of the comparator.

    Attributes:
        loss: Mean loss of the best hypothesis on a piece of the trials.
        intact_loss: Mean loss of the empty hypothesis on the same pieces.
        healthy_loss: Mean loss to expect of the right hypothesis, the reference: that of the empty
            one on the healthy trials; in another gait more, if that is harder to predict. None
            without healthy trials.
        excess: Excess of ``loss`` over ``healthy_loss``, standard errors; None without healthy
            trials.
        threshold: Excess above which the verdict is ``unexplained``, standard errors.
        has_faults: Whether the best hypothesis has faults.
        left: Share of the loss of the empty hypothesis beyond the reference that is left, 0 to 1;
            None without such a loss.
        joints: Excess of the loss of single joints over that on healthy trials with the same gait,
            standard errors, by the joint's name, largest first: those of at least
            ``MIN_Z_OF_JOINT``, and none if the best hypothesis has faults.
    """

    loss: float
    intact_loss: float
    healthy_loss: float | None
    excess: float | None
    threshold: float
    has_faults: bool
    left: float | None = None
    joints: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Residual:
    """The loss of the best hypothesis beyond that of healthy trials.

    Attributes:
        signals: Excess of the mean loss of each signal, largest first, at most three.
        trial: Name of the trial with the worst time.
        begin, end: The worst time, s since the start of that trial.
    """

    signals: Mapping[str, float]
    trial: str
    begin: float
    end: float


@dataclass(frozen=True)
class Doubt:
    """The reason for which trials cannot be judged, a clause, and what to do about it.

    ``words`` is the reason in plain words; empty if it is an error of the self-model.
    """

    reason: str
    remedy: str
    words: str = ""


@dataclass(frozen=True)
class Cost:
    """What a search has simulated, with the surrogates and the tests of the verdict.

    Refits of the self-model are no part of it. Of trials that are diagnosed one by one, it is the
    cost of all diagnoses so far.

    Attributes:
        hypotheses: Distinct hypotheses.
        control_steps: Control steps of their simulations.
    """

    hypotheses: int
    control_steps: int


@dataclass(frozen=True)
class Change:
    """A change of the robot, or of its environment, at a time.

    Attributes:
        trial: Name of the trial in which the change occurred.
        index: Index of that trial among the trials of the diagnosis.
        time, earliest, latest: Time of the change and its bounds, s since the start of that trial.
        before: Best hypothesis about the time before the change.
        after: Hypothesis about the time after the change, with which the time was found.
    """

    trial: str
    index: int
    time: float
    earliest: float
    latest: float
    before: Hypothesis
    after: Hypothesis

    def __str__(self) -> str:
        return (
            f"changed at about t = {self.time:.1f} s ({self.earliest:.1f} to {self.latest:.1f}) "
            f"of {self.trial}; before: {self.before}"
        )

    def since(self, trials: Sequence[Trial]) -> list[TrialPart]:
        """Returns the parts of all trials of the diagnosis from the change on.

        The first piece after the change is left out: the change may lie in it, and then neither
        hypothesis predicts it.
        """
        first, *rest = trials[self.index :]
        return [TrialPart(first, begin=math.nextafter(self.time, math.inf)), *map(TrialPart, rest)]

    def until(self, trials: Sequence[Trial]) -> list[TrialPart]:
        """Returns the parts of all trials of the diagnosis up to the change."""
        *earlier, last = trials[: self.index + 1]
        return [*map(TrialPart, earlier), TrialPart(last, end=self.time)]


@dataclass(frozen=True)
class DetectableSeverity:
    """The smallest severities of a fault that the trials would have shown, on either side.

    Attributes:
        part: Name of the part; empty for an environment.
        below: The largest severity below the nominal one that predicts the trials clearly worse
            than the best hypothesis; None if no such severity would have shown.
        above: The smallest severity above the nominal one, likewise.
    """

    kind: str
    part: str
    below: float | None
    above: float | None


@dataclass(frozen=True)
class Diagnosis:
    """Hypotheses ranked against some trials, and a verdict.

    Attributes:
        ranked: Candidates, at least one. The first is the best: the hypothesis with the fewest
            faults, each of which makes the prediction significantly better; of the EA alone,
            the one with the smallest distance. The others follow by
            distance, at equal distances by number of faults. Of hypotheses that differ in
            severities alone, only the first is ranked.
        trials: Number of trials.
        intact_distance: Distance of the empty hypothesis.
        indistinguishable: Hypotheses not significantly worse than the best, smallest distance
            first; see ``alternatives.indistinguishable``.
        verdict: ``intact``, ``explained``, ``ambiguous``, ``unexplained`` or ``not judged``; see
            ``Verdict``.
        test: Name of the test behind ``indistinguishable``.
        unsearched: The best hypothesis with a fault of an unsearched kind, if it predicts the
            trials significantly better; see ``alternatives.unsearched_fault``.
        also_searched: Names of the kinds that were searched beyond those that were asked for,
            because faults of them predicted the trials better.
        undetectable: The best hypothesis with one more fault, for each undetectable fault,
            smallest distance first, at most as many as are ranked.
        reason: Cause of the verdict and remedy, if every simulation diverged; else empty.
        detectable: Smallest detectable severities of each kind and part, if the best hypothesis
            is the empty one; see ``alternatives.detectable_severities``.
        fit: Numbers behind the verdict; None if every simulation diverged.
        change: Change of the robot during the trials; the diagnosis is about the time after it.
            None if one hypothesis is enough.
        residual: Signals and time of the loss that is left, if it is unexplained.
        doubt: Why the trials cannot be judged, if they cannot.
        probability: Probabilities of the best hypothesis and its neighbours, by their notation; see
            ``verdict.probabilities``. None without healthy trials,
            and of trials that are not judged.
        cost: What the search has simulated.
        left_out: Faults of the best hypothesis of the search that an error of the self-model
            explains as well; see ``adequacy.supported``. ``fit`` is then by the refitted model.
    """

    ranked: tuple[Candidate, ...]
    trials: int
    intact_distance: float
    indistinguishable: tuple[Hypothesis, ...]
    verdict: Verdict
    test: str
    unsearched: UnsearchedFault | None = None
    also_searched: tuple[str, ...] = ()
    undetectable: tuple[Hypothesis, ...] = ()
    reason: str = ""
    detectable: tuple[DetectableSeverity, ...] = ()
    fit: Fit | None = None
    change: Change | None = None
    residual: Residual | None = None
    doubt: Doubt | None = None
    probability: Mapping[str, float] = field(default_factory=dict)
    left_out: tuple[Hypothesis, ...] = ()
    cost: Cost = Cost(0, 0)

    @property
    def best(self) -> Hypothesis:
        """The best hypothesis."""
        return self.ranked[0].hypothesis

    @property
    def undetectable_faults(self) -> tuple[Hypothesis, ...]:
        """The undetectable faults without those of the best hypothesis."""
        known = set(self.best.faults)
        return tuple(
            Hypothesis(tuple(fault for fault in one.faults if fault not in known))
            for one in self.undetectable
        )

    def explained(self, trials: Sequence[Trial]) -> list[Trial]:
        """Returns the rows of the trials that the diagnosis is about: those after a change."""
        if self.change is None:
            return list(trials)
        return [part.rows for part in self.change.since(trials)]

    def __repr__(self) -> str:
        lines = [f"<Diagnosis of {counted(self.trials, 'trial')}: {self.best}, {self.verdict}"]
        lines += [f"  {one.distance:10.4f}  {one.hypothesis}" for one in self.ranked]
        for name in ("indistinguishable", "undetectable"):
            others = ", ".join(map(str, getattr(self, name)))
            lines += [f"  {name}: {others}"] if others else []
        if self.unsearched is not None:
            lines.append(f"  unsearched: {self.unsearched.hypothesis} ({self.unsearched.kind})")
        lines += [f"  {self.change}"] if self.change else []
        lines += [f"  reason: {self.reason}"] if self.reason else []
        lines += [f"  reason: {self.doubt.reason}; {self.doubt.remedy}"] if self.doubt else []
        return "\n".join(lines) + ">"

    def to_dict(self) -> dict[str, Any]:
        """Returns the JSON values: every attribute by its name, as in a run's ``diagnoses.json``.

        A hypothesis is its notation. An infinite number, as of a diverged simulation, is null.
        """
        return {**to_json(self), "reason": self.reason or None}

    def to_pandas(self) -> Any:  # noqa: ANN401  # pandas has no types
        """Returns the ranking as a ``pandas.DataFrame``: hypothesis and distance, best first."""
        return data_frame([to_json(candidate) for candidate in self.ranked])

    def plot(self) -> Any:  # noqa: ANN401  # matplotlib is slow to import
        """Returns the ranking as a ``matplotlib.figure.Figure``: distances, best first."""
        from selfmodel.style import values_by_name  # noqa: PLC0415  # matplotlib is slow to import

        title = f"{self.best}, {self.verdict}"
        names = [str(candidate.hypothesis) for candidate in self.ranked]
        distances = [candidate.distance for candidate in self.ranked]
        return values_by_name(title, "distance", names, distances, reference=self.intact_distance)


def output_of(diagnosis: Diagnosis) -> dict[str, Any]:
    """Returns the values of a diagnosis in ``--json`` output, where the ranking is ``diagnosis``.

    The number of trials is left out.
    """
    values = diagnosis.to_dict()
    del values["trials"]
    return {"diagnosis": values.pop("ranked"), **values}


OLD_KEYS: Mapping[str, str] = {
    "rivals": "indistinguishable",
    "unseen": "undetectable",
    "outside": "unsearched",
}
"""Keys of JSON that selfmodel 0.1 wrote, with the keys of now."""


def renamed(values: Mapping[str, Any]) -> dict[str, Any]:
    """Returns JSON values with the keys of now in the place of those of selfmodel 0.1."""
    return {OLD_KEYS.get(key, key): value for key, value in values.items()}


def diagnosis_from_dict(values: Mapping[str, Any], parse: Callable[[str], Hypothesis]) -> Diagnosis:
    """Returns a diagnosis from the values of ``Diagnosis.to_dict``.

    Or from those of ``output_of`` with a number of ``trials``. Those of selfmodel 0.1 lack some
    keys, and may have undetectable faults alone, without the best hypothesis.

    Raises:
        ValueError: A value is invalid, or has another type.
        KeyError: A key is missing.
        AttributeError: The values are no object.
    """
    named = renamed(values)
    named["reason"] = named.get("reason") or ""
    named["ranked"] = named.get("ranked", named.get("diagnosis"))
    try:
        diagnosis: Diagnosis = _from_json(Diagnosis, named, parse)
    except msgspec.ValidationError as error:
        raise ValueError(str(error)) from error
    if not diagnosis.ranked:
        raise ValueError("expected at least one ranked hypothesis, got none")
    best, fit = diagnosis.best.faults, diagnosis.fit
    probability = diagnosis.probability.values()
    if min(probability, default=0.0) < 0 or sum(probability) > 1 + 1e-9:
        raise ValueError(f"expected probabilities of at most 1 together, got {[*probability]}")
    complete = (sorted({*best, *one.faults}) for one in diagnosis.undetectable)
    # Both are null without healthy trials; null beside a number is infinite.
    if fit is not None and (fit.healthy_loss is None) != (fit.excess is None):
        healthy = math.inf if fit.healthy_loss is None else fit.healthy_loss
        excess = math.inf if fit.excess is None else fit.excess
        fit = dataclasses.replace(fit, healthy_loss=healthy, excess=excess)
    undetectable = tuple(Hypothesis(tuple(faults)) for faults in complete)
    return dataclasses.replace(diagnosis, fit=fit, undetectable=undetectable)


def to_json(value: object) -> Any:  # noqa: ANN401  # JSON values
    """Returns the JSON values of a record, by the names of its attributes; NaN is None."""
    match value:
        case Hypothesis():
            return str(value)
        case Mapping():
            return {key: to_json(one) for key, one in value.items()}
        case list() | tuple():
            return [to_json(one) for one in value]
        case float():
            return finite_or_none(value)  # infinite if a simulation diverged
    if dataclasses.is_dataclass(value):
        return {one.name: to_json(getattr(value, one.name)) for one in dataclasses.fields(value)}
    return value


def _from_json(  # noqa: PLR0911  # a result for each shape of a type
    kind: Any,  # noqa: ANN401
    value: Any,  # noqa: ANN401
    parse: Callable[[str], Hypothesis],
) -> Any:  # noqa: ANN401
    """Returns the value of a field of a type, from its JSON value."""
    parts, origin = get_args(kind), get_origin(kind)
    if type(None) in parts:
        return None if value is None else _from_json(parts[0], value, parse)
    if kind is Hypothesis:
        return parse(msgspec.convert(value, str))
    if origin is tuple:
        items = msgspec.convert(value, list)
        return tuple(_from_json(parts[0], one, parse) for one in items)
    if origin is Mapping:
        entries = msgspec.convert(value, dict)
        return {key: _from_json(parts[1], one, parse) for key, one in entries.items()}
    if dataclasses.is_dataclass(kind):
        types, given = get_type_hints(kind), msgspec.convert(value, dict)
        # A key with a default may be missing; without one, the look-up names it.
        names = [
            one.name
            for one in dataclasses.fields(kind)
            if one.name in given or one.default is one.default_factory  # both missing
        ]
        record: Any = kind
        return record(**{name: _from_json(types[name], given[name], parse) for name in names})
    if kind is float and value is None:
        return math.inf
    return msgspec.convert(value, FINITE if kind is float else kind)


FINITE = Annotated[float, msgspec.Meta(ge=-sys.float_info.max, le=sys.float_info.max)]
