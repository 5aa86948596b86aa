"""``selfmodel report``: a run, logs or a campaign as one HTML file."""

from collections.abc import Sequence
from pathlib import Path

from selfmodel import plugins
from selfmodel.arguments import comparator_choice
from selfmodel.cli.commands import MakeReport
from selfmodel.cli.diagnose import diagnose_logs
from selfmodel.cli.inputs import check_folder
from selfmodel.cli.output.printing import print_json, print_lines
from selfmodel.errors import InputError, WorkError
from selfmodel.faults.kind import FaultKind
from selfmodel.logs.files import refuse_existing, write_new
from selfmodel.report.campaign import is_campaign, report_of_campaign
from selfmodel.report.charts import REPORT, Report, html_of
from selfmodel.report.content import report_of
from selfmodel.report.subject import Subject, is_run, subject_of_logs, subject_of_run
from selfmodel.simulation.simulator import thread_count
from selfmodel.trials.trial import trial_names


def report(options: MakeReport) -> None:
    """Write a report of a run, of logs or of a campaign: one HTML file, which needs no network."""
    out = options.out
    folder = options.sources[0] if options.sources[0].is_dir() else None
    if folder is not None and len(options.sources) > 1:
        raise InputError(
            f"expected one folder, or logs, got {', '.join(map(str, options.sources))}"
        )
    if folder is not None and options.diagnosis is not None:
        raise InputError(
            f"--diagnosis is for logs, and {folder} is a folder, which has its diagnosis: leave "
            f"--diagnosis out, or give the logs"
        )
    out = (folder / REPORT if folder else Path(REPORT)) if out is None else out
    if out.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out needs a name that ends in .html, got {str(out)!r}")
    check_folder(out)
    refuse_existing(out)
    searched = plugins.kinds(options.kinds)
    if folder is not None:
        made = _of_folder(folder, options.threads, options.comparator, searched)
    elif options.diagnosis is not None:
        subject = subject_of_logs(
            options.sources,
            options.diagnosis,
            robot=options.self_model,
            threads=options.threads,
            comparator=options.comparator,
            kinds=searched,
        )
        made = report_of(subject)
    else:
        found = diagnose_logs(
            options.sources,
            robot=options.self_model,
            choose_comparator=comparator_choice(options.comparator),
            kinds=searched,
            calibrate=options.calibrate,
            population=options.population,
            generations=options.generations,
            seed=options.seed,
            threads=options.threads,
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
                threads=thread_count(options.threads),
            )
        )
    data = html_of(made)
    kept = write_new(out, data)
    if kept != out:
        raise WorkError(
            f"{out} was created meanwhile, and is not overwritten; the finished report is {kept}"
        )
    _print(made, out, len(data), as_json=options.as_json)


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
