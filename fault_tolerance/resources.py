# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Where the files that come with the package (``config/``, ``launch/``) are on this machine.

The same code runs from a checkout, from a pip installation and from a colcon workspace. Each puts
the shared files elsewhere, and only the last can be asked through ament, so they are looked for.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

PACKAGE = 'fault_tolerance'
_SHARE = Path('share') / PACKAGE
_EVIDENCE = Path('config') / 'mechanisms'


def share_directory() -> Path:
    """Return the folder that holds ``config/`` and ``launch/``.

    The root of a checkout, or ``PREFIX/share/fault_tolerance`` of an installation. What belongs to
    this very copy of the code comes before anything the environment names. FileNotFoundError, with
    the places looked at, if none holds ``config/mechanisms``.
    """
    candidates = dict.fromkeys(_candidates())
    for candidate in candidates:
        if (candidate / _EVIDENCE).is_dir():
            return candidate
    places = ', '.join(map(str, candidates))
    raise FileNotFoundError(f'no {_EVIDENCE} of {PACKAGE} in any of: {places}')


def code_digest() -> str:
    """Return what tells any two versions of this package's code apart."""
    package = Path(__file__).resolve().parent
    digest = sha256()
    for path in sorted(package.rglob('*.py')):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _candidates() -> Iterator[Path]:
    """Yield the possible share folders, the surest first."""
    package = Path(__file__).resolve().parent
    checkout = package.parent
    if (checkout / 'package.xml').is_file():
        yield checkout
    # An installation prefix is some levels above site-packages (how many depends on the system);
    # pip install --target puts share/ beside the package itself.
    for folder in package.parents:
        yield folder / _SHARE
    yield Path(sys.prefix) / _SHARE
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        if prefix:
            yield Path(prefix) / _SHARE
