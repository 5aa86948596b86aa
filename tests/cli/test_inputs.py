"""Option values: lists with commas, shares of a study."""

from pathlib import Path

import pytest
from hypothesis import given, strategies as st
from typer.testing import CliRunner

from selfmodel.cli import app, inputs
from selfmodel.errors import InputError
from tests.helpers.command import selfmodel


@pytest.mark.parametrize(
    ("option", "value", "sentence"),
    [
        ("--robots", "quadrupde", "unknown robot 'quadrupde': did you mean quadruped?"),
        ("--robots", "quadruped,,hexapod", "--robots needs a list with commas"),
        ("--case", "1,11", "unknown case of quadruped '11'"),
        ("--case", "1,two", "--case needs whole numbers"),
        ("--comparator", "forward-displacment", "did you mean forward-displacement?"),
        ("--gap", "0,big", "--gap needs numbers with commas between them"),
        ("--gap", "-0.1", "expected a gap from 0 to 0.5, such as 0.05, got -0.1"),
        ("--gap", "nan", "expected a gap from 0 to 0.5"),
        ("--gaps", "5", "expected a gap from 0 to 0.5"),
        ("--trials", "7", "the same gait gives the same trial, and the bank has 6"),
        ("--next-trial", "repairs", "did you mean repair?"),
        ("--only", "3/2", "--only needs i/n"),
        ("--only", "0/2", "--only needs i/n"),
        ("--executor", "slrum", "unknown executor 'slrum'"),
        ("--only", "1/" + "9" * 5000, "--only needs i/n"),
        ("--damage", "break:nose", "unknown part in the term 'break:nose'"),
        ("--damages", "brek:front_left_knee", "did you mean break?"),
        (
            "--kinds",
            "selfmodel.faults.sensors:SILENT_NEURON",
            "no diagnosis may propose neuron: leave neuron out",
        ),
        (
            "--kinds",
            "break,frction",
            "unknown kind 'frction': did you mean friction, joint-friction?",
        ),
        (
            "--case",
            " none ",
            "expected at least one case or one damage of an ablation, got neither",
        ),
    ],
)
def test_a_bad_list_is_refused_in_a_sentence_before_anything_is_run(
    tmp_path: Path, option: str, value: str, sentence: str
):
    out = tmp_path / "out"
    arguments = ["ablate", "--robots", "quadruped", option, value, "--out", str(out)]
    told = CliRunner().invoke(app, arguments)

    assert isinstance(told.exception, InputError)
    assert sentence in str(told.exception)
    assert not out.exists()


@given(st.lists(st.text("abc:._", min_size=1), min_size=1))
def test_a_list_is_what_stands_between_the_commas_each_once(items: list[str]):
    assert inputs.texts("--any", " , ".join(items)) == tuple(dict.fromkeys(items))


def test_a_number_is_one_number_however_it_is_written():
    assert inputs.whole_numbers("--any", "2,02,1,+2", ()) == (2, 1)


def test_an_error_repeats_no_name_of_any_length(tmp_path: Path):
    (tmp_path / "long.xml").write_text(f'<mujoco><include file="{"n" * 100_000}"/></mujoco>')
    done = selfmodel("trial", "long.xml", "--out", "a.mcap", cwd=tmp_path)

    assert done.returncode == 2
    assert 20_000 < len(done.stderr) < 30_000
