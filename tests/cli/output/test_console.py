"""A console has a width, whatever the terminal reports."""

import pytest

from selfmodel.cli.output.console import WIDTH, text_console


@pytest.mark.parametrize(("columns", "width"), [("0", WIDTH), ("1", WIDTH), ("40", 40)])
def test_a_terminal_without_a_width_has_a_usual_one(
    monkeypatch: pytest.MonkeyPatch, columns: str, width: int
):
    monkeypatch.setenv("COLUMNS", columns)

    assert text_console().width == width
