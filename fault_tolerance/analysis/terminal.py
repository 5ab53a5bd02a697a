# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Consoles, tables and letters for terminals of any encoding."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from rich import box, progress
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderableType, RenderResult
from rich.console import RenderHook as _RenderHook
from rich.segment import Segment
from rich.table import Table

_ELLIPSIS = '\u2026'
"""What rich ends a text with that it has cut short, whatever the terminal can show."""


def console_for_text(**options: Any) -> Console:
    """Return a `rich.console.Console` with ``options`` whose own letters the terminal can show.

    Letters that come from elsewhere, as names do, stay what they are.
    """
    console = Console(**options)
    if not console.encoding.startswith('utf'):
        console.push_render_hook(_DotsForEllipses())
    return console


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """Yield what takes how much is done and how much there is, to be shown as a bar.

    With ``what`` it is of before it, on standard error, where that is a terminal.
    """
    console = console_for_text(stderr=True)
    if not console.is_terminal:  # a disabled bar of older rich still ends with an empty line
        yield lambda done, total: None
        return
    columns = (
        progress.TextColumn('{task.description}'), progress.BarColumn(),
        progress.MofNCompleteColumn(), progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
    )
    with progress.Progress(*columns, console=console) as bar:
        shown = bar.add_task(what, total=None)
        yield lambda done, total: bar.update(shown, completed=done, total=total)


def plain_table(*columns: str, numbers: Sequence[str] = (), **options: Any) -> Table:
    """Return a table of ``columns``, then ``numbers`` to the right; ``options`` are rich's."""
    table = Table(box=box.SIMPLE_HEAD, **{'title_justify': 'left', **options})
    for heading in columns:
        table.add_column(heading)
    for heading in numbers:
        table.add_column(heading, justify='right')
    return table


def number(value: float | None, form: str, without: str = '-') -> str:
    """Return ``value`` in the ``form`` of `format`, or ``without`` where there is none."""
    return without if value is None else format(value, form)


def in_ascii(text: str) -> str:
    """Return ``text`` in the same width in ASCII.

    A dot stands for an ellipsis, a question mark for each cell of another letter.
    """
    if text.isascii():
        return text
    return ''.join(
        letter if letter.isascii() else '.' if letter == _ELLIPSIS else '?' * cell_len(letter)
        for letter in text
    )


class _Dotted:
    """Something to print, with dots for ellipses."""

    def __init__(self, content: RenderableType) -> None:
        self._content = content

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        for text, style, control in console.render(self._content, options):
            yield Segment(text.replace(_ELLIPSIS, '.'), style, control)


class _DotsForEllipses(_RenderHook):
    """Puts a dot for every ellipsis."""

    def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
        """Return what is to be printed instead."""
        return [_Dotted(content) for content in renderables]
