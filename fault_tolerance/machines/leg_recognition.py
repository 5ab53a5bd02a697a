# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Struts as lines of a table of legs, as far as they are legs of the usual types."""

from __future__ import annotations

import numpy as np

from fault_tolerance.analysis.scene import joint_groups, joint_letter
from fault_tolerance.errors import MechanismError
from fault_tolerance.machines.leg_types import LEG_TYPES, NEEDS, Leg
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.mechanism.parts import Strut

_ALONG = 1e-9


def legs_of(mechanism: Mechanism) -> list[Leg]:
    """Return the struts of ``mechanism`` as legs.

    MechanismError if one of them is no leg that a table can hold.
    """
    if not mechanism.struts:
        reason = 'a mechanism given by its Jacobian only has no legs'
        raise MechanismError(mechanism.name, 'struts', reason)
    return [_leg(strut, mechanism.name) for strut in mechanism.struts]


def _leg(strut: Strut, source: str) -> Leg:
    groups = [joints for _, joints in joint_groups(strut)]
    kind = ''.join(map(joint_letter, groups))
    driven = [place for place, joints in enumerate(groups)
              if any(joint.actuator is not None for joint in joints)]
    expected = kind.find('P') if 'P' in kind else kind.find('R')
    if kind not in LEG_TYPES or driven != [expected]:
        shown = ' '.join(f'{letter}{"*" * (place in driven)}' for place, letter in enumerate(kind))
        reason = f'{shown} (* driven) is not a leg of one of the types {", ".join(LEG_TYPES)}'
        raise MechanismError(source, f'struts.{strut.name}', reason)
    places = [joints[0].point for joints in groups]
    base, platform = places[1 if kind[0] == 'P' else 0], places[-1]
    axes = {letter: joints[0].axis for letter, joints in zip(kind, groups, strict=True)}
    extra: dict[str, FloatArray] = {}
    for key in NEEDS[kind]:
        extra[key] = places[1] if key == 'knee' else axes['P' if key == 'slide' else 'R']
    rod = platform - base
    if 'P' in kind and 'slide' not in extra and (
        np.linalg.norm(np.cross(axes['P'], rod)) > _ALONG * np.linalg.norm(rod)
        or axes['P'] @ rod < 0.0
    ):
        reason = 'its drive does not push from the joint at the base to the one at the platform'
        raise MechanismError(source, f'struts.{strut.name}', reason)
    return Leg(kind, base, platform, strut.actuators[0], **extra)
