"""Promises of the files of a figure: PNG and PDF, the same bytes in every call."""

from matplotlib.figure import Figure

from selfmodel.experiments.paper.drawing import COLOURS, MARKERS, files_of, look


def test_a_figure_is_a_png_and_a_pdf_with_the_same_bytes_in_every_call():
    figure = Figure()
    figure.subplots().plot([0, 1], [0, 1])

    found = files_of("figure-5", figure)

    assert list(found) == ["figure-5.png", "figure-5.pdf"]
    assert found["figure-5.png"].startswith(b"\x89PNG")
    assert found["figure-5.pdf"].startswith(b"%PDF")
    assert found == files_of("figure-5", figure)


def test_no_pair_of_colour_and_marker_recurs_soon():
    looks = [tuple(look(number).values()) for number in range(len(COLOURS) * len(MARKERS))]

    assert len(set(looks)) == len(looks)
