"""Tests of the dm_control environments in Shimmy, the wrapper of others for Gymnasium."""

import warnings
from types import ModuleType

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from selfmodel import tasks

WRAPPED = [
    ("quadruped", "walk", {"hypothesis": "break:front_left_knee", "gap": 0.05}),
    ("suite-walker", "walk", {"hypothesis": "break:left_ankle", "start_noise": 0.05}),
]


@pytest.fixture
def shimmy() -> ModuleType:
    """The package; it needs imageio, and warns about environments that it cannot register."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pytest.importorskip(
            "shimmy",
            reason="Shimmy is not installed: pip install --group dev",
            exc_type=ImportError,
        )


@pytest.mark.bodies
@pytest.mark.parametrize(("domain", "task", "kwargs"), WRAPPED)
def test_gymnasiums_checks_pass_through_shimmy_whose_seed_is_that_of_the_episodes(
    shimmy: ModuleType, domain: str, task: str, kwargs: dict
):
    wrapped = shimmy.DmControlCompatibilityV0(tasks.load(domain, task, {**kwargs, "random": 0}))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(wrapped, skip_render_check=True)

    # Shimmy's spaces have no bounds where dm_control's specs have none.
    assert not [each for each in caught if "infinity" not in str(each.message)]
    firsts = [wrapped.reset(seed=seed)[0] for seed in (1, 1, 2)]
    for name, values in firsts[0].items():
        np.testing.assert_array_equal(values, firsts[1][name], name)
    assert any(not np.array_equal(values, firsts[2][name]) for name, values in firsts[0].items())
