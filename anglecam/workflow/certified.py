"""Certify the servo of one session and write the certificate."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

from anglecam.certificate.certificate_json import COMMAND_ENDING, certificate_as_dict
from anglecam.certificate.certify import NO_LAMP, ONE_LOG, Certificate, Clock, certify
from anglecam.io.command_csv import COMMAND_ENDING as COMMAND_FILE
from anglecam.io.files import write_json
from anglecam.io.session import Session, recording_name
from anglecam.loop.next_experiment.design import write_command
from anglecam.loop.verdict import Verdict
from anglecam.progress import Progress, Stage, unseen
from anglecam.report.certificate_page import write_certificate_page
from anglecam.workflow.session import MeasuredSession

PAGE = "certificate.html"
FILE = "certificate.json"


def write_certificate(
    measured: MeasuredSession, verdict: Verdict, out: Path, *, progress: Progress = unseen
) -> Certificate:
    """Certify the servo of a session; write ``certificate.json``, ``certificate.html`` and commands to play.

    Parameters
    ----------
    measured : MeasuredSession
        From `anglecam.workflow.session.measure_session`.
    verdict : Verdict
        Of its recordings, from `anglecam.workflow.session.close_session`.
    out : Path
        Folder for the files.
    progress : callable
        Called with the name of each stage.

    Returns
    -------
    Certificate
        What the files hold.
    """
    session = measured.session
    certificate = certify(verdict, clock_of(measured), progress)
    progress(Stage("writing the certificate"))
    for one in certificate.quantities:
        path = out / f"{one.quantity.id}{COMMAND_ENDING}"
        path.unlink(missing_ok=True)
        if one.experiment is not None and one.experiment.command is not None:
            write_command(one.experiment.command, path)
    title = session.directory.resolve().name
    inputs = _sums(session)
    write_certificate_page(out / PAGE, title, certificate, inputs, [str(p) for p in measured.problems])
    files = [{"file": name, "sha256": value} for name, value in inputs]
    write_json(out / FILE, {"session": title, **certificate_as_dict(certificate), "files": files})
    return certificate


def clock_of(measured: MeasuredSession) -> Clock:
    """Return how the clocks of a session agree: by lamps in all clips that have a command, or in one log."""
    if measured.session.rig.source == "encoder":
        return ONE_LOG
    commands = {r.name: r.command for r in measured.session.recordings}
    between = []
    for series in measured.series:
        command, lit = commands[series.name], series.evidence.lamp_s
        change = None if command is None else command.first_change()
        if change is None:
            continue
        if lit is None:
            return NO_LAMP
        between.append((lit[0] - change, lit[1] - change))
    if not between:
        return NO_LAMP
    low, high = max(low for low, _ in between), min(high for _, high in between)
    if low > high:  # each clip has an offset of its own: the widest interval bounds the error of them all
        low, high = 0.0, max(high - low for low, high in between)
    return Clock(True, (high - low) / math.sqrt(12.0))


def _sums(session: Session) -> list[tuple[str, str]]:
    """Return the names and SHA-256 sums of a session's files: recordings, their commands, the rig file."""
    paths = [session.directory / "rig.yaml"]
    for recording in session.recordings:
        paths += [recording.source, recording.source.with_name(recording_name(recording.source) + COMMAND_FILE)]
    return [(path.name, _sum(path)) for path in paths if path.is_file()]


def _sum(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
