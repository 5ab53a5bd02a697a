# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""Whether a manipulator with failures can do its task, by how much, and why (not).

Tolerance is decided on the system after all failures: on the rank of J_m and on stability there
(docs/theory.md, section 4), and on what is left of both beside the nominal system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fault_tolerance.kinematics.differential import DifferentialKinematics
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.measures import holding_measures, retained_manipulability
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import adds_rank, range_basis, rank
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.linear_algebra import decomposed
from fault_tolerance.mechanism.task import COORDINATES, Task
from fault_tolerance.tolerances import MAIN_SHARE, NOTABLE_SHARE, STANDS_OUT

if TYPE_CHECKING:
    from fault_tolerance.kinematics.reconfiguration import PostFailure


@dataclass(frozen=True)
class Verdict:
    """Whether a manipulator in this state can do its task, and why (not).

    Attributes
    ----------
    stable : bool
        No motion of the platform escapes the drives.
    tolerable : bool
        Stable, and every major coordinate can still be given independently.
    mobility : int
        Degrees of freedom the drives control.
    lost, gained : tuple of str
        Coordinates that were independent of those before them (major ones first) and are no
        longer, and the reverse among all six.
    drifting : tuple of str
        Coordinates that move with every drive at rest.
    reason : str
        A sentence.
    """

    stable: bool
    tolerable: bool
    mobility: int
    lost: tuple[str, ...]
    gained: tuple[str, ...]
    drifting: tuple[str, ...]
    reason: str

    def __repr__(self) -> str:
        return f'Verdict({"tolerable" if self.tolerable else "not tolerable"}: {self.reason})'


@dataclass(frozen=True)
class ToleranceMargins:
    """How far the system after all failures is from one that is not tolerable."""

    motion: float
    """w_m(J_m) of the final over the nominal system, 0 when its rank is below m. It is p while all
    failures are position failures, and may exceed 1."""
    torque: float
    """t of the free set after the stuck set."""
    hard: float
    """h of the lost set after both."""

    def __repr__(self) -> str:
        return f'ToleranceMargins({self.motion:.4g}, {self.torque:.4g}, {self.hard:.4g})'


def is_tolerable(rows: StrutRows, present: DifferentialKinematics) -> bool:
    """Return whether ``present`` kinematics of ``rows`` are stable and rank J_m = m."""
    major = present.major
    return present.stable and rank(major * _major_scale(rows)) == len(major)


def verdict_of(
    rows: StrutRows,
    failures: FailureSet,
    nominal: DifferentialKinematics,
    present: DifferentialKinematics,
) -> Verdict:
    """Return the verdict on the ``present`` kinematics of ``rows``, and what ``failures`` changed.

    ``nominal`` are the kinematics without failures.
    """
    task = rows.mechanism.task
    names = _twist_names(rows)
    order = [*task.by_priority, *(name for name in names if name not in task.coordinates)]
    places = [names.index(name) for name in order]
    scale = rows.twist_scale[places, None]
    before = adds_rank(nominal.twist_jacobian[places] * scale)
    after = adds_rank(present.twist_jacobian[places] * scale)
    changes = list(zip(order, before, after, strict=True))
    lost = tuple(name for name, was, is_ in changes[: len(task.coordinates)] if was and not is_)
    gained = tuple(name for name, was, is_ in changes if is_ and not was)
    missing = tuple(name for name, _, is_ in changes if name in task.major and not is_)
    drifting = _drifting(present, rows, NOTABLE_SHARE)
    mainly = _drifting(present, rows, MAIN_SHARE)
    drift = ', '.join(mainly) if mainly == drifting else f'mostly {", ".join(mainly)}'
    if drift:
        count = present.unactuated.shape[1]
        drift += f' unactuated ({count} motion{"" if count == 1 else "s"})'
    return Verdict(
        present.stable,
        is_tolerable(rows, present),
        present.mobility,
        lost,
        gained,
        drifting,
        _reason(failures, task, drift, lost, gained, missing),
    )


def tolerance_margins(post: PostFailure) -> ToleranceMargins:
    """Return how far ``post`` is from intolerable, decided after all failures.

    Where drives turn and slide, rates count in metres (`StrutRows.in_metres`): the paper's
    measures then compare radians with metres and depend on the units, too much for a decision.
    """
    post = _unit_free(post)
    return ToleranceMargins(retained_manipulability(post), *holding_measures(post))


def intolerance(post: PostFailure, threshold: float) -> str:
    """Return why the failures of ``post`` are not tolerated; empty if they are.

    They are tolerated when the platform is held, its major coordinates are all there, and no
    margin is below ``threshold``: nearly lost counts as lost. Around a configuration where a
    margin is 0 it grows in proportion to the way from there, so the threshold is also how far
    around a singularity all is judged as in it (docs/theory.md, section 8).
    """
    margins = tolerance_margins(post)
    failures = post.failures
    motion = 'motion' if failures.free or failures.lost else 'position'
    found = {'torque': margins.torque, 'hard': margins.hard, motion: margins.motion}
    name, value = min(found.items(), key=lambda item: item[1])
    if not post.verdict.tolerable:
        return f'{post.verdict.reason} ({name} measure {value:.3g})'
    if value >= threshold:
        return ''
    words = failures_in_words(failures)
    text = f'{words}: {name} measure {value:.3g} is below the tolerance threshold {threshold:.3g}'
    held = name != motion
    weakest = weakest_motion(_unit_free(post), held=held)
    if weakest:
        text += f'; hardly {"held" if held else "moved"}: {", ".join(weakest)}'
    return text


def _unit_free(post: PostFailure) -> PostFailure:
    """Return ``post`` with turning drives taken at the characteristic length."""
    return post if post.mechanism.has_uniform_rate_scale else post.in_metres()


def failures_in_words(failures: FailureSet) -> str:
    """Return ``failures`` as in ``theta_4 stuck, theta_2 free, strut_3 lost``."""
    words = [f'{name} stuck' for name in failures.stuck]
    words += [f'{name} free' for name in failures.free]
    words += [f'{name} lost' for name in failures.lost]
    return ', '.join(words) if words else 'no failure'


def weakest_motion(post: PostFailure, *, held: bool) -> tuple[str, ...]:
    """Return the main coordinates of the motion that the drives of ``post`` control least.

    Near a singularity there is one that stands out; elsewhere nothing is returned. With ``held``
    it is the motion they hold least, of those the task had before; otherwise the one they move
    least, of the major task.
    """
    rows, task = post.rows, post.mechanism.task
    if not held:
        motions, sigma, _ = decomposed(post.present.major * _major_scale(rows))
        if len(sigma) > 1 and sigma[-2] > STANDS_OUT * sigma[-1]:
            return _main_names(task.major, motions[:, -1:], MAIN_SHARE)
        return ()
    scale = rows.twist_scale[rows.task_rows, None]
    basis = range_basis(post.nominal.jacobian * scale)
    motions, sigma, _ = decomposed(basis.T @ (post.present.jacobian * scale))
    if len(sigma) > 1 and sigma[0] > STANDS_OUT * sigma[1]:
        return _main_names(task.coordinates, basis @ motions[:, :1], MAIN_SHARE)
    return ()


def _twist_names(rows: StrutRows) -> tuple[str, ...]:
    if len(rows.twist_scale) == len(COORDINATES):
        return COORDINATES
    return rows.mechanism.task.coordinates


def _major_scale(rows: StrutRows) -> FloatArray:
    task = rows.mechanism.task
    return rows.twist_scale[rows.task_rows[task.major_rows], None]


def _drifting(
    present: DifferentialKinematics, rows: StrutRows, least: float
) -> tuple[str, ...]:
    """Return the coordinates whose share in the unactuated motion is above ``least``."""
    if present.stable:
        return ()
    scaled = present.unactuated * rows.twist_scale[:, None]
    return _main_names(_twist_names(rows), scaled, least)


def _main_names(names: Sequence[str], motions: FloatArray, least: float) -> tuple[str, ...]:
    """Return those of ``names`` (d) whose share in ``motions`` (d, k) is above ``least``."""
    share = np.linalg.norm(motions, axis=1)
    notable = share > least * share.max(initial=0.0)
    return tuple(name for name, moves in zip(names, notable, strict=True) if moves)


def _reason(
    failures: FailureSet,
    task: Task,
    drift: str,
    lost: tuple[str, ...],
    gained: tuple[str, ...],
    missing: tuple[str, ...],
) -> str:
    what = failures_in_words(failures)
    if drift:
        return f'{what}; {drift}: zero velocity does not hold the platform'
    if missing:
        return f'{what}; {", ".join(missing)} cannot be given independently'
    parts = [f'{what}; {", ".join(task.major)} retained' if failures else what]
    if lost:
        parts.append(f'{", ".join(lost)} coupled')
    if gained:
        parts.append(f'{", ".join(gained)} gained')
    return ', '.join(parts)
