"""A certificate's intervals hold the true size, its bounds hold absence, and what cannot be known is said."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from anglecam.certificate.certificate_json import certificate_as_dict
from anglecam.certificate.certify import Clock, certify
from anglecam.certificate.quantity import QUANTITIES
from anglecam.certificate.statement import NOT_NAMED, PART_OF_THE_REST, aliases, statement
from anglecam.io.files import json_text
from anglecam.loop.close import close_records
from support.motion import Plant, Recording
from support.series import record

KINDS = ("stairs", "chirp", "triangle")
ALL = tuple(quantity.id for quantity in QUANTITIES)
DELAYS = ("dead_time", "lag", "backlash")


@lru_cache
def certified(plant, seed=0, only=ALL):
    """Return the certificate of three short recordings with noise of 0.05°, of all quantities or ``only`` some."""
    rng = np.random.default_rng(seed)
    records = [record(plant, Recording(kind, kind, duration_s=5.0), rng, sigma_deg=0.05) for kind in KINDS]
    return certify_only(only, close_records(records, seed=seed))


def certify_only(only, *arguments):
    """Certify some quantities; the others take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("anglecam.certificate.certify.QUANTITIES", tuple(q for q in QUANTITIES if q.id in only))
        return certify(*arguments)


def entry(certificate, quantity):
    return next(one for one in certificate.quantities if one.quantity.id == quantity)


def interval(certificate, quantity):
    one = entry(certificate, quantity)
    return one.quantity.interval_in_file(*one.interval)


NOTHING = Plant()
LATE = Plant(dead_time_s=0.03)
RUBBING = Plant(coulomb=2.0, breakaway=2.6)


def test_where_nothing_acts_every_quantity_is_bounded_usefully():
    certificate = certified(NOTHING)
    assert certificate.holds
    for one in certificate.quantities:
        assert one.state == "bounded", one.quantity.id
        assert one.interval[0] <= one.profile.null <= one.interval[1]
    # the motion spans 24°, at up to 280 °/s and 6100 °/s²
    assert interval(certificate, "backlash")[1] < 0.1
    assert interval(certificate, "coulomb_friction")[1] < 20.0
    assert interval(certificate, "breakaway_friction")[1] < 60.0
    assert interval(certificate, "dead_time")[1] < 0.001
    assert interval(certificate, "lag")[1] < 0.001
    assert interval(certificate, "speed_limit")[0] > 2000.0
    assert interval(certificate, "torque_limit")[0] > 3000.0


def test_a_dead_time_is_measured_and_the_lag_is_bounded_with_it():
    certificate = certified(LATE, only=DELAYS)
    low, high = interval(certificate, "dead_time")
    assert low < 0.03 < high
    assert high - low < 0.001
    assert entry(certificate, "dead_time").state == "measured"
    assert entry(certificate, "lag").state == "bounded"
    content = certificate_as_dict(certificate)
    late = next(one for one in content["quantities"] if one["id"] == "dead_time")
    assert late["statement"].startswith("dead time plus clock offset 0.0")
    assert any("No lamp" in line for line in late["aliases"])


@pytest.mark.sweep  # a dead time is measured above, and bounds of friction hold where nothing acts
def test_sliding_and_breakaway_friction_are_measured():
    true_sizes = {"coulomb_friction": 2.0, "breakaway_friction": 2.6}
    certificate = certified(RUBBING, only=tuple(true_sizes))
    for quantity, true in true_sizes.items():
        low, high = interval(certificate, quantity)
        assert low < math.degrees(true) < high
        assert entry(certificate, quantity).state == "measured"
    assert interval(certificate, "coulomb_friction")[1] < 1.15 * math.degrees(2.0)


def test_a_size_whose_effect_the_verdict_does_not_name_may_be_chance():
    certificate = certified(LATE, only=DELAYS)
    late = entry(certificate, "dead_time")
    assert NOT_NAMED not in aliases(late, certificate)
    assert NOT_NAMED in aliases(replace(late, accepted=False), certificate)
    assert NOT_NAMED not in aliases(entry(certificate, "backlash"), certificate)  # bounded


def test_with_a_lamp_the_dead_time_is_the_servos_and_includes_the_lamps_uncertainty():
    verdict = certified(LATE, only=DELAYS).verdict
    seen = certify_only(("dead_time",), verdict, Clock(True, 0.004))
    low, high = interval(seen, "dead_time")
    assert high - low == pytest.approx(2.0 * 1.96 * 0.004, rel=0.1)
    assert low < 0.03 < high
    assert statement(entry(seen, "dead_time"), clock_shared=True).startswith("dead time 0.03")


def test_an_effect_that_a_partial_verdict_does_not_name_is_not_certified():
    whole = certified(LATE, only=DELAYS)
    unnamed = tuple(replace(one, accepted=False) for one in whole.quantities)
    verdict = replace(whole.verdict, verdict="partly_explained")
    partly = replace(whole, verdict=verdict)
    states = {one["id"]: one["state"] for one in certificate_as_dict(partly)["quantities"]}
    assert (states["dead_time"], states["lag"]) == ("measured", "bounded")
    late = next(
        one
        for one in certificate_as_dict(replace(partly, quantities=unnamed))["quantities"]
        if one["id"] == "dead_time"
    )
    assert late["state"] == "not_certified"
    assert late["statement"].endswith(": not certified")
    assert late["aliases"] == [PART_OF_THE_REST]
    assert not math.isfinite(late["dead_time_s"]["interval_95"][1])


def test_an_unexplained_verdict_says_that_its_intervals_do_not_hold():
    certificate = certified(NOTHING)
    unexplained = replace(certificate, verdict=replace(certificate.verdict, verdict="unexplained"))
    content = certificate_as_dict(unexplained)
    assert not content["intervals_hold"]
    assert content["doubt"].startswith("Nothing is certified. The model leaves structure")
    for one in content["quantities"]:
        assert one["state"] == "not_certified"
        assert one["statement"].endswith(": not certified")
        assert "command_deg" not in one
    partly = replace(certificate, verdict=replace(certificate.verdict, verdict="partly_explained"))
    assert "may be too narrow" in certificate_as_dict(partly)["doubt"]


def test_a_free_swing_determines_no_delay_and_names_the_recording_that_would():
    rng = np.random.default_rng(3)
    swing = record(Plant(a=0.6, b=60.0, c=0.0, coulomb=0.05), Recording("swing", "release"), rng, sigma_deg=0.05)
    content = certificate_as_dict(certify(close_records([swing])))
    by_id = {one["id"]: one for one in content["quantities"]}
    for quantity in ("backlash", "dead_time", "lag", "speed_limit", "torque_limit"):
        assert by_id[quantity]["state"] == "not_determined"
        assert by_id[quantity]["determined_by"]
    assert by_id["coulomb_friction"]["state"] != "not_determined"
    assert "command_deg" not in by_id["coulomb_friction"]


def test_the_file_is_strict_json_with_units_in_its_keys():
    content = json.loads(json_text(certificate_as_dict(certified(NOTHING))))
    by_id = {one["id"]: one for one in content["quantities"]}
    assert by_id["speed_limit"]["speed_limit_deg_per_s"]["interval_95"][1] is None  # no limit
    assert set(by_id["backlash"]["backlash_deg"]) == {"value", "interval_95"}
    assert by_id["torque_limit"]["command_deg"]["interval_95"][0] > 0.0
    assert content["model"].keys() == {"a_per_s", "b_per_s2", "c_per_s2"}
