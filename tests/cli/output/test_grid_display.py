"""Promises of the display of a study."""

from pathlib import Path

import pytest

from selfmodel.cli.output.grid_display import note_unverified


def test_a_table_with_parts_without_digests_has_a_note(capsys: pytest.CaptureFixture[str]):
    note_unverified(0, Path("out"))
    assert capsys.readouterr().err == ""
    note_unverified(2, Path("out"))

    assert capsys.readouterr().err == (
        "note: version 0.1 wrote 2 parts in out, without digests: their content was not verified\n"
    )
