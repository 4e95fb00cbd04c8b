"""The certificate's page can be read on a wide and on a narrow screen."""

from __future__ import annotations

import numpy as np
import pytest

from anglecam.certificate.certify import certify
from anglecam.certificate.quantity import QUANTITIES
from anglecam.loop.close import close_records
from anglecam.report.certificate_page import write_certificate_page
from support.browser import chromium
from support.motion import Plant, Recording
from support.series import record

SHOWN = ("dead_time", "coulomb_friction")


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    """Write the page of a certificate of two quantities."""
    rng = np.random.default_rng(3)
    records = [
        record(Plant(), Recording(kind, kind, duration_s=5.0), rng, sigma_deg=0.05) for kind in ("stairs", "chirp")
    ]
    with pytest.MonkeyPatch.context() as patch:
        quantities = tuple(q for q in QUANTITIES if q.id in SHOWN)
        patch.setattr("anglecam.certificate.certify.QUANTITIES", quantities)
        certificate = certify(close_records(records))
    path = tmp_path_factory.mktemp("certificate") / "certificate.html"
    write_certificate_page(path, "a <b>", certificate, [("stairs.angles.csv", "0" * 64)], [])
    return path


@pytest.fixture(scope="module")
def browser():
    with chromium() as started:
        yield started


@pytest.mark.parametrize("width", [pytest.param(1280, marks=pytest.mark.sweep), 390])
def test_nothing_is_cut_and_every_quantity_has_a_figure_that_can_be_read(page_file, browser, width):
    page = browser.new_page(viewport={"width": width, "height": 900})
    page.goto(page_file.as_uri())
    assert page.evaluate("document.scrollingElement.scrollWidth") <= width
    cut = "[...document.querySelectorAll('.scroll')].filter(e => e.scrollWidth > e.clientWidth).length"
    assert page.evaluate(cut) == 0
    figures = [figure.bounding_box() for figure in page.locator("svg").all()]
    assert len(figures) == len(SHOWN)
    assert all(250.0 <= box["width"] <= width for box in figures)
    for quantity in QUANTITIES:
        assert page.get_by_text(quantity.meaning).is_visible() == (quantity.id in SHOWN)
    page.close()
