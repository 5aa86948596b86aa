import pytest
from hypothesis import given, strategies as st

from selfmodel.errors import InputError
from selfmodel.sandbox.budget import DEFAULT_BUDGET, Budget


@pytest.mark.parametrize(
    ("text", "memory", "time"),
    [
        ("memory=4GB,time=30min", 4 * 10**9, 1800),
        ("memory=4GB", 4 * 10**9, DEFAULT_BUDGET.time),
        ("time=1.5h", DEFAULT_BUDGET.memory, 5400),
        (" time=90 , memory=500 MB ", 5 * 10**8, 90),
    ],
)
def test_a_text_is_a_budget(text: str, memory: int, time: float):
    assert Budget.parse(text) == Budget(memory, time)


@given(
    st.integers(min_value=10**6, max_value=10**11),
    st.integers(min_value=1, max_value=10**6),
)
def test_a_budget_is_the_same_after_a_round_trip(memory: int, time: int):
    budget = Budget(memory, time)

    assert Budget.parse(str(budget)) == budget


@pytest.mark.parametrize(
    "text",
    [
        *("", "4GB", "memory=", "memory=-1GB", "memory=nan", "memory=1e400", "memory=4TB"),
        *("memory=0", "time=3GB", "memory=1GB,memory=2GB", "memory=" + "9" * 5000, "speed=1"),
        *("memory=999999999999GB", "time=999999999999h"),
    ],
)
def test_another_text_is_refused(text: str):
    with pytest.raises(InputError, match="budget"):
        Budget.parse(text)


def test_every_limit_grows_with_the_budget():
    small, large = Budget(), Budget(2 * 10**9, 360)
    limits = [name for name, value in vars(Budget).items() if isinstance(value, property)]

    assert limits
    for name in limits:
        assert getattr(large, name) == pytest.approx(2 * getattr(small, name), abs=1)
