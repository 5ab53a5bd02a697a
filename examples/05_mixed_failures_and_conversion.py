# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Failures of several kinds at once, and which of them to make worse on purpose.

A brake makes a free actuator a stuck one; a release makes a stuck strut a lost one. Which is
better depends on what redundancy is left (paper, section III-F).
"""

import fault_tolerance as ft

# The shipped mirror, with a brake on every actuator and struts that can be let go.
text = ft.mechanism_path('fsm_4_strut').read_text()
text = text.replace('actuated: true', 'actuated: true, brake: true')
mirror = ft.mechanism_from_text(text.replace('\n    joints', '\n    release: true\n    joints'))

for broken in (
    ['free:theta_1'],
    ['free:theta_1', 'stuck:theta_2'],
    ['free:theta_1', 'free:theta_2'],
    ['stuck:theta_1', 'stuck:theta_2'],
):
    post = ft.after(mirror, broken)
    print(post.verdict.reason)
    found = ft.best_conversion(post.rows, post.failures)
    actions = ', '.join(f'{old} to {new}' for old, new in found.best.actions)
    print(f'  kept as it is: {found.as_it_is.kept:.4f}')
    print(f'  kept at best:  {found.best.kept:.4f} ({actions or "leaving it"})')
