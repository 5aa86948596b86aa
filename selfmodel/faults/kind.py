"""A fault, and the base class of the kinds of faults and environments.

The kinds are in ``joints.py``, ``sensors.py`` and ``world.py``; ``registry.py`` says how to add
one.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import total_ordering
from typing import TYPE_CHECKING, Literal, Optional

import numpy as np

from selfmodel.arrays import BoolArray, FloatArray
from selfmodel.errors import InputError, check_name, check_type, real_number, typed
from selfmodel.robot.anatomy import Anatomy
from selfmodel.trials.trajectory import Trajectory

if TYPE_CHECKING:
    from mujoco import MjSpec

    from selfmodel.robot.model_variant import ModelVariant

ENVIRONMENT = ""
"""Part of the kinds that apply to the world or to the whole robot; notation omits it."""


@typed
@total_ordering
@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FaultKind:
    """A kind of fault or of environment; compared, sorted and hashed by its name.

    A kind is an object of a subclass, which overrides ``apply`` and as many of the other methods as
    it needs.

    In notation, a fault is ``keyword``, ``keyword:part``, ``keyword=severity`` or
    ``keyword:part=severity``, with the prefix in front of the severity's number. Two kinds may
    share a keyword if their prefixes differ: ``sensor:X`` and ``sensor:X=gain0.2`` are faults of
    two kinds.

    Attributes:
        name: Name on the command line, such as ``sensor-gain``.
        keyword: First word in notation, such as ``sensor``; "" for the name.
        prefix: Letters in front of the severity's number in notation.
        bounds: Lowest and highest severity; None for a kind without severities.
        levels: Severities that the search proposes, in the order of a gene's fourth value.
        unit: Unit of the severity.
        words: Clause about a fault in plain words, a format with ``part``, ``severity``, its
            ``amount`` without the sign, that in ``degrees``, ``side`` and ``at`` (" at the " and
            the part, empty without one), such as "the joint {part} is stuck"; "" for the notation.
        sides: ``side`` in ``words``: of a severity up to the nominal one, and of one above it.
        degenerates_to: Severities at which the fault is equivalent to one of another kind, without
            a severity or of severity 0, or to no fault (None).
        degenerates_alone_to: Severities at which the fault is equivalent to one of another kind,
            without a severity, unless the hypothesis has a fault that the equivalent would absorb:
            a sensor with a gain of 0 has failed, but with a gain of 0 and a bias it is stuck.
        affects_dynamics: Whether the fault changes the robot's motion under given commands. If
            not, it changes readings only and shares the simulation of the same commands.
        is_of_joint: Whether the parts are joints, and the fault shows in the motion of the joint
            that it names, as its encoder measures it. Losses of single joints then decide on it.
        is_single: Whether a hypothesis has at most one fault of the kind, at one part.
        searchable: Whether a diagnosis may propose the kind; otherwise only a simulated physical
            robot has it.
        base: Base of the robots on which the kind is to be expected, such as ``free`` for wind. On
            others it is searched if it is named, and not as one of the default kinds.
    """

    name: str
    keyword: str = ""
    prefix: str = ""
    bounds: tuple[float, float] | None = None
    levels: tuple[float, ...] = (0.0,)
    unit: str = ""
    words: str = ""
    sides: tuple[str, str] = ("low", "high")
    degenerates_to: Mapping[float, Optional["FaultKind"]] = field(default_factory=dict)
    degenerates_alone_to: Mapping[float, "FaultKind"] = field(default_factory=dict)
    affects_dynamics: bool = True
    is_of_joint: bool = False
    is_single: bool = False
    searchable: bool = True
    base: Literal["any", "free", "fixed"] = "any"

    def __post_init__(self) -> None:
        for name, numbers in (("levels", self.levels), ("bounds", self.bounds or ())):
            for place, one in enumerate(numbers):
                real_number(f"{name}[{place}]", one, 0.5, kind="real")
        for to in (*self.degenerates_to.values(), *self.degenerates_alone_to.values()):
            check_type(to, FaultKind | None, "a FaultKind, such as selfmodel.faults.JAMMED")
        check_name("base of a fault kind", self.base, ("any", "free", "fixed"))
        if self.bounds is not None and not (
            len(self.bounds) == 2 and self.bounds[0] <= self.bounds[1]
        ):
            raise InputError(f"expected (lowest, highest) as bounds, got {self.bounds}")
        object.__setattr__(self, "keyword", self.keyword or self.name)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}>"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, FaultKind) and self.name == other.name

    def __lt__(self, other: "FaultKind") -> bool:
        return self.name < other.name

    def __hash__(self) -> int:
        return hash(self.name)

    def parts(self, _anatomy: Anatomy) -> tuple[str, ...]:
        """Returns the names of the parts that the kind applies to.

        They are in the order of a gene's third value; ``ENVIRONMENT`` alone for an environment.
        """
        return (ENVIRONMENT,)

    def suits(self, anatomy: Anatomy) -> bool:
        """Returns whether the kind is to be expected on a robot; see ``base``."""
        return self.base in ("any", "free" if anatomy.floating_base else "fixed")

    def hinges(self, _anatomy: Anatomy, _part: str) -> Mapping[str, tuple[float, float]]:
        """Returns the hinges whose angles a fault may name, each with its range; by default none.

        In notation the angles, rad, are after the prefix, with ``/`` between them.
        """
        return {}

    def bounds_at(self, _anatomy: Anatomy, _part: str) -> tuple[float, float] | None:
        """Returns ``bounds`` at one part."""
        return self.bounds

    def levels_at(self, _anatomy: Anatomy, _part: str) -> tuple[float, ...]:
        """Returns ``levels`` at one part."""
        return self.levels

    def apply(self, variant: "ModelVariant", anatomy: Anatomy, fault: "Fault") -> None:
        """Edits a variant: its model, readings or neurons. The layout of the model stays.

        Faults are applied in the order of their kinds' names.
        """
        raise NotImplementedError(f"give the class of the fault kind {self.name} a method apply")

    def edit_specification(self, spec: "MjSpec", fault: "Fault", seed: int) -> None:
        """Edits the robot's specification before it is compiled; by default, not at all.

        It is for changes that a compiled model does not allow. The sizes of MjData stay. The seed
        is that of the random parts.
        """

    def adapt_to_contacts(
        self, variant: "ModelVariant", fault: "Fault", points: FloatArray
    ) -> None:
        """Adapts a variant to a trial before its segments are predicted; by default, not.

        The points are contacts observed in the trial, ``(n, 3)``, world frame, m.
        """

    def contradicted(self, _fault: "Fault", trajectory: Trajectory) -> BoolArray:
        """Returns a mask of the steps of a log that a fault excludes, ``(steps,)``.

        Such as those in which a failed sensor reads something; by default none.
        """
        return np.zeros(trajectory.steps, dtype=np.bool_)

    def absorbs(self, _fault: "Fault", _other: "Fault", _anatomy: Anatomy) -> bool:
        """Returns whether a fault of this kind removes any effect of another; by default, not."""
        return False

    @property
    def edits_specification(self) -> bool:
        """Whether the kind has ``edit_specification``."""
        return type(self).edit_specification is not FaultKind.edit_specification

    @property
    def adapts_to_contacts(self) -> bool:
        """Whether the kind has ``adapt_to_contacts``."""
        return type(self).adapt_to_contacts is not FaultKind.adapt_to_contacts

    @property
    def nominal(self) -> float | None:
        """The severity at which a fault has no effect; None if there is none, or it is unknown."""
        return next((value for value, to in self.degenerates_to.items() if to is None), None)

    @property
    def degenerate_kinds(self) -> tuple["FaultKind", ...]:
        """Kinds that a fault of this kind degenerates to."""
        kinds = (*self.degenerates_to.values(), *self.degenerates_alone_to.values())
        return tuple(dict.fromkeys(filter(None, kinds)))

    @property
    def without_severity(self) -> "FaultKind":
        """The first of ``degenerate_kinds``; the kind itself if there is none."""
        return self.degenerate_kinds[0] if self.degenerate_kinds else self

    def candidates(self, anatomy: Anatomy) -> tuple["Fault", ...]:
        """Returns the faults that a genome can encode: each part at each level."""
        return tuple(
            Fault(self, part, severity)
            for part in self.parts(anatomy)
            for severity in self.levels_at(anatomy, part)
        )


@typed
@dataclass(frozen=True, order=True)
class Fault:
    """A fault: one difference of the robot or of the world from the nominal model.

    Attributes:
        kind: Kind of the fault.
        part: Name of the joint, sensor, neuron or place; ``ENVIRONMENT`` for an environment.
        severity: Severity in the kind's unit; 0 for a kind without severities.
        angles: Angles of the hinges of a locked leg, rad; see ``FaultKind.hinges``.
    """

    kind: FaultKind
    part: str
    severity: float = 0.0
    angles: tuple[float, ...] = ()

    def __str__(self) -> str:
        term = f"{self.kind.keyword}:{self.part}" if self.part else self.kind.keyword
        values = "/".join(map(repr, self.angles if self.kind.bounds is None else [self.severity]))
        return f"{term}={self.kind.prefix}{values}" if self.kind.prefix or values else term

    @property
    def words(self) -> str:
        """A clause about the fault; see ``FaultKind.words``."""
        if not self.kind.words:
            return f"there is the fault {self}"
        amount, nominal = abs(self.severity), self.kind.nominal or 0.0
        side = self.kind.sides[bool(self.severity > nominal)]
        named = {"part": self.part, "severity": self.severity, "amount": amount, "side": side}
        at, degrees = f" at the {self.part}" if self.part else "", math.degrees(amount)
        return self.kind.words.format(**named, at=at, degrees=degrees).replace("%", " %")

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
