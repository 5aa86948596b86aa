"""Tests of the hypothesis space: genomes, neighbours, severities."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from selfmodel.faults.hypothesis import canonical
from selfmodel.faults.hypothesis_space import GENE_VALUES, HypothesisSpace
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS, PAPER_KINDS
from selfmodel.tasks import ROBOTS

ANATOMIES = {name: entry.robot().anatomy for name, entry in ROBOTS.items()}
SPACES = {name: HypothesisSpace(anatomy, PAPER_KINDS) for name, anatomy in ANATOMIES.items()}
GENES = 4


@pytest.mark.parametrize("kinds", [PAPER_KINDS, ALL_KINDS], ids=["paper", "all"])
@pytest.mark.parametrize("name", ANATOMIES)
@given(genome=arrays(float, GENES * GENE_VALUES, elements=st.floats(0, 1, exclude_max=True)))
def test_any_genome_decodes_to_a_hypothesis_with_notation_and_a_genome(
    name: str, kinds: tuple[FaultKind, ...], genome: np.ndarray
):
    space = HypothesisSpace(ANATOMIES[name], kinds)
    hypothesis = space.decode(genome)

    assert len(hypothesis) <= GENES
    assert parse(str(hypothesis), ANATOMIES[name]) == hypothesis
    assert space.decode(space.encode(hypothesis, GENES)) == hypothesis
    assert canonical(hypothesis.faults, ANATOMIES[name]) == hypothesis


@pytest.mark.parametrize(
    ("said", "nearest"),
    [
        ("friction=0.42", "friction=0.4"),
        ("motor:front_left_knee=0.97", "motor:front_left_knee=0.9"),
        ("wind=-40", "wind=-30.0"),
        ("slope=0.01", "slope=0.05"),
    ],
)
def test_a_degree_between_two_levels_seeds_the_nearest(said: str, nearest: str):
    space = HypothesisSpace(ANATOMIES["quadruped"], ALL_KINDS)
    genome = space.encode(space.parse(said), GENES)

    assert str(space.decode(genome)) == nearest


@pytest.mark.parametrize(("active", "faults"), [(0.0, 0), (0.499, 0), (0.5, 1), (0.999, 1)])
def test_a_gene_is_active_from_one_half_on(active: float, faults: int):
    assert len(SPACES["quadruped"].decode(np.array([active, 0.0, 0.0, 0.0]))) == faults


@pytest.mark.parametrize("kinds", [PAPER_KINDS, ALL_KINDS], ids=["paper", "all"])
@settings(max_examples=5)
@given(data=st.data())
def test_neighbours_are_canonical_and_differ_from_the_hypothesis_by_one_fault(
    kinds: tuple[FaultKind, ...], data: st.DataObject
):
    space = HypothesisSpace(ANATOMIES["quadruped"], kinds)
    candidates = st.sampled_from(space.coarse_candidates)
    hypothesis = space.canonical(data.draw(st.lists(candidates, max_size=3)))
    own = set(hypothesis.faults)

    neighbours = (space.with_one_more, space.with_one_replaced, space.with_one_less)
    for one in itertools.chain(*(each(hypothesis) for each in neighbours)):
        assert one != hypothesis
        assert one == space.canonical(one.faults)
    assert all(len(set(one.faults) - own) <= 1 for one in space.with_one_replaced(hypothesis))
    less = space.with_one_less(hypothesis)
    assert all(len(one) <= len(hypothesis) for one in less)
    assert {space.canonical(own - {fault}) for fault in own} <= set(less)
    # A failed sensor absorbs its noise, and is absorbed by a jammed joint: one fault less is left.
    for one in space.with_one_more(hypothesis):
        assert len(set(one.faults) - own) == 1 or set(one.faults) < own


def test_a_severity_that_means_another_kind_or_nothing_changes_the_fault():
    space = HypothesisSpace(ANATOMIES["quadruped"], ALL_KINDS)
    weak = space.parse("motor:front_left_knee=0.5+sensor:back_left_angle=gain0.5")

    assert str(space.with_severity(weak, 0, 0.25)).startswith("motor:front_left_knee=0.25+")
    assert str(space.with_severity(weak, 0, 1.0)) == "sensor:back_left_angle=gain0.5"
    assert str(space.with_severity(weak, 1, 0.0)).endswith("+sensor:back_left_angle")
