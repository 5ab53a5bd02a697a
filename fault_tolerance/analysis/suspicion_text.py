# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What detection suspects, and what it could not tell apart, in words short enough for a line."""

from __future__ import annotations

from collections.abc import Sequence

from fault_tolerance.analysis.snapshot import SUSPECTED, Snapshot, Suspect

_HEALTHY = 'healthy'


def suspect_text(suspect: Suspect) -> str:
    """Return what is suspected, with its odds, and what would narrow it down.

    Parameters
    ----------
    suspect : Suspect

    Returns
    -------
    str
    """
    odds = '' if suspect.log_odds is None else f'log odds {suspect.log_odds:.0f}: '
    parts = _split(suspect.candidates)
    modes = list(dict.fromkeys(SUSPECTED.get(mode, mode) for mode, _, _ in parts))
    names = list(dict.fromkeys(name for _, _, name in parts))
    if len(modes) == 1 or len(names) == 1:
        words = f'{" or ".join(names)} {" or ".join(modes)}'
    else:
        words = ' or '.join(f'{name} {SUSPECTED.get(mode, mode)}' for mode, _, name in parts)
    if suspect.would_separate and len(parts) > 1:
        words += f' (to tell: {suspect.would_separate})'
    return f'{odds}{words}'


def unseen_text(snapshot: Snapshot) -> str:
    """Return which failures would not be noticed now; empty if all would, or if not known.

    Parameters
    ----------
    snapshot : Snapshot

    Returns
    -------
    str
    """
    groups = [group for group in snapshot.alike if _HEALTHY in group]
    unseen = [one for group in groups for one in group if one != _HEALTHY]
    return ', '.join(_shortened(unseen, snapshot))


def alike_text(snapshot: Snapshot) -> str:
    """Return which failures would be noticed, but not told apart; empty if there are none.

    Parameters
    ----------
    snapshot : Snapshot

    Returns
    -------
    str
    """
    by_part: dict[tuple[str, ...], list[str]] = {}
    others = []
    for group in (one for one in snapshot.alike if _HEALTHY not in one):
        about = {one.partition(':')[2] for one in group}
        if len(about) == 1:
            modes = tuple(SUSPECTED.get(mode, mode) for mode, _, _ in _split(group))
            by_part.setdefault(modes, []).append(about.pop())
        else:
            others.append(' = '.join(_shortened(group, snapshot, ' = ')))
    drives = [one.name for one in snapshot.actuators]
    for modes, names in by_part.items():
        whose = 'each drive' if len(drives) > 1 and set(names) >= set(drives) else ', '.join(names)
        others.insert(0, f'{whose}: {" = ".join(modes)}')
    return '; '.join(others)


def _shortened(
    hypotheses: Sequence[str], snapshot: Snapshot, between: str = ' '
) -> list[str]:
    """Return failures by what happens to whom, ``any drive`` or ``any strut`` where it is all."""
    by_mode: dict[str, list[str]] = {}
    for mode, _, name in _split(hypotheses):
        by_mode.setdefault(mode, []).append(name)
    everybody = {
        'any drive': {one.name for one in snapshot.actuators},
        'any strut': {one.name for one in snapshot.struts},
    }
    result = []
    for mode, names in by_mode.items():
        whole = [word for word, all_of in everybody.items() if all_of and all_of <= set(names)]
        result.append(f'{between.join(whole or names)} {SUSPECTED.get(mode, mode)}')
    return result


def _split(hypotheses: Sequence[str]) -> list[tuple[str, str, str]]:
    return [one.partition(':') for one in hypotheses]
