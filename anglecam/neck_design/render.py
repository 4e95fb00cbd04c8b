"""The one renderer of ``anglecam neck``: any verb's result as a JSON object and as tables in the terminal.

It reads the annotations of `anglecam.neck_design.units`. `Result.tables` assigns the parts of a result to tables;
headings, units and digits of rows are declared with the fields.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from typing import Any, Protocol, get_args, get_type_hints

from rich.table import Table

from anglecam.neck_design.text import cell, rounded
from anglecam.neck_design.units import INLINE, INTERNAL, ONE, OPTIONAL, Column, Unit, UnitsByName, WithUnit


@dataclass(frozen=True)
class Facts:
    """A table of two columns: a name and its value."""

    title: str
    facts: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Lines:
    """A table whose cells are written out; the first ``words`` columns are text, the others numbers."""

    headings: Sequence[str]
    lines: Iterable[Sequence[str]]
    words: int = 1
    title: str | None = None
    """Line above the table, if any."""


@dataclass(frozen=True)
class Rows:
    """A table of dataclasses of one type: a column for each field that declares a `Column`."""

    rows: Sequence[Any]
    words: int = 1
    """Columns of text at the left."""
    placeholders: Mapping[str, str] = field(default_factory=dict)
    """Values for the ``{name}`` placeholders of headings."""
    title: str | None = None


Layout = Facts | Lines | Rows


class Result(Protocol):
    """The result of a verb of ``anglecam neck``: a frozen dataclass with annotated fields."""

    def tables(self) -> Sequence[Layout]:
        """Return the tables to print, in their order."""
        ...

    def remarks(self) -> Sequence[str]:
        """Return the lines to print below the tables."""
        ...


def as_json(result: Any) -> Any:
    """Return a result as nested dicts, lists and plain values, ready for `anglecam.io.files.json_text`.

    Parameters
    ----------
    result : dataclass, mapping, sequence or plain value
        A dataclass becomes an object. Its keys are the field names, each followed by the suffix of its `Unit`; a field
        with two units has two keys.

    Returns
    -------
    dict, list or plain value
        Floats rounded to 12 significant digits.

    Examples
    --------
    >>> from anglecam.neck_design.results.step import Step
    >>> as_json(Step(rise_time=0.1, overshoot=0.25, settling_time=0.5))
    {'rise_time_s': 0.1, 'overshoot': 0.25, 'overshoot_percent': 25.0, 'settling_time_s': 0.5}
    """
    if is_dataclass(result) and not isinstance(result, type):
        return {key: item for name, hints in _annotations(type(result)) for key, item in _items(result, name, hints)}
    if isinstance(result, Mapping):
        return {key: as_json(item) for key, item in result.items()}
    if isinstance(result, list | tuple):
        return [as_json(item) for item in result]
    return rounded(float(result)) if isinstance(result, float) else result


def terminal_tables(result: Result) -> list[Table]:
    """Lay out a result's tables for the terminal."""
    return [_table(layout) for layout in result.tables()]


def key(name: str, unit: Unit) -> str:
    """Return the JSON key of a quantity: its name and the suffix of its unit."""
    return f"{name}_{unit.suffix}".rstrip("_")


@cache
def _annotations(kind: Any) -> tuple[tuple[str, tuple[Any, ...]], ...]:
    """Return each field's name with the metadata of its annotation."""
    hints = get_type_hints(kind, include_extras=True)
    return tuple((f.name, tuple(_metadata(hints[f.name]))) for f in fields(kind))


def _metadata(hint: Any) -> Iterator[Any]:
    """Yield the metadata of an annotation, also where it stands inside ``X | None``."""
    if hasattr(hint, "__metadata__"):
        yield from hint.__metadata__
        yield from _metadata(hint.__origin__)
    elif type(None) in get_args(hint):
        for part in get_args(hint):
            yield from _metadata(part)


def _items(result: Any, name: str, hints: tuple[Any, ...]) -> Iterator[tuple[str, Any]]:
    """Yield the JSON keys and values of one field."""
    value = getattr(result, name)
    if INTERNAL in hints or (OPTIONAL in hints and value is None):
        return
    if INLINE in hints:
        yield from as_json(value).items()
        return
    if isinstance(value, WithUnit):
        yield key(name, value.unit), as_json(value.unit.convert(value.value))
        return
    named = next((hint for hint in hints if isinstance(hint, UnitsByName)), None)
    if named is not None:
        yield name, {key(item, named.units[item]): as_json(value[item]) for item in value}
        return
    for unit in [hint for hint in hints if isinstance(hint, Unit)] or [ONE]:
        yield key(name, unit), as_json(_converted(value, unit))


def _converted(value: Any, unit: Unit) -> Any:
    """Return a float or a sequence of floats in a unit; anything else unchanged."""
    if isinstance(value, list | tuple):
        return [_converted(item, unit) for item in value]
    return unit.convert(value) if isinstance(value, float) else value


def _table(layout: Layout) -> Table:
    """Return a layout as a table of the terminal."""
    if isinstance(layout, Facts):
        made = Table(layout.title, "")
        for fact in layout.facts:
            made.add_row(*fact)
        return made
    if isinstance(layout, Rows):
        columns = list(_columns(type(layout.rows[0]), layout.rows))
        headings = [column.heading.format(**layout.placeholders) for column, _, _ in columns]
        layout = Lines(headings, [_cells(row, columns) for row in layout.rows], layout.words, layout.title)
    made = Table(title=layout.title, title_justify="left" if layout.title else "center")
    for i, heading in enumerate(layout.headings):
        made.add_column(heading, justify="left" if i < layout.words else "right", no_wrap=i == 0)
    for line in layout.lines:
        made.add_row(*line)
    return made


_Path = tuple[str, ...]
_Cell = tuple[Column, _Path, tuple[Any, ...]]
"""A column, the attributes that lead to its field, and the metadata of that field."""


def _columns(kind: type, rows: Sequence[Any], at: _Path = ()) -> Iterator[_Cell]:
    """Yield the columns of a row's fields and, in their place, of its inlined dataclasses.

    A column of an optional field is left out where every row lacks the value.
    """
    for name, hints in _annotations(kind):
        path = (*at, name)
        column = next((hint for hint in hints if isinstance(hint, Column)), None)
        values = [_get(row, path) for row in rows]
        if column is not None and not (OPTIONAL in hints and all(value is None for value in values)):
            yield column, path, hints
        elif column is None and INLINE in hints and is_dataclass(values[0]):
            yield from _columns(type(values[0]), rows, path)


def _get(row: Any, path: _Path) -> Any:
    """Follow attributes from a row to a value."""
    for name in path:
        row = getattr(row, name)
    return row


def _cells(row: Any, columns: Sequence[_Cell]) -> list[str]:
    """Return the text of each cell of a row."""
    cells = []
    for column, path, hints in columns:
        if callable(column.cell):
            cells.append(column.cell(_get(row, path[:-1])))
            continue
        value = _get(row, path)
        if isinstance(value, WithUnit):
            cells.append(cell(value.value, column.cell))
            continue
        # a quantity with two units is shown in the second: per cent, not a share
        unit = [hint for hint in hints if isinstance(hint, Unit)][-1:]
        cells.append(cell(_converted(value, unit[0]) if unit else value, column.cell))
    return cells
