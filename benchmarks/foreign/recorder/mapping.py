"""The mapping of a recording to the signals of a robot, as ``selfmodel logs import`` reads it."""

from benchmarks.foreign.recorder.bag import recorded
from benchmarks.foreign.recorder.encoders import Encoders
from benchmarks.foreign.robots import Robot


def mapping(robot: Robot, encoders: Encoders, duration: float, *, healthy: bool) -> str:
    """Returns the text of a mapping.

    Args:
        robot: The robot.
        encoders: How the encoders are recorded.
        duration: Duration of the trial, s.
        healthy: Whether the trial is from before the failure.
    """
    stage = 'stage = "before"\n' if healthy else ""
    file = f"control_timestep = {robot.control_timestep}\n" if robot.mapped_as != robot.name else ""
    touches = "".join(
        f'\n[touch.{name}]\ntopic = "/foot/{name}"\nunit = "N"\n' for name in robot.touches
    )
    hinges = "\n".join(f"{hinge} = {_encoder(hinge, encoders)}" for hinge in robot.hinges)
    motors = "\n".join(f'{motor} = "{recorded(motor)}"' for motor in robot.motors)
    return (
        f'robot = "{robot.mapped_as}"\n{file}{stage}duration = {duration}\n\n'
        f'[joints]\ntopic = "/joint_states"\nunit = "rad"\n[joints.names]\n{hinges}\n\n'
        f'[commands]\ntopic = "/joint_commands"\nunit = "rad"\n[commands.names]\n{motors}\n\n'
        f'[base]\ntopic = "/odom"\nframe = "start"\nunit = "m"\n{touches}'
    )


def _encoder(hinge: str, encoders: Encoders) -> str:
    if encoders.broken.get(hinge) == "none":
        return '"none"'
    return f'{{ name = "{recorded(hinge)}", sign = {encoders.signs[hinge]} }}'
