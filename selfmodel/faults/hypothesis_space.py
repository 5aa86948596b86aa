"""Search space: hypotheses about one robot, their genomes, candidates and neighbours."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from selfmodel.arrays import FloatArray
from selfmodel.errors import InputError
from selfmodel.faults import notation
from selfmodel.faults.hypothesis import Hypothesis, canonical
from selfmodel.faults.joints import JAMMED, JAMMED_AT_ANGLE
from selfmodel.faults.kind import Fault, FaultKind
from selfmodel.faults.registry import notation_kinds, suitable
from selfmodel.robot.anatomy import Anatomy

GENE_VALUES = 4
"""Values per gene, each in [0, 1): active from 0.5 on, kind, part, severity."""

COARSE_LEVELS = 4
"""Levels per part among the coarse candidates; the severity is fitted once the part is known."""


@dataclass(frozen=True)
class HypothesisSpace:
    """Hypotheses of some fault kinds about one robot.

    Every method that returns hypotheses returns them in canonical form. The genome is that of the
    paper, section III (diagnostic EA): genes of four values, which encode whether the gene is
    active, the kind of failure, its part and its severity; the paper leaves the severity unused.

    Attributes:
        anatomy: The robot's parts.
        kinds: Fault kinds, in the order of the second value of a gene.
        observed: Faults whose severity the trials contain: those of the searched kinds are coarse
            candidates in the place of the levels of the same kind and part.
        left_out: Kinds at parts that are not searched: they equal another kind in the trials, or
            the trials show that they are not there.
    """

    anatomy: Anatomy
    kinds: tuple[FaultKind, ...]
    observed: tuple[Fault, ...] = ()
    left_out: frozenset[tuple[FaultKind, str]] = frozenset()

    @classmethod
    def of(cls, kinds: Iterable[FaultKind], anatomy: Anatomy) -> "HypothesisSpace":
        """Returns the search space of the kinds that apply to a robot, in their order.

        Of the default kinds, those are left out that are not to be expected on its base.
        Then come the kinds that a fault degenerates to at some severities: ``jam-angle`` implies
        ``jam``, and ``sensor-gain`` implies ``sensor``.

        Raises:
            InputError: No kind applies to the robot, or a kind is not searchable.
        """
        requested = suitable(tuple(kinds), anatomy)
        names = ", ".join(kind.name for kind in requested if not kind.searchable)
        if names:
            raise InputError(f"no diagnosis may propose {names}: leave {names} out")
        implied = [other for kind in requested for other in kind.degenerate_kinds]
        candidates = dict.fromkeys((*requested, *implied))
        applicable = tuple(kind for kind in candidates if kind.candidates(anatomy))
        if not applicable:
            raise InputError(
                f"{', '.join(kind.name for kind in requested)} cannot affect any part of the "
                f"robot, so there is nothing to diagnose: choose other kinds, or name its limbs "
                f"and sensors"
            )
        return cls(anatomy, applicable)

    def including(self, hypotheses: Iterable[Hypothesis]) -> "HypothesisSpace":
        """Returns the space with the kinds of the faults of some hypotheses as well."""
        kinds = [fault.kind for one in hypotheses for fault in one.faults]
        implied = [other for kind in kinds for other in kind.degenerate_kinds]
        return replace(self, kinds=tuple(dict.fromkeys((*self.kinds, *kinds, *implied))))

    def has(self, hypothesis: Hypothesis) -> bool:
        """Returns whether each fault of a hypothesis is of a searched kind, at a searched part."""
        faults = hypothesis.faults
        return all(one.kind in self.kinds and one.part in self.parts(one.kind) for one in faults)

    def parse(self, text: str) -> Hypothesis:
        """Returns the hypothesis of a notation; it may name ``kinds`` and all built-in kinds."""
        return notation.parse(text, self.anatomy, notation_kinds(self.kinds))

    def canonical(self, faults: Iterable[Fault]) -> Hypothesis:
        """Returns the canonical form of a set of faults; see ``hypothesis.canonical``.

        Jams of all joints of a leg that was observed to be locked are that one fault.
        """
        found = canonical(faults, self.anatomy)
        jammed = {one.part for one in found.faults if one.kind in (JAMMED, JAMMED_AT_ANGLE)}
        whole = [
            leg
            for leg in (self._shown.values() if len(jammed) > 1 else ())
            if jammed.issuperset(joint.name for joint in self.anatomy.limbs[leg.part])
        ]
        return canonical([*found.faults, *whole], self.anatomy) if whole else found

    def parts(self, kind: FaultKind) -> tuple[str, ...]:
        """Returns the parts of a kind, in the order of the third value of a gene."""
        parts = kind.parts(self.anatomy)
        return tuple(part for part in parts if (kind, part) not in self.left_out)

    def without(self, kind: FaultKind, parts: Iterable[str]) -> "HypothesisSpace":
        """Returns the space in which a kind is not searched at some parts; see ``left_out``."""
        space = replace(self, left_out=self.left_out | {(kind, part) for part in parts})
        kinds = tuple(one for one in self.kinds if space.parts(one))
        return replace(space, kinds=kinds)

    def levels(self, fault: Fault) -> tuple[float, ...]:
        """Returns the severity levels of a fault's kind at its part."""
        return fault.kind.levels_at(self.anatomy, fault.part)

    def severity_bounds(self, fault: Fault) -> tuple[float, float] | None:
        """Returns the lowest and highest severity at a fault's part; None without severities."""
        return fault.kind.bounds_at(self.anatomy, fault.part)

    @cached_property
    def coarse_candidates(self) -> tuple[Fault, ...]:
        """Every kind at every part, at ``COARSE_LEVELS`` evenly spaced levels or fewer.

        An observed fault takes the place of the levels of its kind and part.
        """
        known = {(fault.kind, fault.part) for fault in self.observed}
        spaced = [
            Fault(kind, part, level)
            for kind in self.kinds
            for part in self.parts(kind)
            if (kind, part) not in known
            for level in _evenly_spaced(kind.levels_at(self.anatomy, part))
        ]
        return (*spaced, *(fault for fault in self.observed if fault.kind in self.kinds))

    @cached_property
    def _shown(self) -> dict[tuple[FaultKind, str], Fault]:
        """The observed locked legs, where they are searched: no level stands for their angles."""
        legs = [fault for fault in self.observed if fault.angles and fault.kind in self.kinds]
        return {(fault.kind, fault.part): fault for fault in legs}

    def decode(self, genome: FloatArray) -> Hypothesis:
        """Returns the hypothesis of a genome, values in [0, 1), ``(genes * GENE_VALUES,)``."""
        faults = []
        for active, kind_value, part_value, severity_value in genome.reshape(-1, GENE_VALUES):
            if active >= 0.5:
                kind = self.kinds[int(kind_value * len(self.kinds))]
                parts = self.parts(kind)
                part = parts[int(part_value * len(parts))]
                levels = kind.levels_at(self.anatomy, part)
                fault = Fault(kind, part, levels[int(severity_value * len(levels))])
                faults.append(self._shown.get((kind, part), fault))
        return self.canonical(faults)

    def encode(self, hypothesis: Hypothesis, genes: int) -> FloatArray:
        """Returns a genome that decodes to a hypothesis, ``(genes * GENE_VALUES,)``.

        The faults are of ``kinds``, and at most as many as the genes. A severity between two levels
        is rounded to the nearest level, so a hypothesis with fitted severities can seed a search.
        """
        genome = np.full((genes, GENE_VALUES), 0.25)
        for gene, fault in zip(genome[: len(hypothesis)], hypothesis.faults, strict=True):
            parts, levels = self.parts(fault.kind), self.levels(fault)
            nearest = int(np.argmin(np.abs(np.array(levels) - fault.severity)))
            # The middle of an index's interval of [0, 1) is exact under int(value * count).
            gene[:] = (
                0.75,
                (self.kinds.index(fault.kind) + 0.5) / len(self.kinds),
                (parts.index(fault.part) + 0.5) / len(parts),
                (nearest + 0.5) / len(levels),
            )
        return genome.ravel()

    def with_severity(self, hypothesis: Hypothesis, index: int, severity: float) -> Hypothesis:
        """Returns a hypothesis with another severity of the fault at an index."""
        faults = list(hypothesis.faults)
        faults[index] = replace(faults[index], severity=severity)
        return self.canonical(faults)

    def with_one_more(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """Returns the hypotheses with one coarse candidate added."""
        more = [(*hypothesis.faults, fault) for fault in self.coarse_candidates]
        return self._others(hypothesis, more)

    def with_one_replaced(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """Returns the hypotheses with a coarse candidate in the place of one fault."""
        faults = hypothesis.faults
        fewer = [(*faults[:i], *faults[i + 1 :]) for i in range(len(faults))]
        replaced = [(*rest, fault) for rest in fewer for fault in self.coarse_candidates]
        return self._others(hypothesis, replaced)

    def with_one_less(self, hypothesis: Hypothesis) -> list[Hypothesis]:
        """Returns the hypotheses with one fault removed, or degenerated to a simpler kind."""
        faults = hypothesis.faults
        fewer = [faults[:i] + faults[i + 1 :] for i in range(len(faults))]
        simpler = [
            (*faults[:i], replace(fault, severity=severity), *faults[i + 1 :])
            for i, fault in enumerate(faults)
            if fault.severity not in fault.kind.degenerates_alone_to
            for severity in (*fault.kind.degenerates_to, *fault.kind.degenerates_alone_to)
        ]
        unposed = [
            (*faults[:i], replace(fault, angles=()), *faults[i + 1 :])
            for i, fault in enumerate(faults)
            if fault.angles
        ]
        return self._others(hypothesis, [*fewer, *simpler, *unposed])

    def _others(
        self, hypothesis: Hypothesis, changed: Iterable[Sequence[Fault]]
    ) -> list[Hypothesis]:
        distinct = dict.fromkeys(self.canonical(faults) for faults in changed)
        return [other for other in distinct if other != hypothesis]


def _evenly_spaced(levels: Sequence[float]) -> list[float]:
    """Returns at most ``COARSE_LEVELS`` of some levels, with the first and the last."""
    indices = np.linspace(0, len(levels) - 1, COARSE_LEVELS).round().astype(int).tolist()
    return [levels[i] for i in dict.fromkeys(indices)]
