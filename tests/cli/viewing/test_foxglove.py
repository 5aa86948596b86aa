"""Tests of the way to Foxglove: the layout is there."""

from selfmodel.cli.viewing.foxglove import foxglove_lines, layout_path


def test_the_lines_name_the_log_and_a_layout_that_exists():
    text = " ".join(foxglove_lines("a.mcap"))

    assert layout_path().is_file()
    assert str(layout_path()) in text
    assert "open the local file a.mcap" in text
