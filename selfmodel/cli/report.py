"""``selfmodel report``: a run, logs or a campaign as one HTML file."""

from collections.abc import Sequence
from pathlib import Path

from selfmodel import plugins
from selfmodel.cli.commands import MakeReport
from selfmodel.cli.diagnose import diagnose_logs
from selfmodel.cli.inputs import check_new_file
from selfmodel.cli.output import print_json, print_lines
from selfmodel.errors import InputError, WorkError
from selfmodel.faults.kind import FaultKind
from selfmodel.logs.files import write_new
from selfmodel.report import subject as subjects
from selfmodel.report.campaign import report_of_campaign
from selfmodel.report.charts import REPORT, Report, html_of
from selfmodel.report.content import report_of
from selfmodel.simulation.simulator import thread_count
from selfmodel.trials.trial import trial_names


def report(options: MakeReport) -> None:
    """Write a report of a run, of logs or of a campaign: one HTML file, which needs no network."""
    for path in options.sources:
        if not path.exists() or path.suffix in (".csv", ".json", ".jsonl", ".toml"):
            got = f"a file: give {path.parent}" if path.exists() else "no such file or folder"
            expected = "expected logs, NAME.mcap, or the folder of a run or of a study"
            raise InputError(f"{path}: {expected}, got {got}")
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
    out = options.out or (folder or Path()) / REPORT
    check_new_file(out, ".html", ".htm")
    kinds = plugins.kinds(options.kinds)
    found = _of_logs(options, kinds) if folder is None else _of_folder(folder, options, kinds)
    data = html_of(found)
    kept = write_new(out, data)
    if kept != out:
        raise WorkError(
            f"{out} was created meanwhile, and is not overwritten; the finished report is {kept}"
        )
    if options.as_json:
        print_json({"out": str(out), "bytes": len(data), "headline": found.headline})
    else:
        print_lines(found.headline, f"{out}: {len(data) / 1e6:.1f} MB; open it in a browser.")


def _of_folder(folder: Path, options: MakeReport, kinds: Sequence[FaultKind]) -> Report:
    if subjects.is_run(folder):
        comparator = options.comparator
        return report_of(subjects.subject_of_run(folder, options.threads, comparator, kinds))
    return report_of_campaign(folder)


def _of_logs(options: MakeReport, kinds: Sequence[FaultKind]) -> Report:
    if options.diagnosis is not None:
        given = subjects.subject_of_logs(
            options.sources,
            options.diagnosis,
            robot=options.self_model,
            threads=options.threads,
            comparator=options.comparator,
            kinds=kinds,
        )
        return report_of(given)
    explained, robot, inputs = diagnose_logs(options.sources, options)
    made = subjects.Subject(
        name=", ".join(trial_names(inputs.damaged).values()),
        robot=robot,
        healthy=inputs.healthy,
        damaged=inputs.damaged,
        diagnoses=(inputs.diagnosis,),
        comparator=inputs.comparator.comparator,
        calibration=inputs.calibration,
        made_with=explained[0].software,
        threads=thread_count(options.threads),
    )
    return report_of(made)
