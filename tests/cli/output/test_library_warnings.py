"""Warnings of libraries: counted, a sentence each, at the end of a command."""

import warnings

import numpy as np
import pytest

from selfmodel.cli.output.library_warnings import counted_warnings


def overflow() -> None:
    with np.errstate(over="warn"):
        np.square(np.array([1e308]))


def fail() -> None:
    with counted_warnings():
        overflow()
        raise SystemExit(2)


def test_each_warning_is_one_sentence_with_its_number(capsys: pytest.CaptureFixture[str]):
    with counted_warnings():
        for _ in range(37):
            overflow()
        warnings.warn("a file is\nold \x1b[2J", RuntimeWarning, stacklevel=1)
        assert capsys.readouterr() == ("", "")
    out, err = capsys.readouterr()

    assert out == ""
    assert "note: Python warned 37 times: RuntimeWarning: overflow encountered in square\n" in err
    assert "note: Python warned 1 time: RuntimeWarning: a file is old \\x1b[2J\n" in err
    assert ".py" not in err


def test_they_are_printed_before_an_error_leaves(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        fail()
    assert "note: Python warned 1 time: " in capsys.readouterr().err
    with pytest.raises(RuntimeWarning):  # warnings are as before
        overflow()
