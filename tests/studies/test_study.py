"""Promises of a study: points times a function, rows of one table, one set of shared parameters."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from selfmodel.errors import InputError
from selfmodel.studies.study import Study, points_of, rows_in, shared_in
from tests.helpers.grids import cell


def work(parameters: dict, needs: dict[str, Path], _folder: Path) -> object:
    """A row, rows or tables, with what was read from other cells."""
    shared = parameters["shared"]
    row = {"product": parameters["factor"] * shared["size"], "needs": sorted(needs)}
    return {"row": row, "rows": [row, row], "tables": {"a": [row], "b": []}}[shared["form"]]


@pytest.fixture
def threads() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(1) as executor:
        yield executor


def study(folder: Path, points: dict, form: str = "row", **changes: object) -> Study:
    shared = {"size": 3, "form": form, "pair": (0.1, None)}
    return Study("mine", folder, f"{__name__}:work", points, {**shared, **changes})


def test_points_are_all_combinations_of_the_axes():
    points = points_of(factor=[1, 2], seed=range(2), way=["a:b"])

    assert list(points) == [
        f"factor={factor}-seed={seed}-way=a%3Ab" for factor in (1, 2) for seed in (0, 1)
    ]
    assert points["factor=2-seed=1-way=a%3Ab"] == {"factor": 2, "seed": 1, "way": "a:b"}


@pytest.mark.parametrize(
    ("form", "table", "count"),
    [("row", None, 1), ("rows", None, 2), ("tables", "a", 1), ("tables", "b", 0)],
)
def test_rows_have_the_axes_and_what_the_function_returned(
    form: str, table: str | None, count: int, tmp_path: Path, threads: ThreadPoolExecutor
):
    wanted = study(tmp_path, points_of(factor=[1, 2], seed=[7]), form)
    assert wanted.run(executor=threads) == ()

    assert (
        wanted.rows(table)
        == rows_in(tmp_path, table)
        == [
            {"factor": factor, "seed": 7, "product": 3 * factor, "needs": []}
            for factor in (1, 2)
            for _ in range(count)
        ]
    )
    assert (shared_in(tmp_path)["study"], shared_in(tmp_path / "none")) == ("mine", {})


def test_a_study_is_extended_by_points_and_refuses_other_settings_before_anything_is_run(
    tmp_path: Path, threads: ThreadPoolExecutor
):
    study(tmp_path, points_of(factor=[1])).run(executor=threads)
    events: list = []
    more = study(tmp_path, points_of(factor=[1, 2]))
    more.run(executor=threads, on_event=events.append)
    assert [event.name for event in events[1:]] == ["factor=2"]

    for changes, difference in (
        ({"size": 4}, "size is 3 there, requested is 4"),
        ({"more": None}, "more is absent there, requested is null"),
        ({"more": {}}, "more is absent there, requested is {}"),
        ({"form": {"of": ["row"]}}, 'form is "row" there, requested is absent'),
    ):
        with pytest.raises(InputError, match=difference):
            study(tmp_path, points_of(factor=[3]), **changes).run(executor=threads)
    assert len(more.rows()) == 2


@pytest.mark.parametrize("observed", [{}, {"on_event": lambda _: None}])
def test_failed_runs_are_a_warning_with_the_first_reason_with_and_without_an_observer(
    observed: dict, tmp_path: Path, threads: ThreadPoolExecutor
):
    wanted = study(tmp_path, points_of(factor=[1, 2]), form="none")
    told = r"^2 of 2 cells failed, the first of them factor=1: .*KeyError.* tries them again$"
    with pytest.warns(UserWarning, match=told) as warned:
        failed = wanted.run(executor=threads, **observed)

    assert [end.name for end in failed] == ["factor=1", "factor=2"]
    assert [Path(one.filename) for one in warned] == [Path(__file__)], "names the caller's line"
    assert wanted.run(executor=threads, warns=False, **observed), "the command line prints it"


def test_a_run_whose_needs_are_others_is_refused(tmp_path: Path, threads: ThreadPoolExecutor):
    def needing(number: int) -> Study:
        gait = cell(tmp_path, "gait", number, kind="gaits")
        given = {"shared": {"size": 3, "form": "row"}, "needs": lambda _: {"gait": gait}}
        points = points_of(factor=[1])
        return Study("mine", tmp_path / "s", f"{__name__}:work", points, **given)

    assert needing(0).run(executor=threads) == ()
    assert needing(0).rows()[0]["needs"] == ["gait"]
    with pytest.raises(InputError, match="factor=1, made with other inputs, such as another gait"):
        needing(1).run(executor=threads)
