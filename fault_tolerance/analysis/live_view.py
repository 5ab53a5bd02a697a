# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The live view of a controller: a page of the terminal, or one line of plain text."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite, log10
from typing import Any

from rich import box
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.segment import Segment
from rich.table import Column, Table
from rich.text import Text

from fault_tolerance.analysis.snapshot import (
    LETTERS,
    NOT_TOLERATED,
    WORDS,
    Actuator,
    Snapshot,
    with_prefix,
)
from fault_tolerance.analysis.suspicion_text import alike_text, suspect_text, unseen_text
from fault_tolerance.analysis.terminal import in_ascii

# Safe for colour-blind readers; each colour has its word beside it.
_STOPPED = 'stopped'
_STATES = {
    'nominal': 'bold white on blue',
    'degraded': 'bold black on yellow',
    'hold': 'bold black on bright_white',
    _STOPPED: 'bold white on red',
}
_FAILED = {'position': 'bold yellow', 'torque': 'bold magenta', 'hard': 'dim'}
_GOOD, _LITTLE, _NOTHING = 'cyan', 'yellow', 'red'
_LITTLE_LEFT = 0.2
_AS_GOOD_AS_0 = 5e-4
_BARS = ' ▁▂▃▄▅▆▇█'
_ASCII_BARS = ' .:-=+*#%@'
# Rows of the error: from 0.1 microradians to 10 milliradians.
_LOWEST_ERROR, _HIGHEST_ERROR = -7.0, -2.0
_WIDE, _NARROW = 100, 60
_STALE_AFTER = 1.0


class LiveView:
    """A ``snapshot`` to be printed with rich, in any width."""

    def __init__(self, snapshot: Snapshot) -> None:
        self._snapshot = snapshot

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield a panel as wide as the terminal."""
        width = options.max_width
        inner = width - 4
        plain = options.ascii_only
        panel = Panel(
            Group(*self._parts(inner, plain)),
            title=Text(self._snapshot.title[:max(inner - 4, 1)], style='bold'),
            title_align='left',
            box=box.ASCII if plain else box.ROUNDED,
            width=width,
        )
        if not plain:
            yield panel
            return
        # Names may have any letters, and rich ends what it cuts short with one that is not ASCII.
        for text, style, control in console.render(panel, options):
            yield Segment(in_ascii(text), style, control)

    def _parts(self, width: int, plain: bool) -> Iterator[RenderableType]:
        snapshot = self._snapshot
        yield _headline(snapshot)
        if not snapshot.state:
            return
        yield from _suspects(snapshot)
        yield Text(_numbers(snapshot), style='dim', no_wrap=True, overflow='crop')
        yield Text('')
        if not snapshot.actuators:
            yield Text('no measures yet', style='dim')
        elif width >= _WIDE:
            both = Table.grid(Column(ratio=5), Column(ratio=2), expand=True, padding=(0, 3))
            half = (width - 3) * 5 // 7
            both.add_row(_actuators(snapshot, half, plain), _struts(snapshot))
            yield both
        else:
            yield _actuators(snapshot, width, plain)
            yield _struts(snapshot)
        yield Text('')
        if snapshot.actuators and snapshot.state != _STOPPED:
            yield _worst(snapshot)
        yield from _blind_spots(snapshot)
        if snapshot.errors:
            yield _error(snapshot, width, plain)


def plain_line(snapshot: Snapshot) -> str:
    """Return ``snapshot`` as one line, for logs and pipes."""
    if not snapshot.state:
        return f'{snapshot.title}: waiting for the controller'
    parts = [f'{snapshot.state}: {snapshot.reason}' if snapshot.reason else snapshot.state]
    parts += [f'suspected: {suspect_text(one)}' for one in snapshot.suspects]
    if snapshot.errors:
        parts.append(f'error {_rms(snapshot)}')
    if snapshot.state != _STOPPED:
        parts.append(_worst(snapshot).plain)
    rates = [one.rate for one in snapshot.actuators]
    if rates and all(rate is not None for rate in rates):
        parts.append('rates ' + ' '.join(f'{rate:.3g}' for rate in rates))
    if snapshot.age > _STALE_AFTER:
        parts.append(f'not heard for {snapshot.age:.0f} s')
    return f'{snapshot.title}: ' + ' | '.join(parts)


def _headline(snapshot: Snapshot) -> Text:
    if not snapshot.state:
        return Text('waiting for the controller', style='dim')
    head = Text.assemble((f' {snapshot.state.upper()} ', _STATES.get(snapshot.state, 'bold')))
    if snapshot.reason:
        head.append(f'  {snapshot.reason}')
    if snapshot.age > _STALE_AFTER:
        head.append(f'  (not heard for {snapshot.age:.0f} s)', style='bold red')
    return head


def _suspects(snapshot: Snapshot) -> Iterator[Text]:
    for one in snapshot.suspects:
        yield _line('suspected: ', suspect_text(one), 'bold magenta')


def _blind_spots(snapshot: Snapshot) -> Iterator[Text]:
    """Yield what would not be noticed, and what would not be told apart."""
    for heading, words in (
        ('would not be noticed: ', unseen_text(snapshot)),
        ('would look the same: ', alike_text(snapshot)),
    ):
        if words:
            yield _line(heading, words, '')


def _line(heading: str, words: str, style: str) -> Text:
    """Return a line that ends with dots where there is no room."""
    text = Text(heading, no_wrap=True, overflow='ellipsis')
    return text.append(words, style=style)


def _numbers(snapshot: Snapshot) -> str:
    count = len(snapshot.failures)
    parts = [f'{count} failure{"s" if count != 1 else ""} present']
    parts += [f'{words} {value:.3g}' for words, value in (snapshot.values or {}).items()]
    return '   '.join(parts)


def _actuators(snapshot: Snapshot, width: int, plain: bool) -> Table:
    """Return the table of actuators, with fewer columns where there is less room."""
    bars = width >= _NARROW
    signed = width >= _NARROW + 15
    measures = ('stuck next: p', 'free next: t') if bars else ('p', 't')
    table = _table(
        _column('actuator' if bars else ''), _column(),
        *(_column(heading, ratio=3 if bars else None) for heading in measures),
        _column('rate', justify='right'), *([_column()] if signed else ()),
    )
    for one in snapshot.actuators:
        cells: list[RenderableType] = [one.name, _condition(one.failure)]
        cells += [_measure(value, one.failure, bars) for value in (one.position, one.torque)]
        cells.append(_rate(one))
        if signed:
            cells.append(_signed_bar(one.rate, snapshot.fastest, plain))
        table.add_row(*cells)
    return table


def _struts(snapshot: Snapshot) -> RenderableType:
    if not snapshot.struts:
        return Text('')
    table = _table(_column('strut'), _column(), _column('lost next: h', ratio=3))
    for one in snapshot.struts:
        measure = _measure(one.hard, one.failure, True)
        table.add_row(one.name, _condition(one.failure), measure)
    return table


def _table(*columns: Column) -> Table:
    return Table(
        *columns, box=None, expand=True, padding=(0, 1, 0, 0), pad_edge=False, header_style='dim'
    )


def _column(heading: str = '', **options: Any) -> Column:
    return Column(heading, no_wrap=True, overflow='crop', **options)


def _condition(failure: str) -> Text:
    return Text(WORDS.get(failure, failure), style=_FAILED.get(failure, 'dim'))


def _measure(value: float | None, failure: str, bars: bool) -> RenderableType:
    """Return a measure as bar and number; in words if there is nothing to measure."""
    if value is None:
        return Text('failed' if failure != 'none' else '-', style='dim')
    style = _GOOD if value >= _LITTLE_LEFT else _LITTLE if value >= NOT_TOLERATED else _NOTHING
    stop = '0 STOP' if value < _AS_GOOD_AS_0 else 'STOP'
    number = Text(f'{value:.3f}' if value >= NOT_TOLERATED else stop, style=style)
    if not bars:
        return number
    row = Table.grid(_column(ratio=1), _column(width=6), expand=True, padding=(0, 1, 0, 0))
    bar = ProgressBar(1.0, min(value, 1.0), complete_style=style, finished_style=style)
    row.add_row(bar, number)
    return row


def _rate(one: Actuator) -> Text:
    if one.rate is None:
        return Text('-', style='dim')
    text = Text(with_prefix(one.rate, one.unit))
    if isfinite(one.limit) and abs(one.rate) >= 0.999 * one.limit:
        text.append(' limit', style='bold red')
    return text


def _signed_bar(rate: float | None, fastest: float, plain: bool, half: int = 6) -> Text:
    """Return a bar to the left or the right of a middle; its full length is the fastest rate."""
    length = 0
    if rate is not None and fastest > 0.0:
        length = min(half, round(half * abs(rate) / fastest))
    full, rest, middle = ('#', '-', '|') if plain else ('━', '─', '┃')
    bar = Text(rest * half + middle + rest * half, style='dim')
    if length and rate is not None:
        begin = half + 1 if rate > 0.0 else half - length
        bar = Text(f'{bar.plain[:begin]}{full * length}{bar.plain[begin + length:]}', style='dim')
        bar.stylize('not dim bold cyan', begin, begin + length)
    return bar


def _worst(snapshot: Snapshot) -> Text:
    """Return what the next failure that hurts most would do."""
    if not snapshot.worst_next:
        return Text('no further failure can be judged')
    mode, _, name = snapshot.worst_next.partition(':')
    measure = snapshot.worst_measure
    text = Text('worst next failure: ')
    text.append(f'{name} {WORDS.get(mode, mode)}', style='bold')
    text.append(f', {LETTERS[mode]} = {measure:.3f}: ' if mode in LETTERS else ': ')
    if measure < NOT_TOLERATED:
        text.append('would stop it', style='bold red')
    else:
        text.append('would be tolerated', style='cyan')
    return text


def _error(snapshot: Snapshot, width: int, plain: bool) -> Table:
    columns = (_column(), _column(ratio=1), _column(justify='right'))
    row = Table.grid(*columns, expand=True, padding=(0, 2, 0, 0))
    words, value = 'pointing error', _rms(snapshot)
    room = max(width - len(words) - len(value) - 4, 4)
    line = sparkline(snapshot.errors, room, plain=plain)
    row.add_row(Text(words), Text(line, style='cyan'), Text(value))
    return row


def sparkline(errors: Sequence[float], width: int, *, plain: bool = False) -> str:
    """Return ``errors`` (rad, oldest first) as at most ``width`` blocks, the tallest for 10 mrad.

    Each block is the largest error of its time, on a logarithmic scale; ``plain`` means ASCII.
    """
    count = min(width, len(errors))
    edges = [len(errors) * index // count for index in range(count + 1)] if count else [0]
    blocks = _ASCII_BARS if plain else _BARS
    line = ''
    for begin, end in zip(edges, edges[1:], strict=False):
        largest = max(max(errors[begin:end]), 1e-30)
        share = (log10(largest) - _LOWEST_ERROR) / (_HIGHEST_ERROR - _LOWEST_ERROR)
        line += blocks[max(1, min(len(blocks) - 1, 1 + int(share * (len(blocks) - 1))))]
    return line


def _rms(snapshot: Snapshot) -> str:
    return f'{1e6 * (snapshot.rms_error or 0.0):.1f} urad rms'
