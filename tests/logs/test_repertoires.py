"""Repertoire files: what is written is read, and nothing else is."""

import io
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.logs.repertoires import (
    load_repertoire,
    parse_repertoire,
    repertoire_bytes,
    save_repertoire,
)
from selfmodel.recovery.repertoire import Repertoire
from selfmodel.robot.robot import Robot
from tests.helpers.damage import damaged
from tests.helpers.drivers import random_repertoire
from tests.logs.edits import altered


@pytest.fixture(scope="module")
def repertoire(quadruped: Robot) -> Repertoire:
    return random_repertoire(quadruped)


def test_a_repertoire_is_read_as_it_was_written(
    repertoire: Repertoire, quadruped: Robot, tmp_path: Path
):
    save_repertoire(tmp_path / "gaits.npz", repertoire)
    found = load_repertoire(tmp_path / "gaits.npz", quadruped)

    assert (found.design, found.origin) == (repertoire.design, repertoire.origin)
    for name in ("genomes", "scores", "descriptors"):
        assert np.array_equal(getattr(found, name), getattr(repertoire, name)), name
    assert repertoire_bytes(found) == (tmp_path / "gaits.npz").read_bytes()


def test_a_repertoire_of_another_model_is_refused(
    repertoire: Repertoire, tmp_path: Path, robot: Robot
):
    save_repertoire(tmp_path / "gaits.npz", repertoire)
    if robot.name == "quadruped":
        return
    with pytest.raises(InputError, match=r"expected a repertoire of hexapod .* got one of quadr"):
        load_repertoire(tmp_path / "gaits.npz", robot)


@pytest.mark.parametrize("name", ["genomes", "scores", "descriptors", "origin", "controller"])
def test_an_altered_array_is_noticed(repertoire: Repertoire, name: str):
    data = repertoire_bytes(repertoire)
    array = np.load(io.BytesIO(data))[name]
    array.flat[0] += 1

    with pytest.raises(InputError, match="its digest is wrong, so it was altered or damaged; mak"):
        parse_repertoire(altered(data, **{name: array}), "here")


@given(data=st.data())
def test_damaged_bytes_are_an_error_with_the_remedy_or_change_nothing(
    repertoire: Repertoire, data: st.DataObject
):
    whole = repertoire_bytes(repertoire)
    try:
        found = parse_repertoire(data.draw(damaged(whole)), "here")
    except InputError as error:
        sentence = str(error)
    else:
        sentence = "here: expected a repertoire; make it anew with `selfmodel repertoire make`"
        assert repertoire_bytes(found) == whole
    assert sentence.startswith("here: expected a repertoire")
    assert "repertoire make`" in sentence
