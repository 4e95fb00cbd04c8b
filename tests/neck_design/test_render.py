"""One renderer writes any result: keys end in their unit, columns come from the fields."""

from dataclasses import dataclass
from math import nan, pi
from typing import Annotated

import pytest

from anglecam.neck_design.render import Facts, Rows, as_json, terminal_tables
from anglecam.neck_design.units import INLINE, INTERNAL, OPTIONAL, Angle, Angles, Column, Share, Time, Unit, WithUnit


@dataclass(frozen=True)
class Inner:
    rise_time: Annotated[Time, Column("rise, s", 2)]
    overshoot: Annotated[Share, Column("overshoot, %", 1)]


@dataclass(frozen=True)
class Row:
    name: Annotated[str, Column("{what}")]
    nod: Annotated[Angle, Column("nod, °", 1)]
    inner: Annotated[Inner, INLINE]
    rest: Annotated[WithUnit, Column("rest", 1)]
    measured: Annotated[float | None, OPTIONAL, Column("measured", 1)] = None


@dataclass(frozen=True)
class Made:
    rows: tuple[Row, ...]
    range: Angles
    stretch: Annotated[float, Unit("m")] | None
    extra: Annotated[Inner | None, OPTIONAL]
    source: Annotated[object, INTERNAL]

    def tables(self):
        return [Facts("facts", [("a", "1")]), Rows(self.rows, placeholders={"what": "model"})]

    def remarks(self):
        return ()


def made(measured=None):
    row = Row("one", pi / 6.0, Inner(0.1, 0.25), WithUnit(2.0, Unit("rad_per_V")), measured)
    return Made((row,), (0.0, pi / 2.0), None, None, object())


def test_keys_end_in_their_unit_and_radians_become_degrees():
    assert as_json(made()) == {
        "rows": [
            {
                "name": "one",
                "nod_deg": 30.0,
                "rise_time_s": 0.1,
                "overshoot": 0.25,
                "overshoot_percent": 25.0,
                "rest_rad_per_V": 2.0,
            }
        ],
        "range_deg": [0.0, 90.0],
        "stretch_m": None,
    }


@pytest.mark.parametrize(("measured", "headings"), [(None, []), (1.5, ["measured"])])
def test_columns_are_the_fields_and_a_column_without_a_value_is_left_out(measured, headings):
    facts, rows = terminal_tables(made(measured))
    assert [column.header for column in facts.columns] == ["facts", ""]
    assert [c.header for c in rows.columns] == ["model", "nod, °", "rise, s", "overshoot, %", "rest", *headings]
    assert [next(iter(c.cells)) for c in rows.columns][:5] == ["one", "30.0", "0.10", "25.0", "2.0"]


def test_a_number_that_is_missing_is_a_dash():
    (_, rows) = terminal_tables(Made((Row("", nan, Inner(nan, nan), WithUnit(nan, Unit(""))),), (), None, None, None))
    assert [next(iter(c.cells)) for c in rows.columns][1:] == ["–"] * 4
