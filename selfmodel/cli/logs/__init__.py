"""``selfmodel logs``: commands that work on log files."""

from selfmodel.cli.lazy import group

app = group(
    "logs",
    "Inspect and verify trial logs, salvage damaged ones, import recordings, export tables.",
    {
        "info": ("selfmodel.cli.logs.info:info", "Show what logs contain."),
        "verify": ("selfmodel.cli.logs.verify:verify", "Check every checksum, count and digest."),
        "salvage": ("selfmodel.cli.logs.salvage:salvage", "Save the good steps of a bad log."),
        "import": ("selfmodel.cli.logs.import_:import_", "Import a recording as a log."),
        "export": ("selfmodel.cli.logs.export:export", "Write a log's signals as a table."),
    },
)
