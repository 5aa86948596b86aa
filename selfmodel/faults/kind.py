"""A fault, and the record of callables that defines a kind of fault or of environment."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.robot.anatomy import Anatomy
from selfmodel.trials.behaviour import Behaviour

if TYPE_CHECKING:
    from mujoco import MjSpec

    from selfmodel.robot.embodiment import Embodiment

Values = TypeVar("Values")

ENVIRONMENT = ""
"""Part of the kinds that apply to the world or to the whole robot; notation omits it."""


def joints(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the names of the joints that can fail."""
    return tuple(joint.name for joint in anatomy.joints)


def joints_with_motors(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the joints with motors; a motor of several joints belongs to the first joint."""
    return tuple(joint.name for joint in anatomy.joints if joint.motors)


def joints_with_servos(anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the joints with motors with position feedback."""
    return tuple(joint.name for joint in anatomy.joints if joint.servos)


def environment_part(_anatomy: Anatomy) -> tuple[str, ...]:
    """Returns the only part of an environment kind."""
    return (ENVIRONMENT,)


def absorbs_nothing(_fault: "Fault", _other: "Fault", _anatomy: Anatomy) -> bool:
    """Returns False: every other fault keeps its effect."""
    return False


def uniform_bounds(lowest: float, highest: float) -> Callable[[Anatomy, str], tuple[float, float]]:
    """Returns ``severity_bounds`` that are the same for all parts."""
    return partial(_same_for_all, (lowest, highest))


def uniform_levels(*levels: float) -> Callable[[Anatomy, str], tuple[float, ...]]:
    """Returns ``levels`` that are the same for all parts."""
    return partial(_same_for_all, levels)


def _same_for_all(values: Values, _anatomy: Anatomy, _part: str) -> Values:
    return values


@dataclass(frozen=True, order=True, kw_only=True)
class FaultKind:
    """A kind of fault or of environment; compared, sorted and hashed by its name.

    In notation, a fault is ``keyword``, ``keyword:part``, ``keyword=severity`` or
    ``keyword:part=severity``, with the prefix in front of the severity's number. Two kinds may
    share a keyword if their prefixes differ: ``sensor:X`` and ``sensor:X=gain0.2`` are faults of
    two kinds.

    Attributes:
        name: Name on the command line, such as ``sensor-gain``.
        keyword: First word in notation, such as ``sensor``.
        apply: Edits an embodiment: its model, readings or neurons. The layout of the model stays.
            Faults are applied in the order of their kinds' names.
        edit_spec: Optional hook: edits the robot's specification before it is compiled, given the
            seed of the random parts, for changes that a compiled model does not allow. The sizes
            of MjData stay.
        adapt_to_contacts: Optional hook: adapts an embodiment to the contact points observed in a
            trial, ``(n, 3)``, world frame, m, before segments of that trial are predicted.
        contradicted: Optional hook: returns a mask of the steps of a log that the fault excludes,
            ``(steps,)``, such as those in which a failed sensor reads something.
        parts: Names of the parts that the kind applies to, in the order of a gene's third value;
            ``ENVIRONMENT`` alone for an environment.
        absorbs: Returns whether the first fault, of this kind, removes any effect of the second.
        severity_bounds: Lowest and highest severity at a part; None for a kind without severities.
        levels: Severities at a part that the search proposes, in the order of a gene's fourth
            value.
        degenerates_to: Severities at which the fault is equivalent to one of another kind, without
            a severity, or to no fault (None).
        degenerates_alone_to: Severities at which the fault is equivalent to one of another kind,
            without a severity, unless the hypothesis has a fault that the equivalent would absorb:
            a sensor with a gain of 0 has failed, but with a gain of 0 and a bias it is stuck.
        prefix: Letters in front of the severity's number in notation.
        unit: Unit of the severity.
        affects_dynamics: Whether the fault changes the robot's motion under given commands. If
            not, it changes readings only and shares the simulation of the same commands.
        is_of_joint: Whether the parts are joints, and the fault shows in the motion of the joint
            that it names, as its encoder measures it. Losses of single joints then decide on it.
        is_single: Whether a hypothesis has at most one fault of the kind, at one part.
        searchable: Whether a diagnosis may propose the kind; otherwise only a simulated physical
            robot has it.
    """

    name: str
    keyword: str = field(compare=False)
    apply: Callable[["Embodiment", Anatomy, "Fault"], None] = field(compare=False, repr=False)
    edit_spec: Callable[["MjSpec", "Fault", int], None] | None = field(
        default=None, compare=False, repr=False
    )
    adapt_to_contacts: Callable[["Embodiment", "Fault", FloatArray], None] | None = field(
        default=None, compare=False, repr=False
    )
    contradicted: Callable[["Fault", Behaviour], BoolArray] | None = field(
        default=None, compare=False, repr=False
    )
    parts: Callable[[Anatomy], tuple[str, ...]] = field(
        default=environment_part, compare=False, repr=False
    )
    absorbs: Callable[["Fault", "Fault", Anatomy], bool] = field(
        default=absorbs_nothing, compare=False, repr=False
    )
    severity_bounds: Callable[[Anatomy, str], tuple[float, float]] | None = field(
        default=None, compare=False, repr=False
    )
    levels: Callable[[Anatomy, str], tuple[float, ...]] = field(
        default=uniform_levels(0.0), compare=False, repr=False
    )
    degenerates_to: Mapping[float, "FaultKind | None"] = field(
        default_factory=dict, compare=False, repr=False
    )
    degenerates_alone_to: Mapping[float, "FaultKind"] = field(
        default_factory=dict, compare=False, repr=False
    )
    prefix: str = field(default="", compare=False, repr=False)
    unit: str = field(default="", compare=False, repr=False)
    affects_dynamics: bool = field(default=True, compare=False, repr=False)
    is_of_joint: bool = field(default=False, compare=False, repr=False)
    is_single: bool = field(default=False, compare=False, repr=False)
    searchable: bool = field(default=True, compare=False, repr=False)

    @property
    def degenerate_severities(self) -> tuple[float, ...]:
        """Severities at which the fault is equivalent to one of another kind, or to none."""
        return (*self.degenerates_to, *self.degenerates_alone_to)

    @property
    def degenerate_kinds(self) -> tuple["FaultKind", ...]:
        """Kinds that a fault of this kind degenerates to."""
        kinds = (*self.degenerates_to.values(), *self.degenerates_alone_to.values())
        return tuple(dict.fromkeys(kind for kind in kinds if kind is not None))

    @property
    def without_severity(self) -> "FaultKind":
        """The first of ``degenerate_kinds``; the kind itself if there is none."""
        return self.degenerate_kinds[0] if self.degenerate_kinds else self

    def candidates(self, anatomy: Anatomy) -> tuple["Fault", ...]:
        """Returns the faults that a genome can encode: each part at each level."""
        return tuple(
            Fault(self, part, severity)
            for part in self.parts(anatomy)
            for severity in self.levels(anatomy, part)
        )


@dataclass(frozen=True, order=True)
class Fault:
    """A fault: one difference of the robot or of the world from the nominal model.

    Attributes:
        kind: Kind of the fault.
        part: Name of the joint, sensor, neuron or place; ``ENVIRONMENT`` for an environment.
        severity: Severity in the kind's unit; 0 for a kind without severities.
    """

    kind: FaultKind
    part: str
    severity: float = 0.0

    def __str__(self) -> str:
        term = f"{self.kind.keyword}:{self.part}" if self.part else self.kind.keyword
        return (
            term
            if self.kind.severity_bounds is None
            else f"{term}={self.kind.prefix}{self.severity!r}"
        )

    @property
    def canonical(self) -> "Fault | None":
        """The equivalent fault without a severity, if any; None if the severity is nominal."""
        if self.severity not in self.kind.degenerates_to:
            return self
        kind = self.kind.degenerates_to[self.severity]
        return None if kind is None else Fault(kind, self.part)

    @property
    def canonical_alone(self) -> "Fault":
        """The equivalent fault without a severity, if no other fault affects the part."""
        kind = self.kind.degenerates_alone_to.get(self.severity)
        return self if kind is None else Fault(kind, self.part)
