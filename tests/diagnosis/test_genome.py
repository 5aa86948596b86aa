"""Promises of the diagnostic genome: every genome is a hypothesis, and back again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from selfmodel.diagnosis.genome import VALUES, decode, encode
from selfmodel.errors import InputError
from selfmodel.faults.hypothesis import INTACT, canonical
from selfmodel.faults.kind import FaultKind
from selfmodel.faults.notation import parse
from selfmodel.faults.registry import ALL_KINDS, PAPER_KINDS
from selfmodel.tasks import ROBOTS
from tests.helpers.strategies import hypotheses

ANATOMIES = {name: entry.robot().anatomy for name, entry in ROBOTS.items()}
GENES = 4


@pytest.mark.parametrize("name", ANATOMIES)
@given(data=st.data())
def test_a_hypothesis_encodes_to_a_genome_that_decodes_to_it(name: str, data: st.DataObject):
    hypothesis = data.draw(hypotheses(ANATOMIES[name], most=GENES))

    assert decode(encode(hypothesis, GENES, ANATOMIES[name]), ANATOMIES[name]) == hypothesis


@pytest.mark.parametrize("kinds", [PAPER_KINDS, ALL_KINDS], ids=["paper", "all"])
@pytest.mark.parametrize("name", ANATOMIES)
@given(genome=arrays(float, GENES * VALUES, elements=st.floats(0, 1, exclude_max=True)))
def test_any_genome_decodes_to_a_hypothesis_with_notation_and_a_genome(
    name: str, kinds: tuple[FaultKind, ...], genome: np.ndarray
):
    hypothesis = decode(genome, ANATOMIES[name], kinds)

    assert len(hypothesis) <= GENES
    assert parse(str(hypothesis), ANATOMIES[name]) == hypothesis
    again = encode(hypothesis, GENES, ANATOMIES[name], kinds)
    assert decode(again, ANATOMIES[name], kinds) == hypothesis
    assert canonical(hypothesis.faults, ANATOMIES[name]) == hypothesis


def test_the_paper_s_genome_says_nothing_by_its_fourth_value():
    rng = np.random.default_rng(0)
    for genome in rng.random((200, GENES * VALUES)):
        other = genome.copy()
        other[3::VALUES] = rng.random(GENES)
        assert decode(genome, ANATOMIES["quadruped"]) == decode(other, ANATOMIES["quadruped"])


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
    anatomy = ANATOMIES["quadruped"]
    genome = encode(parse(said, anatomy), GENES, anatomy, ALL_KINDS)

    assert str(decode(genome, anatomy, ALL_KINDS)) == nearest


def test_dormant_genes_say_nothing():
    genome = np.full(GENES * VALUES, 0.9)
    genome[::VALUES] = 0.49

    assert decode(genome, ANATOMIES["quadruped"]) == INTACT


@pytest.mark.parametrize(("active", "faults"), [(0.0, 0), (0.499, 0), (0.5, 1), (0.999, 1)])
def test_a_gene_is_active_from_one_half_on(active: float, faults: int):
    assert len(decode(np.array([active, 0.0, 0.0, 0.0]), ANATOMIES["quadruped"])) == faults


@pytest.mark.parametrize("name", ANATOMIES)
def test_every_part_of_every_kind_can_be_reached(name: str):
    anatomy = ANATOMIES[name]
    expected = {f"{kind.keyword}:{part}" for kind in PAPER_KINDS for part in kind.parts(anatomy)}
    kind_and_part = (np.arange(200) + 0.5) / 200
    reached = {
        str(decode(np.array([1.0, kind, part, 0.0]), anatomy))
        for kind in kind_and_part[::20]
        for part in kind_and_part
    }

    assert reached == expected


@pytest.mark.parametrize("text", ["neuron:0", "jam:front_left_knee=0.3", "friction=0.4"])
def test_what_no_genome_can_express_is_refused(text: str):
    with pytest.raises(InputError, match="no diagnostic genome can express"):
        encode(parse(text, ANATOMIES["quadruped"]), GENES, ANATOMIES["quadruped"])


def test_more_faults_than_genes_are_refused():
    both = parse("break:front_left_knee+jam:back_left_knee", ANATOMIES["quadruped"])

    with pytest.raises(InputError, match="1 genes has no room for the 2 faults"):
        encode(both, 1, ANATOMIES["quadruped"])
