"""Promises of the files of a figure: PNG, PDF and SVG, the same bytes in every call."""

import matplotlib as mpl
from matplotlib.figure import Figure

from selfmodel.experiments.study.drawing import (
    COLOURS,
    MARKERS,
    counts_text,
    figure_style,
    files_of,
    look,
)


def test_a_figure_is_a_png_a_pdf_and_an_svg_with_the_same_bytes_in_every_call():
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])

    found = files_of("figure-5", figure)

    assert list(found) == ["figure-5.png", "figure-5.pdf", "figure-5.svg"]
    assert found["figure-5.png"].startswith(b"\x89PNG")
    assert found["figure-5.pdf"].startswith(b"%PDF")
    assert found == files_of("figure-5", figure)


def test_no_pair_of_colour_and_marker_recurs_soon():
    looks = [tuple(look(number).values()) for number in range(len(COLOURS) * len(MARKERS))]

    assert len(set(looks)) == len(looks)


def test_numbers_of_runs_are_one_or_a_range():
    assert counts_text([4, 4]) == "n = 4"
    assert counts_text([12, 4, 8]) == "n = 4 to 12"
    assert counts_text([]) == "n = 0"


def test_the_style_file_has_the_colours_of_the_methods():
    with figure_style():
        cycle = mpl.rcParams["axes.prop_cycle"].by_key()["color"]
        assert tuple(f"#{colour.lstrip('#')}" for colour in cycle) == COLOURS
    assert mpl.rcParams["axes.prop_cycle"].by_key()["color"] != cycle
