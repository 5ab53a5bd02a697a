# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The control law against a plain statement of what it optimises."""

from __future__ import annotations

from itertools import product

import numpy as np
from core.kernel.kernel_cases import failure_sets, modelled, values_at
from core.mechanisms import DOCUMENTS, by_numbers, made

from fault_tolerance.control.estimate import estimate
from fault_tolerance.control.rate_command import initial_command, rate_command, zero_command
from fault_tolerance.kernel import array_layout as at
from fault_tolerance.kernel.compilation import best_kernel, python_kernel
from fault_tolerance.kinematics.failures import FailureSet, failure_set
from fault_tolerance.kinematics.reconfiguration import reconfigured
from fault_tolerance.kinematics.rows import home_rows, strut_rows
from fault_tolerance.mechanism.catalogue import mechanism_named
from fault_tolerance.mechanism.configuration import fitted_configuration

SINGULAR, POOR = 5e-4, 0.05
SPEED, RATE = 1e100, 1e6


def pinv_above(matrix, least):
    """Return the pseudo-inverse that leaves out singular values up to ``least``."""
    left, sigma, right = np.linalg.svd(matrix, full_matrices=False)
    kept = sigma > least
    return right[kept].T @ (left[:, kept] / sigma[kept]).T


def in_metres(post):
    """Return J (6, n), T (N, n) and T with the free drives, all in metres."""
    if post.rows.mechanism.struts:
        present = post.in_metres().present
        return present.twist_jacobian, present.mapping, present.rate_map
    mechanism, present = post.rows.mechanism, post.present
    basis, triangle = np.linalg.qr(mechanism.rate_scale[:, None] * present.mapping)
    twist = np.zeros((6, present.mobility))
    scale = np.repeat([mechanism.characteristic_length, 1.0], 3)[:, None]
    rows = mechanism.task.rows
    twist[rows] = scale[rows] * present.jacobian @ np.linalg.inv(triangle)
    rates = mechanism.rate_scale[:, None] * present.rate_map @ np.linalg.inv(triangle)
    return twist, basis, rates


class Oracle:
    """The law for one mechanism and its settings, stated in metres and reduced rates x."""

    def __init__(self, mechanism, settings):
        self.mechanism, self.settings, self.task = mechanism, settings, mechanism.task
        self.scale = np.repeat([mechanism.characteristic_length, 1.0], 3)
        self.drives = mechanism.rate_scale
        jacobian, _, _ = in_metres(reconfigured(home_rows(mechanism)))
        major = jacobian[self.task.rows][self.task.major_rows]
        sigma = np.linalg.svd(major, compute_uv=False)
        whole, gain = len(sigma) == len(major), np.linalg.norm(jacobian)
        self.moves = sigma[-1] if whole and sigma[-1] > settings.slow_below else 1.0
        self.held = gain if gain * settings.slow_below < 1.0 else 1.0
        self.under_way = False

    def priority(self, jacobian, velocity):
        """Return the x that serves the major task, and what then serves the secondary one."""
        rows, task = jacobian[self.task.rows], self.task
        asked = velocity * min(1.0, SPEED / max(np.abs(velocity).max(), 1.0))
        asked = self.scale[task.rows] * asked
        major, secondary = rows[task.major_rows], rows[task.secondary_rows]
        first = pinv_above(major, SINGULAR) @ asked[task.major_rows]
        _, sigma, right = np.linalg.svd(major)
        free = right[int((sigma > 1e-9 * max(1.0, sigma.max(initial=0.0))).sum()) :].T
        missing = asked[task.secondary_rows] - secondary @ first
        left, gains, ways = np.linalg.svd(secondary @ free, full_matrices=False)
        least = max(SINGULAR, POOR * sigma.max(initial=0.0))
        fade = np.clip(gains / least - 1.0, 0.0, 1.0)
        share = np.divide(fade, gains, out=np.zeros_like(gains), where=fade > 0.0)
        return first, free @ (ways.T @ (share * (left.T @ missing)))

    def fitted(self, first, second, bounds):
        """Return factor and share: of the second part all that fits, else of the first."""
        major, other = self.rates(first), self.rates(second)
        both = self.rates(first + second)
        lower, upper = bounds
        if (both >= lower).all() and (both <= upper).all():
            return 1.0, 1.0
        moved = other != 0.0
        ends = np.sort([(bound - major)[moved] / other[moved] for bound in bounds], axis=0)
        share = max(ends[1].min(initial=1.0), 0.0)
        found = major + share * other
        rounding = 1e-12 * np.abs(found).max(initial=0.0)
        if (found >= lower - rounding).all() and (found <= upper + rounding).all():
            return 1.0, share
        bound = np.where(major > 0.0, upper, lower)
        crossing = np.abs(major) > np.abs(bound)
        return np.divide(bound, major, where=crossing, out=np.ones_like(major)).min(), 0.0

    def rates(self, reduced):
        """Return the drives' rates, without what is only rounding."""
        found = self.follow @ reduced / self.drives
        return np.where(np.abs(found) > 1e-12 * np.abs(found).max(initial=0.0), found, 0.0)

    def command(self, post, failures, readings, velocity, before, now):
        """Return rates, twist, factor and share of one command after ``before``."""
        jacobian, mapping, self.follow = in_metres(post)
        rows = self.task.rows[self.task.major_rows]
        major = jacobian[rows]
        sigma = np.linalg.svd(major, compute_uv=False)
        moves = sigma[-1] if len(sigma) == len(major) else 0.0
        held = min(1.0, self.held / max(np.linalg.norm(jacobian), 1e-300))
        margin, settings = min(moves / self.moves, held), self.settings
        hold = settings.hold_below * (2.0 if before.hold_reason else 1.0)
        if margin <= hold:
            return np.zeros(len(mapping)), np.zeros(6), 0.0, 0.0
        slow = (margin - settings.hold_below) / (settings.slow_below - settings.hold_below)
        first, second = np.clip(slow, 0.0, 1.0) * np.array(self.priority(jacobian, velocity))
        limits = self.mechanism.position_limits.T - readings
        speed = np.minimum(self.mechanism.velocity_limits, RATE)
        ends = np.nan_to_num(settings.stroke_gain * limits, nan=np.inf) * [[-1.0], [1.0]]
        ends = np.where(np.isnan(readings), np.inf, ends)
        ends = np.clip(ends, 0.0, speed) * [[-1.0], [1.0]]
        factor, share = self.fitted(first, second, ends)
        goal = factor * (first + share * second)
        sent = self.drives * before.rates, (self.scale * before.twist)[rows]
        begins = before.failures != failures or not before.numbers[at.MOVED] or self.under_way
        self.under_way = bool(begins and np.isfinite(before.numbers[at.TIME]))
        if self.under_way and self.rates(goal).any():
            goal = self.on_the_way(major, mapping, goal, sent, ends, now - before.numbers[at.TIME])
        result = self.follow @ goal / self.drives, jacobian @ goal / self.scale
        return *result, np.clip(slow, 0.0, 1.0) * factor, share

    def on_the_way(self, major, mapping, goal, sent, ends, seconds):
        """Return the point between the last command and ``goal`` that may be reached by now."""
        def jumps(reduced):
            return np.array([np.linalg.norm(major @ reduced - sent[1]),
                             np.linalg.norm(self.follow @ reduced - sent[0])])

        inverse = pinv_above(major, SINGULAR)
        start = mapping.T @ sent[0]
        start = start + inverse @ (sent[1] - major @ start)
        distance = np.linalg.norm(goal - start)
        allowed = self.settings.max_acceleration * max(seconds, 0.0)
        if distance <= allowed + 1e-9 * max(np.linalg.norm(goal), np.linalg.norm(start)):
            self.under_way = False
            return goal
        reached = start + allowed / distance * (goal - start)
        first = inverse @ (major @ reached)
        factor, share = self.fitted(first, reached - first, ends)
        reached = factor * (first + share * (reached - first))
        rounding = 1e-12 * (np.linalg.norm(goal) + np.linalg.norm(reached))
        if (jumps(reached) > (1.0 + 1e-9) * jumps(goal) + rounding).any():
            self.under_way = False
            return goal
        return reached


def velocities(mechanism, rng):
    """Return task velocities: small ones, ones beyond limits, and one beyond all sense."""
    count, size = len(mechanism.task.coordinates), mechanism.characteristic_length
    for factor in (0.01, 1.0, 100.0, 1e250):
        yield factor * size * rng.standard_normal(count)


def require_the_promises(mechanism, command, post, readings, settings):
    """Require what holds for every command, however it has come about."""
    rates, size = command.rates, max(1.0, np.abs(command.rates).max())
    assert (np.abs(rates) <= np.minimum(mechanism.velocity_limits, RATE) * (1.0 + 1e-9)).all()
    beyond = mechanism.position_limits.T - readings
    with np.errstate(invalid='ignore'):
        assert not (rates < np.minimum(settings.stroke_gain * beyond[0], 0.0) - 1e-9 * size).any()
        assert not (rates > np.maximum(settings.stroke_gain * beyond[1], 0.0) + 1e-9 * size).any()
    modes = [post.failures.mode_of(mechanism, name).value for name in mechanism.actuator_names]
    assert not rates[[mode in ('position', 'hard') for mode in modes]].any()
    jacobian, _, follow = in_metres(post)
    scale = np.repeat([mechanism.characteristic_length, 1.0], 3)
    reduced = np.linalg.pinv(follow) @ (mechanism.rate_scale * rates)
    size = max(size, np.abs(command.twist).max())
    np.testing.assert_allclose(jacobian @ reduced / scale, command.twist, atol=1e-8 * size)


def largest_deviation(mechanism, kernel, rng, sets, places, **settings):
    """Return how far commands are from the oracle's, relative to the largest rate, and where.

    Parameters
    ----------
    mechanism, kernel, rng
    sets : list of FailureSet
        A transition leads from each of them to another.
    places : list of (N,) arrays
        Joint values.
    settings
        See `Settings`.
    """
    model = modelled(mechanism, kernel, **settings)
    worst, count = (0.0, ''), 0
    for values, (first, then) in product(places, zip(sets, sets[::-1], strict=True)):
        for velocity in velocities(mechanism, rng):
            oracle = Oracle(mechanism, model.settings)
            before, found = initial_command(model), model.unknown
            other = velocity[rng.permutation(len(velocity))]
            plan = [(first, velocity), (then, other), (then, other), (None, other),
                    (then, other), (then, velocity)]
            for number, (failures, asked) in enumerate(plan):
                now = 0.02 * number
                if failures is None:
                    before = zero_command(before, then, now)
                    continue
                found = estimate(model, found, values, failures)
                if found.hold_reason:
                    break
                used, present = found, failures
                if not model.settings.recovery:
                    used, present = estimate(model, found, found.readings, FailureSet()), None
                law = reconfigured(strut_rows(used.configuration), present)
                readings = found.readings
                wanted = oracle.command(law, failures, readings, asked, before, now)
                before = rate_command(model, found, asked, before, now)
                count += 1
                size = max(1e-3, np.abs(wanted[0]).max(), np.abs(wanted[1]).max())
                off = max(np.abs(before.rates - wanted[0]).max() / size,
                          np.abs(before.twist - wanted[1]).max() / size,
                          abs(before.scale - wanted[2]), abs(before.secondary_scale - wanted[3]))
                if not off <= worst[0]:
                    worst = off, f'{mechanism.name} {np.round(values, 3)} {failures} {asked} ' \
                                 f'command {number}: {before.rates} instead of {wanted[0]}'
                require_the_promises(mechanism, before, law, readings, model.settings)
    return worst, count


SHIPPED = ('mirror_4_strut', 'mirror_overactuated', 'fsm_4_strut', 'gough_stewart_8',
           'planar_4rpr', 'serial_3r')


def places_of(mechanism, rng):
    """Return joint values at home, near it, and close to the ends of some strokes."""
    home = np.zeros(len(mechanism.actuators))
    high = np.where(np.isfinite(mechanism.position_limits[:, 1]), mechanism.position_limits[:, 1],
                    0.1 * mechanism.characteristic_length)
    towards = values_at(mechanism, 0.02, rng)
    farthest = np.abs(towards / high).max()
    ends = towards * (0.999 / farthest if farthest > 0.0 else 0.0)
    if mechanism.struts:
        ends = np.array(fitted_configuration(mechanism, ends).actuator_values)
    return [home, towards, ends]


def test_commands_are_what_the_law_says_through_failures_limits_and_transitions():
    machines = [*map(mechanism_named, SHIPPED), made(DOCUMENTS['two_stage_mirror']()),
                made(DOCUMENTS['serial_7r']()), made(by_numbers())]
    total = 0
    for mechanism, acceleration in product(machines, (0.1, 10.0)):
        rng = np.random.default_rng(5)
        sets = failure_sets(mechanism, rng, 4, 3)[::6]
        (worst, where), count = largest_deviation(
            mechanism, best_kernel(), rng, sets, places_of(mechanism, rng),
            max_acceleration=acceleration)
        assert worst <= 1e-8, where
        total += count
    assert total > 1400


def test_without_recovery_commands_are_those_of_the_healthy_mechanism():
    for name in ('mirror_4_strut', 'gough_stewart_8', 'serial_3r'):
        mechanism, rng = mechanism_named(name), np.random.default_rng(5)
        sets = failure_sets(mechanism, rng, 4, 3)[::8]
        (worst, where), count = largest_deviation(
            mechanism, best_kernel(), rng, sets, places_of(mechanism, rng), recovery=False)
        assert worst <= 1e-8, where
        assert count > 25


def test_near_singularities_of_both_kinds_the_law_slows_down_and_holds():
    arm, first = made(DOCUMENTS['serial_3r']()), np.arctan2(0.9, 0.5)
    second = np.arctan2(0.2, 0.8) - first
    bends = (0.1, 6e-3, 2e-3, 1e-3, 8e-4, 3e-4, 1e-5, 0.0)
    stretched = [np.array([0.0, -first + bend, -second + bend]) for bend in bends]
    platform = mechanism_named('gough_stewart_8')
    legs = np.array([1.0, -0.4, 0.7, 0.2, -0.9, 0.5, 0.3, -0.6])
    shares = (2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4)
    beside = [np.array(fitted_configuration(
        platform, share * platform.characteristic_length * legs).actuator_values)
        for share in shares]
    loose = failure_set(platform, [('free', 'leg_1'), ('free', 'leg_3')])
    for mechanism, sets, places in (
        (arm, [FailureSet(), FailureSet()], stretched), (platform, [loose, loose], beside),
    ):
        rng = np.random.default_rng(7)
        (worst, where), count = largest_deviation(mechanism, best_kernel(), rng, sets, places)
        # Errors of J grow by its condition.
        assert worst <= 1e-6, where
        assert count > 100


def test_the_law_as_python_is_the_same_law():
    for name in ('mirror_4_strut', 'mirror_overactuated'):
        mechanism, rng = mechanism_named(name), np.random.default_rng(9)
        sets = failure_sets(mechanism, rng, 2, 1)[::8]
        (worst, where), _ = largest_deviation(
            mechanism, python_kernel(), rng, sets, places_of(mechanism, rng)[1:2],
            max_acceleration=0.05)
        assert worst <= 1e-8, where


def test_limits_and_singularities_keep_the_direction_of_the_major_task():
    rng = np.random.default_rng(11)
    for name in SHIPPED:
        mechanism = mechanism_named(name)
        model, rows = modelled(mechanism, best_kernel()), mechanism.task.rows
        places = places_of(mechanism, rng)
        for failures in failure_sets(mechanism, rng, 4, 2):
            for values, size in product(places, (1.0, 1e3, 1e300)):
                found = estimate(model, model.unknown, values, failures)
                asked = size * rng.standard_normal(len(rows))
                command = rate_command(model, found, asked, initial_command(model), 0.0)
                if found.hold_reason or not found.tolerated or command.hold_reason:
                    continue
                achieved = command.twist[rows[mechanism.task.major_rows]]
                wanted = asked[mechanism.task.major_rows] / size
                unit = max(np.abs(achieved).max(), 1e-300)
                off = achieved - wanted * (achieved @ wanted) / (wanted @ wanted)
                assert np.abs(off).max() <= 1e-9 * unit or not command.rates.any()
                assert achieved @ wanted >= 0.0
                # Whatever is slowed down is so for a reason that is told.
                assert command.scale == 1.0 or command.slowed or command.saturated(
                    mechanism.actuator_names) or size > 1e100


def test_an_eased_command_never_jumps_more_than_the_one_it_leads_to():
    rng = np.random.default_rng(13)
    for name in SHIPPED:
        mechanism = mechanism_named(name)
        drives = mechanism.rate_scale
        slow, at_once = (modelled(mechanism, best_kernel(), max_acceleration=limit)
                         for limit in (0.1, 1e12))
        sets, places = failure_sets(mechanism, rng, 6, 4), places_of(mechanism, rng)
        for number in range(200):
            first, then = (sets[place] for place in rng.integers(len(sets), size=2))
            values = places[number % 3]
            size = 10.0 ** rng.uniform(-4.0, 2.0)
            asked = size * rng.standard_normal((2, len(mechanism.task.coordinates)))
            found = estimate(slow, slow.unknown, values, first)
            before = rate_command(slow, found, asked[0], initial_command(slow), 0.0)
            found = estimate(slow, found, values, then)
            one, other = (
                rate_command(model, found, asked[1], before, 1e-3) for model in (slow, at_once)
            )
            jumps = [np.linalg.norm(drives * (each.rates - before.rates)) for each in (one, other)]
            speed = np.linalg.norm(drives * one.rates) + np.linalg.norm(drives * other.rates)
            assert jumps[0] <= jumps[1] * (1.0 + 1e-6) + 1e-9 * speed, (name, first, then)
            if first != then and one.numbers[at.MOVED] and other.rates.any():
                np.testing.assert_allclose(one.rate_jump, jumps[0], rtol=1e-9, atol=1e-9 * speed)
