"""The command `certify`."""

from __future__ import annotations

from anglecam.cli.json_output import report_file
from anglecam.cli.options import HoldOut, Out, SessionFolder
from anglecam.cli.progress import end, progress_bars
from anglecam.cli.sessions import measure_recordings
from anglecam.io.session import read_session
from anglecam.terminal import screen


def certify(
    session: SessionFolder,
    out: Out,
    hold_out: HoldOut = None,
) -> None:
    """Certify a servo: backlash, friction, dead time, lag, speed and torque limit with 95 % intervals, as one page."""
    from anglecam.report.certificate_page import certificate_table
    from anglecam.workflow.certified import FILE, PAGE, write_certificate
    from anglecam.workflow.session import loop_input, require_recordings

    opened = read_session(session)
    require_recordings(opened, hold_out or ())
    measured = measure_recordings(opened, out)
    with progress_bars() as bars:
        bar = bars.add_task("", total=None)
        certificate = write_certificate(
            measured,
            loop_input(measured),
            out,
            hold_out=hold_out or (),
            progress=lambda stage: bars.update(bar, description=stage),
        )
        bars.update(bar, description="done", completed=1, total=1)
    report_file("certificate", out / FILE)
    screen.print(certificate_table(certificate))
    screen.print(f"certificate: {out / PAGE}", soft_wrap=True)
    end(measured.problems)
