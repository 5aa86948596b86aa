"""Promises of an ablation's figures: drawn for what there is, and alike in every panel."""

import dataclasses
import itertools

from selfmodel.experiments.ablation.figures import by_case, by_gap, draw
from selfmodel.experiments.ablation.scores import summarise
from tests.experiments.ablation.test_ablate import scored


def test_a_figure_is_drawn_for_any_subset_of_a_grid():
    rows = [
        dataclasses.replace(scored(name, case, 1.0, correct=True), gap=gap, robot=robot)
        for name, case, gap, robot in itertools.product(
            ("a", "b"), (1, 3), (0.0, 0.05, 0.1), ("quadruped", "hexapod")
        )
        if (name, robot) != ("b", "hexapod")
    ]

    names = [name for name, _ in draw(rows, summarise(rows))]
    assert [name for name in names if name.endswith(".png")] == [
        *("gap.png", "cases-hexapod-1.png", "cases-quadruped-1.png"),
    ]
    assert {name.partition(".")[2] for name in names} == {"png", "pdf", "svg"}
    assert list(draw([], [])) == []


def test_a_comparator_has_its_colour_and_its_marker_in_every_panel():
    found = scored("b", 1, 1.0, correct=True)
    rows = [
        dataclasses.replace(found, comparator="a"),
        found,
        dataclasses.replace(found, robot="x"),
    ]
    panels = [axes.get_legend_handles_labels() for axes in by_gap(summarise(rows)).axes]
    looks = [
        {
            name: (line[0].get_color(), line[0].get_marker())
            for line, name in zip(*panel, strict=True)
        }
        for panel in panels
    ]

    assert [set(look) for look in looks] == [{"a", "b"}, {"b"}]
    assert looks[0]["b"] == looks[1]["b"] != looks[0]["a"]


def test_figures_have_the_number_of_diagnoses_of_each_comparator():
    rows = [
        dataclasses.replace(scored(name, case, 1.0, correct=True), seed=seed)
        for name, seeds in (("a", 3), ("b", 1))
        for seed in range(seeds)
        for case in (1, 3)
    ]
    legend = [text.get_text() for text in by_gap(summarise(rows)).legends[0].get_texts()]
    squares = [text.get_text() for text in by_case("quadruped", 1, rows).axes[0].get_yticklabels()]

    assert legend == ["a (n = 6)", "b (n = 2)"]
    assert squares == ["a (n = 3)", "b (n = 1)"]
