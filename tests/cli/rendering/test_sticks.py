"""The ground of a picture: a bounded number of lines, whatever the size and place of the robot."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from selfmodel.cli.rendering.sticks import GRID, MAX_LINES, draw_ground

PLANE = np.array([[1.0, 0.0], [0.0, 0.5], [0.0, 0.5]])
UP = np.array([0.0, 0.0, 1.0])


def lines(reach: float, centre: float = 0.0) -> int:
    """The number of lines that are drawn."""
    axes = Figure().subplots()
    draw_ground(axes, UP, np.array([centre, 0.0, 0.0]), PLANE, reach)
    return len(axes.collections[0].get_segments())


@pytest.mark.parametrize("reach", [1e2, 1e10])
@pytest.mark.parametrize("centre", [0.0, 1e8])
def test_a_huge_robot_has_a_wider_grid(reach: float, centre: float):
    assert 100 < lines(reach, centre) <= 2 * (MAX_LINES + 3)


def test_a_robot_of_one_metre_has_a_line_every_half_metre():
    assert lines(1.0) == 2 * (6 / GRID + 1)
