# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The mechanisms that come with the package, by name, and anybody's by file."""

from __future__ import annotations

from pathlib import Path

from fault_tolerance.errors import MechanismError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.files import mechanism_from_file
from fault_tolerance.resources import share_directory


def shipped_names() -> tuple[str, ...]:
    """Return the names of the shipped mechanisms, sorted."""
    return tuple(sorted(path.stem for path in _folder().glob('*.yaml')))


def gallery_names() -> tuple[str, ...]:
    """Return the names of the mechanisms of the gallery (docs/gallery.md), sorted."""
    return tuple(sorted(path.stem for path in _gallery().glob('*.yaml')))


def mechanism_named(name: str | Path) -> Mechanism:
    """Return a mechanism that comes with the package by its name, or one in a file by its path.

    Parameters
    ----------
    name : str or Path

    Returns
    -------
    Mechanism

    Raises
    ------
    MechanismError
        If it is neither, or the file cannot be used.
    """
    return mechanism_from_file(mechanism_path(name))


def mechanism_path(name: str | Path) -> Path:
    """Return the file of a mechanism that comes with the package, or the path itself.

    Parameters
    ----------
    name : str or Path
        Of a shipped mechanism or one of the gallery, or the path of a file.

    Returns
    -------
    Path

    Raises
    ------
    MechanismError
        If it is neither.
    """
    text = str(name)
    if text in shipped_names():
        return _folder() / f'{text}.yaml'
    if text in gallery_names():
        return _gallery() / f'{text}.yaml'
    if not text:
        raise MechanismError('mechanism', '', 'no name given')
    if Path(text).suffix in ('.yaml', '.yml') or Path(text).exists():
        return Path(text)
    shipped = ', '.join((*shipped_names(), *gallery_names()))
    raise MechanismError(text, '', f'is neither a file nor a shipped mechanism ({shipped})')


def _gallery() -> Path:
    return _folder() / 'gallery'


def _folder() -> Path:
    return share_directory() / 'config' / 'mechanisms'
