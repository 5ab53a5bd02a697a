# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What reading URDF and SDF has in common: numbers in texts, errors with the element."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.closure_files import Closures
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.parts import JointKind

AXIS_KINDS: dict[str, JointKind] = {
    'revolute': 'revolute', 'continuous': 'revolute', 'prismatic': 'prismatic',
}
"""What the types of joints with one axis are called here."""


class XmlFile:
    """The XML file ``path`` in ``form``, as 'URDF', whose root is called ``tag``.

    MechanismError if it cannot be read.
    """

    def __init__(self, path: Path, form: str, tag: str) -> None:
        self.source = str(path)
        try:
            self.root = ElementTree.parse(path).getroot()
        except (OSError, ElementTree.ParseError, ValueError) as error:
            raise self.error('', f'is no {form} that can be read ({error})') from None
        if self.root.tag != tag:
            raise self.error('', f'its root is <{self.root.tag}>, not <{tag}>')

    def error(self, where: str, reason: str) -> MechanismError:
        """Return the error that the element ``where`` cannot be used, for a ``reason``."""
        return MechanismError(self.source, where, reason)

    def numbers(self, where: str, text: str, *counts: int) -> FloatArray:
        """Return the numbers in ``text``, of which there have to be one of ``counts``.

        MechanismError, with the element ``where``, if they are others.
        """
        try:
            found = np.array([float(word) for word in text.split()])
        except ValueError:
            found = np.array([])
        if len(found) not in counts or not np.isfinite(found).all():
            wanted = ' or '.join(map(str, counts))
            raise self.error(where, f'{text.strip()!r} is not {wanted} numbers')
        return found

    def driven(
        self, joints: list[str], closures: Closures, own: Iterable[str], own_way: str
    ) -> list[str]:
        """Return the names of the driven joints, in order.

        Parameters
        ----------
        joints : list of str
            All there are.
        closures : Closures
            Its motors come first.
        own : iterable of str
            What the file itself says is driven, where there are no motors.
        own_way : str
            How it would say so, for the error.

        Returns
        -------
        list of str

        Raises
        ------
        MechanismError
            If there are none.
        """
        found = []
        for word in closures.motors:
            meant = [word] if word in joints else [name for name in joints if word in name]
            if not meant:
                raise MechanismError(closures.source, 'name_mot', f'no joint {word!r}')
            found += meant
        found = found or [name for name in own if name in joints]
        if not found:
            reason = f'no joint is driven: name them in a file (name_mot: [...]) or {own_way}'
            raise self.error('', reason)
        return list(dict.fromkeys(found))
