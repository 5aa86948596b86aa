"""The error for an unknown name helps, however many names are known and however long they are."""

from selfmodel.errors import unknown_name


def test_the_nearest_names_come_first_and_all_are_listed():
    error = unknown_name("robot", "hexapot", ["quadruped", "hexapod"])

    assert str(error) == (
        "unknown robot 'hexapot': did you mean hexapod? the known ones are quadruped, hexapod"
    )


def test_of_too_many_names_some_are_listed():
    error = str(unknown_name("topic", "/odom", [f"/t{k}" for k in range(100_000)]))

    assert error.endswith("/t199 and 99800 more")
    assert len(error) < 2000


def test_names_that_are_too_long_are_not_compared():
    long = "ab" * 10**6

    assert "did you mean" not in str(unknown_name("topic", long, [long + "c"]))
    assert "did you mean b?" in str(unknown_name("topic", "b", [long, "b"]))
