"""The command `certify`."""

from __future__ import annotations

from anglecam.cli.json_output import report_file
from anglecam.cli.options import HoldOut, Out, SessionFolder
from anglecam.cli.progress import leave, stages
from anglecam.cli.sessions import close_and_report
from anglecam.terminal import screen


def certify(
    session: SessionFolder,
    out: Out,
    hold_out: HoldOut = None,
) -> None:
    """Certify a servo: all that `close` writes, and a page with 95 % intervals of its backlash, friction and limits."""
    measured, verdict = close_and_report(session, out, hold_out or ())
    with stages(lines=True) as progress:
        from anglecam.certificate.statement import doubt
        from anglecam.report.certificate_page import certificate_table
        from anglecam.workflow.certified import FILE, PAGE, write_certificate

        certificate = write_certificate(measured, verdict, out, progress=progress)
    report_file("certificate", out / FILE)
    if (why := doubt(certificate)) is not None:
        screen.print(why, soft_wrap=True, highlight=False)
    if certificate.is_certified:
        screen.print(certificate_table(certificate))
    screen.print(f"certificate: {out / PAGE}", soft_wrap=True)
    leave(measured.problems)
