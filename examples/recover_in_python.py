"""One recovery through the Python API: your robots, your comparator, your folder.

Usage: python examples/recover_in_python.py RUN_FOLDER
"""

import sys

import selfmodel


def main(folder: str) -> None:
    """Recovers a quadruped that lost a leg, with a small budget."""
    robot = selfmodel.load_robot("quadruped")
    truth = selfmodel.parse_hypothesis("break:back_left_shoulder", robot)
    recovery = selfmodel.recover(
        healthy=selfmodel.simulated_robot(robot),  # or any PhysicalRobot
        damaged=selfmodel.simulated_robot(robot, truth),
        robot=robot,
        folder=folder,
        comparator="forward-displacement",  # or your own object
        settings=selfmodel.Settings(steps=80, trials=1, generations=2).scaled(8),
        calibrate=False,
        on_event=print,
    )
    print(f"best explanation: {recovery.diagnosis.best} (the truth: {truth})")
    print(f"{recovery.before:.2f} m, {recovery.after:.2f} m, {recovery.recovered:.2f} m")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
