# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Failures of several kinds at once, and which of them to make worse on purpose.

A brake makes a free actuator a stuck one; a release makes a stuck strut a lost one. Which is
better depends on what redundancy is left (paper, section III-F).
"""

from fault_tolerance import failure_set, mechanism_from_file, reconfigured
from fault_tolerance.kinematics.conversion import best_conversion
from fault_tolerance.kinematics.rows import home_rows
from fault_tolerance.mechanism.files import mechanism_from_text
from fault_tolerance.resources import share_directory

# The shipped mirror, with a brake on every actuator and struts that can be let go.
path = share_directory() / 'config' / 'mechanisms' / 'fsm_4_strut.yaml'
text = path.read_text().replace('actuated: true', 'actuated: true, brake: true')
mirror = mechanism_from_text(text.replace('\n    joints', '\n    release: true\n    joints'))
plain = mechanism_from_file(path)

for broken in (
    [('free', 'theta_1')],
    [('free', 'theta_1'), ('stuck', 'theta_2')],
    [('free', 'theta_1'), ('free', 'theta_2')],
    [('stuck', 'theta_1'), ('stuck', 'theta_2')],
):
    without = reconfigured(home_rows(plain), failure_set(plain, broken))
    print(f'{without.verdict.reason}')
    found = best_conversion(home_rows(mirror), failure_set(mirror, broken))
    actions = ', '.join(f'{old} to {new}' for old, new in found.best.actions)
    print(f'  kept as it is: {found.as_it_is.kept:.4f}')
    print(f'  kept at best:  {found.best.kept:.4f} ({actions or "leaving it"})')
