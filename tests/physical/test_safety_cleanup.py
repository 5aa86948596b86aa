"""What is done at the end of a block is done, and what ended the block is what is told."""

from contextlib import AbstractContextManager

import pytest

from selfmodel.errors import WorkError, describe
from selfmodel.physical.safety import cleanup

FAILURES = (OSError("the port is gone"), WorkError("the robot does not answer"))
REASONS = (KeyboardInterrupt("Ctrl-C"), ZeroDivisionError("a bug"))


def failing(failure: Exception) -> AbstractContextManager[None]:
    def end() -> None:
        raise failure

    return cleanup(end)


@pytest.mark.parametrize("failure", FAILURES, ids=repr)
@pytest.mark.parametrize("reason", REASONS, ids=repr)
def test_what_ended_a_block_goes_on_and_a_failing_end_is_a_note_to_it(
    reason: BaseException, failure: Exception
):
    with pytest.raises(type(reason)) as raised, failing(failure):
        raise type(reason)(*reason.args)
    assert describe(raised.value) == f"{reason}; {failure}"


@pytest.mark.parametrize("failure", FAILURES, ids=repr)
def test_where_nothing_went_wrong_a_failing_end_is_the_error(failure: Exception):
    with pytest.raises(type(failure)) as raised, failing(failure):
        pass
    assert raised.value is failure


def test_a_bug_at_the_end_is_not_hidden_in_a_note():
    bug = AttributeError("no such method")
    with pytest.raises(AttributeError, match="no such method"), failing(bug):
        raise KeyboardInterrupt


def test_the_end_comes_once_and_after_the_block():
    done: list[str] = []
    with cleanup(lambda: done.append("end")):
        done.append("block")
    assert done == ["block", "end"]
