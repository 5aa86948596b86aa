"""Promises of figures: drawn for what there is, with numbers of runs, and alike in every panel."""

import itertools

import numpy as np
from matplotlib.axes import Axes

from selfmodel.studies import figures
from selfmodel.studies.comparisons import compare
from selfmodel.studies.paper import NOT_RESTORED, best_so_far
from selfmodel.studies.rows import outcomes_of
from selfmodel.studies.tables import ablation_scores
from selfmodel.tasks import ROBOTS
from tests.helpers.study_rows import diagnosis, trials

ROWS = [
    diagnosis(
        name, robot=robot, gap=gap, case=case, truth=str(case), seed=seed, correct=name == "a"
    )
    for name, robot, gap, case, seed in itertools.product(
        "ab", ("quadruped", "hexapod"), (0.0, 0.1), (1, 2, 3), range(4)
    )
    if (name, robot) != ("b", "hexapod") and (name == "a" or seed == 0)
]


def legend(axes: Axes) -> dict[str, tuple[str, str]]:
    """Colour and marker of the error bars of a panel by the place of their line."""
    return {
        str(n): (bar[0].get_color(), bar[0].get_marker()) for n, bar in enumerate(axes.containers)
    }


def test_the_figures_of_an_ablation_have_the_numbers_of_diagnoses_and_one_look_a_comparator():
    files = figures.of_ablation(ROWS, ablation_scores(ROWS))
    gap = figures.by_gap(ablation_scores(ROWS))
    cases = figures.by_case("quadruped", 1, [r for r in ROWS if r["robot"] == "quadruped"])
    hexapod, quadruped = (legend(axes) for axes in gap.axes)

    names = {"gap", "cases-hexapod-1", "cases-quadruped-1"}
    assert set(files) == {f"{name}.{end}" for name in names for end in ("png", "pdf", "svg")}
    assert files["gap.png"].startswith(b"\x89PNG")
    assert figures.of_ablation([], []) == {}
    assert [text.get_text() for text in gap.legends[0].get_texts()] == [
        *("a (n = 12)", "b (n = 3)"),
    ]
    assert [text.get_text() for text in cases.axes[0].get_yticklabels()] == [
        *("a (n = 4)", "b (n = 1)"),
    ]
    assert hexapod["0"] == quadruped["0"] != quadruped["1"]


def test_a_pair_of_methods_has_its_difference_its_runs_and_a_filled_marker_if_it_is_better():
    rows = [
        diagnosis(name, seed=seed, correct=name == "a") for name in "a$^{" for seed in range(12)
    ]
    found = compare(outcomes_of("ablate", rows))
    (axes,) = figures.paired_differences(found).axes
    labels = [label.get_text() for label in axes.get_yticklabels()]
    markers = [line for line in axes.get_lines() if line.get_marker() == "o"]
    filled = [marker.get_markerfacecolor() != "white" for marker in markers]

    assert all("n = 12" in label for label in labels)
    assert sum(filled) == found["better"].notna().sum() == 3
    ends = {tuple(map(float, line.get_xdata())) for line in axes.get_lines()}
    assert set(zip(found["difference_low"], found["difference_high"], strict=True)) <= ends
    assert all(data for data in figures.of_comparisons(found).values())  # "$^{" is no formula


def test_figure_five_has_medians_of_its_runs_and_greys_what_the_paper_did_not_restore():
    rows = [
        row
        for seed, last in enumerate((1.0, 2.0, 6.0))
        for case in (4, 7, 9)
        for row in trials([2.0, 0.5, 1.0, last], seed=seed, robot="hexapod", case=case)
    ]
    rows += trials([0.0, 0.5, 1.0, 1.0], robot="hexapod", case=1)  # did not walk forward
    (axes,) = figures.by_trial(rows, NOT_RESTORED, best_so_far).axes
    drawn = [np.asarray(line.get_ydata()) for line in axes.get_lines()]

    assert sum(np.array_equal(line, [0.25, 0.5, 1.0]) for line in drawn) == 3
    assert all(np.isfinite(line).all() for line in drawn)
    assert len(axes.patches) == 2
    assert axes.get_title() == "hexapod (n = 1 to 3 per line)"


def test_figure_one_has_every_joint_and_sensor_of_a_robot():
    robot = ROBOTS["quadruped"].robot()
    drawn = [
        {line.get_label(): len(line.get_xdata()) for line in axes.get_lines()}
        for axes in figures.robots([robot]).axes
    ]
    kinds = [sensor.kind for sensor in robot.anatomy.sensors]

    assert drawn == 2 * [
        {
            "joint": len(robot.anatomy.joints),
            "angle sensor": kinds.count("angle"),
            "touch sensor": kinds.count("touch"),
        }
    ]
