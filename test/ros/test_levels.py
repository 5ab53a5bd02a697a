# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Diagnostics, metrics and status tell the same, and each thing once."""

from __future__ import annotations

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from node_rig import LATCHED, Plant, Probe, values_of

NAMES = ['theta_1', 'theta_2', 'theta_3', 'theta_4']
OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
ERROR, STALE = DiagnosticStatus.ERROR, DiagnosticStatus.STALE


class Panel:
    """What an operator has in view."""

    def __init__(self, probe: Probe) -> None:
        self.statuses = probe.heard(DiagnosticStatus, 'fault_tolerance/status', LATCHED)
        self._diagnostics = probe.heard(DiagnosticArray, '/diagnostics')
        self._probe = probe

    @property
    def health(self) -> DiagnosticStatus | None:
        found = [
            status for message in self._diagnostics for status in message.status
            if status.name == 'fault_tolerance: controller'
        ]
        return found[-1] if found else None

    @property
    def told(self) -> list[tuple[bytes, str]]:
        """Level and text of status, metrics and diagnostics, as far as they have come."""
        lights = [(one.level, f'{values_of(one)["state"]}: {one.message}')
                  for one in self.statuses[-1:]]
        lights += [(one.status[0].level, one.status[0].message)
                   for one in self._probe.metrics[-1:]]
        return lights + [(one.level, one.message) for one in [self.health] if one]


@pytest.fixture
def panel(probe):
    return Panel(probe)


def test_one_level_and_one_text_everywhere(probe, panel, controller, plant):
    def shown(level, text, step=True):
        def all_alike():
            if step:
                plant.step()
            return panel.told == 3 * [(level, text)]

        probe.wait(all_alike, f'{level!r}, {text}; not {panel.told}')

    idle = 'no task velocity for 0.1 s'
    probe.wait(lambda: plant.step() and panel.health, 'diagnostics')
    shown(OK, 'nominal: no failure; no task velocity yet')
    plant.asked = (0.0, 0.0)
    shown(OK, 'nominal: no failure')
    plant.report('position', 'theta_4')
    shown(WARN, 'degraded: theta_4 stuck; wx, wy retained, vz coupled')
    assert values_of(panel.statuses[-1]) == {
        'state': 'degraded', 'failures': 'position:theta_4', 'suspected': ''
    }
    probe.pause(True)
    shown(WARN, 'hold: paused; theta_4 stuck')
    probe.pause(False)
    plant.asked = None
    shown(WARN, f'degraded: theta_4 stuck; wx, wy retained, vz coupled; {idle}')
    shown(STALE, 'hold: no usable joint state for 0.1 s; theta_4 stuck', step=False)
    plant.report('position', 'theta_3')
    reason = 'stopped: theta_3 stuck, theta_4 stuck; '
    probe.wait(lambda: plant.step() and probe.state == 'stopped', 'the stop')
    probe.wait(lambda: plant.step() and len({*panel.told}) == 1, 'one text')
    level, text = panel.told[0]
    assert (level, text[: len(reason)]) == (ERROR, reason)
    assert probe.mechanism['worst_next'] == ''
    assert text.endswith('cannot be given independently (position measure 0)')
    counts = values_of(panel.health)
    assert (counts['failures'], counts['stops']) == ('2', '1') and int(counts['holds']) >= 2
    lines = [line for line in controller.output.splitlines() if 'fault_tolerance]: ' in line]
    for kind, words in (('[WARN]', 'degraded: '), ('[WARN]', 'hold: '), ('[ERROR]', 'stopped: ')):
        assert any(kind in line and words in line for line in lines), (kind, lines)
    # Only changes are told.
    assert all(a != b for a, b in zip(panel.statuses, panel.statuses[1:], strict=False))


def test_an_error_without_a_failure_mode_is_told_of_once_for_each_part(probe, plant, controller):
    wanted = 'reports an ERROR without the key failure_mode'

    def complain(*names, level=ERROR):
        statuses = [DiagnosticStatus(name='motor', hardware_id=name, level=level)
                    for name in names]
        plant.diagnostics.publish(DiagnosticArray(status=statuses))

    def repeated():
        complain('theta_1', 'strut_2', 'wheel_1')
        complain('theta_3', level=WARN)
        probe.spin(0.05)
        return controller.output.count(wanted) >= 2

    probe.wait(repeated, 'two warnings')
    for _ in range(30):
        repeated()
    assert controller.output.count(f"theta_1: 'motor' {wanted}") == 1
    assert controller.output.count(f"strut_2: 'motor' {wanted}") == 1
    assert controller.output.count(wanted) == 2
    plant.reach('nominal')
    assert not probe.mechanism.get('failures')


def test_of_every_part_that_is_reported_healthy_is_told_in_the_same_second(
    probe, plant, controller
):
    plant.report('torque', 'theta_1')
    plant.report('torque', 'theta_2')
    probe.wait(lambda: plant.step() and probe.state in ('degraded', 'stopped'), 'the failures')
    plant.report('none', 'theta_1', 'theta_2')
    for name in ('theta_1', 'theta_2'):
        text = f'{name} (torque) is reported healthy, but stays until it is cleared'
        probe.wait(lambda text=text: plant.step() and text in controller.output, text)


def test_a_reading_beyond_its_stroke_is_one_event_however_long_it_lasts(start, probe, panel):
    controller = start('controller', mechanism='mirror_4_strut')
    plant = Plant(probe, NAMES)
    plant.connect()
    far = plant.joint_state([7e-4, 0.0, -7e-4, 0.0])
    for _ in range(30):
        plant.step(far)
    probe.wait(
        lambda: plant.step(far) and panel.health
        and 'warned_out_of_range' in values_of(panel.health), 'the warning'
    )
    assert values_of(panel.health)['warned_out_of_range'] == '1'
    assert panel.health.message.count('beyond the stroke') == 1
    assert controller.output.count('beyond the stroke') == 1
