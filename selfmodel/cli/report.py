"""``selfmodel report``: a run, logs or a campaign as one HTML file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from selfmodel import plugins
from selfmodel.arguments import AUTO, comparator_choice
from selfmodel.cli.arguments.inputs import check_folder
from selfmodel.cli.arguments.options import (
    DEFAULT_KIND_NAMES,
    Calibrated,
    ComparatorName,
    Json,
    KindNames,
    LoggedGenerations,
    LoggedPopulation,
    LoggedSeed,
    SelfModel,
    Threads,
)
from selfmodel.cli.diagnose import diagnose_logs
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.errors import InputError, WorkError
from selfmodel.faults.kind import FaultKind
from selfmodel.logs.files import refuse_existing, write_new
from selfmodel.report.campaign import is_campaign, report_of_campaign
from selfmodel.report.charts import Report
from selfmodel.report.content import report_of
from selfmodel.report.page import REPORT, html_of
from selfmodel.report.subject import Subject, is_run, subject_of_logs, subject_of_run
from selfmodel.simulation.threads import thread_count
from selfmodel.trials.trial import trial_names


def report(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN|LOG...|CAMPAIGN",
            help="Folder of a recovery, trial logs, or folder of a campaign.",
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            *("--out", "-o"),
            metavar="FILE.html",
            help="File to write.",
            show_default="report.html, in the folder of the run or campaign",
        ),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.json",
            help="Report this diagnosis of the logs, which `selfmodel diagnose --json` printed, or "
            "the result.json of a recovery, instead of a new one.",
        ),
    ] = None,
    robot: SelfModel = None,
    comparator: ComparatorName = AUTO,
    kinds: KindNames = DEFAULT_KIND_NAMES,
    calibrate: Calibrated = True,
    population: LoggedPopulation = None,
    generations: LoggedGenerations = None,
    seed: LoggedSeed = None,
    threads: Threads = 0,
    as_json: Json = False,
) -> None:
    """Write a report of a run, of logs or of a campaign: one HTML file, which needs no network.

    A run is reported with the diagnosis in its folder, logs with that of --diagnosis. Without it,
    logs are diagnosed first, with the options of `selfmodel diagnose`. To a diagnosis that was made
    before, only --kinds and --comparator apply, which name its plug-ins, as no report imports what
    a file names, and to one of --diagnosis also --robot.
    """
    folder = sources[0] if sources[0].is_dir() else None
    if folder is not None and len(sources) > 1:
        raise InputError(f"expected one folder, or logs, got {', '.join(map(str, sources))}")
    if folder is not None and diagnosis is not None:
        raise InputError(
            f"--diagnosis is for logs, and {folder} is a folder, which has its diagnosis: leave "
            f"--diagnosis out, or give the logs"
        )
    out = (folder / REPORT if folder else Path(REPORT)) if out is None else out
    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out needs a name that ends in .html, got {str(out)!r}")
    check_folder(out)
    refuse_existing(out)
    searched = plugins.kinds(kinds)
    if folder is not None:
        made = _of_folder(folder, threads, comparator, searched)
    elif diagnosis is not None:
        subject = subject_of_logs(
            sources,
            diagnosis,
            robot=robot,
            threads=threads,
            comparator=comparator,
            kinds=searched,
        )
        made = report_of(subject)
    else:
        found = diagnose_logs(
            sources,
            robot=robot,
            choose_comparator=comparator_choice(comparator),
            kinds=searched,
            calibrate=calibrate,
            population=population,
            generations=generations,
            seed=seed,
            threads=threads,
        )
        made = report_of(
            Subject(
                name=", ".join(trial_names(found.inputs.damaged).values()),
                robot=found.robot,
                healthy=found.inputs.healthy,
                damaged=found.inputs.damaged,
                diagnoses=(found.diagnosis,),
                comparator=found.inputs.comparator.comparator,
                calibration=found.inputs.calibration,
                made_with=found.explained[0].software,
                threads=thread_count(threads),
            )
        )
    data = html_of(made)
    kept = write_new(out, data)
    if kept != out:
        raise WorkError(
            f"{out} was created meanwhile, and is not overwritten; the finished report is {kept}"
        )
    _print(made, out, len(data), as_json=as_json)


def _of_folder(folder: Path, threads: int, comparator: str, kinds: Sequence[FaultKind]) -> Report:
    if is_run(folder):
        return report_of(subject_of_run(folder, threads, comparator, kinds))
    if is_campaign(folder):
        return report_of_campaign(folder)
    raise InputError(
        f"{folder}: expected the folder of a run with its trials and diagnoses.json, or of a "
        f"campaign with a table such as results.csv, got neither"
    )


def _print(made: Report, out: Path, size: int, *, as_json: bool) -> None:
    if as_json:
        print_json({"out": str(out), "bytes": size, "headline": made.headline})
    else:
        print_lines(made.headline, f"{out}: {size / 1e6:.1f} MB; open it in a browser.")
