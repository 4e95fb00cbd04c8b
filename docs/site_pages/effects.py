"""A page for each effect, from the ledger."""

from __future__ import annotations

import inspect
import math
import sys

from anglecam.effects import LEDGER, Effect, Parameter


def pages() -> dict[str, str]:
    """Return the text of each page, by the effect's id."""
    return {effect.id: _page(effect) for effect in LEDGER}


def _page(effect: Effect) -> str:
    opposite = f"\n\nWith the opposite sign: {effect.opposite}" if effect.opposite else ""
    known = {one.id for one in LEDGER}
    aliases = ", ".join(f"[`{id_}`]({id_}.md)" for id_ in effect.aliases if id_ in known)
    rows = "\n".join(_row(parameter) for parameter in effect.parameters)
    return f"""# {effect.id}

{effect.summary}{opposite}

    {effect.equation}

| | |
| --- | --- |
| station on the signal's path | {effect.station} |
| port of the model | {effect.port} |
| relaxes | {_cell(effect.relaxes)} |
| can be mistaken for | {aliases or "none"} |
| record this to distinguish them | {_cell(effect.separating_experiment)} |
| sought in free swings | {"yes" if effect.in_free_swing else "no"} |
| source | {_cell(effect.source)} |

## Parameters

Values as in `loop.json`, in the unit that the name ends in. At its null the first parameter makes the effect vanish.

| name | symbol | null | range of a fit | |
| --- | --- | --- | --- | --- |
{rows}

## In the code

{_paragraphs(effect)}
"""


def _row(parameter: Parameter) -> str:
    low, high = sorted(parameter.in_file_unit(value)[0] for value in (parameter.lower, parameter.upper))
    remark = "fitted only if the data support it" if parameter.staged else ""
    null = parameter.in_file_unit(parameter.null)[0]
    return (
        f"| `{parameter.name}` | {parameter.symbol} | {_number(null)} | {_number(low)} … {_number(high)} | {remark} |"
    )


def _number(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.4g}"


def _paragraphs(effect: Effect) -> str:
    """Return the docstring of the effect's module; its file is named by the id."""
    module = sys.modules[f"anglecam.effects.{effect.id}"]
    return f"`anglecam/effects/{effect.id}.py`:\n\n```text\n{inspect.cleandoc(module.__doc__ or '')}\n```"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
