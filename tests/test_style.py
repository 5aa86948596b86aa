"""Promises of the style of figures: a user's file rules them, or is refused in a sentence."""

from pathlib import Path

import matplotlib as mpl
import pytest

from selfmodel.errors import InputError
from selfmodel.style import figure_style, values_by_name


def test_the_size_of_the_font_rules_every_size_that_a_style_leaves_open(tmp_path: Path):
    style = tmp_path / "own.mplstyle"
    style.write_text("font.size: 5\naxes.titlesize: 9\n", encoding="utf-8")
    with figure_style(style):
        sizes = {name: mpl.rcParams[name] for name in mpl.rcParams if name.endswith("size")}
        (axes,) = values_by_name("title", "metres", ["one"], [1.0]).axes
    assert sizes["axes.titlesize"] == axes.title.get_size() == 9
    assert sizes["figure.labelsize"] == axes.xaxis.label.get_size() == 5
    assert sizes["legend.fontsize"] == 4.5


def test_a_style_rules_the_width_of_the_figure_of_a_result(tmp_path: Path):
    style = tmp_path / "own.mplstyle"
    style.write_text("figure.figsize: 2.5, 9\n", encoding="utf-8")
    with figure_style(style):
        drawn = values_by_name("title", "metres", ["a long name of a method"], [1.0])

    assert drawn.get_figwidth() == 2.5
    assert values_by_name("title", "metres", ["a long name"], [1.0]).get_figwidth() > 2.5


@pytest.mark.parametrize(
    "wrong", ["figure.figsize: 100000, 3", "savefig.dpi: 10000000", "font.colour: red", ""]
)
def test_a_style_in_which_nothing_can_be_drawn_is_refused_with_its_path(tmp_path: Path, wrong: str):
    style = tmp_path / "own.mplstyle"
    style.write_text(wrong, encoding="utf-8")
    with pytest.raises(InputError, match=r"own\.mplstyle"), figure_style(style):
        pass
