"""The packages that the reference documents, in the order of the data flow."""

ROOMS = (
    "selfmodel",
    "selfmodel.controllers",
    "selfmodel.trials",
    "selfmodel.robot",
    "selfmodel.robot.mjcf",
    "selfmodel.faults",
    "selfmodel.physical",
    "selfmodel.simulation",
    "selfmodel.diagnosis",
    "selfmodel.recovery",
    "selfmodel.tasks",
    "selfmodel.comparators",
    "selfmodel.logs",
    "selfmodel.experiments",
)
