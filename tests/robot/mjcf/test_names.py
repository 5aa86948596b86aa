"""Parts without a name get one."""

from selfmodel.robot.mjcf.names import UniqueNames


def test_names_are_distinct_and_their_time_is_linear_in_their_number():
    names = UniqueNames(["hip", "hip_2", "hip_4", None])

    assert [names.new("hip") for _ in range(3)] == ["hip_3", "hip_5", "hip_6"]
    assert len({names.new("knee") for _ in range(50_000)}) == 50_000
