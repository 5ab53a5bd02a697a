# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""What is left after failures: the new kinematics and whether they will do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from fault_tolerance.kinematics.differential import (
    DifferentialKinematics,
    differential_kinematics,
)
from fault_tolerance.kinematics.failures import FailureSet
from fault_tolerance.kinematics.rows import StrutRows
from fault_tolerance.kinematics.subspaces import adds_rank, range_basis, rank
from fault_tolerance.mechanism.arrays import FloatArray
from fault_tolerance.mechanism.linear_algebra import decomposed, length
from fault_tolerance.mechanism.task import COORDINATES, Task
from fault_tolerance.tolerances import RANK_TOLERANCE

# Smaller shares of an unactuated motion are rounding errors.
_NOTABLE = 1e-6
# Smaller shares are not worth a word to a person.
_MAIN = 0.3
# A motion the drives master so many times worse than any other is worth naming.
_STANDS_OUT = 5.0


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


@dataclass(frozen=True, eq=False)
class PostFailure:
    """The kinematics at one configuration with failures, and what follows when it is asked for.

    Attributes
    ----------
    rows : StrutRows
    failures : FailureSet
    present : DifferentialKinematics
        With the failures.
    known_nominal : DifferentialKinematics or None
        Without them, where it has been derived already.
    """

    rows: StrutRows
    failures: FailureSet
    present: DifferentialKinematics
    known_nominal: DifferentialKinematics | None = None

    @cached_property
    def nominal(self) -> DifferentialKinematics:
        """The kinematics without failures."""
        if not self.failures:
            return self.present
        return self.known_nominal or differential_kinematics(self.rows)

    @cached_property
    def verdict(self) -> Verdict:
        """Whether the mechanism can do its task in this state, and why (not)."""
        return verdict(self.rows, self.failures, self.nominal, self.present)


def reconfigured(
    rows: StrutRows,
    failures: FailureSet | None = None,
    nominal: DifferentialKinematics | None = None,
) -> PostFailure:
    """Return the kinematics with ``failures`` present, from the nominal rows.

    Parameters
    ----------
    rows : StrutRows
        Of the complete mechanism at the present configuration.
    failures : FailureSet, optional
        All failures present, however and in whatever order they came.
    nominal : DifferentialKinematics, optional
        Of the same rows without failures, where the caller has it already.
    """
    failures = failures or FailureSet()
    present = None if failures else nominal
    return PostFailure(
        rows, failures, present or differential_kinematics(rows, failures), nominal
    )


def verdict(
    rows: StrutRows,
    failures: FailureSet,
    nominal: DifferentialKinematics,
    present: DifferentialKinematics,
) -> Verdict:
    """Return the verdict on ``present`` kinematics that were ``nominal`` before ``failures``."""
    task = rows.mechanism.task
    if not failures and present is nominal and _is_sound(rows, present):
        return sound_verdict(present.mobility)
    names = _twist_names(rows)
    order = [*task.by_priority, *(name for name in names if name not in task.coordinates)]
    places = [names.index(name) for name in order]
    scale = rows.twist_scale[places, None]
    before = adds_rank(nominal.twist_jacobian[places] * scale)
    after = before
    if present is not nominal:
        after = adds_rank(present.twist_jacobian[places] * scale)
    in_task = len(task.coordinates)
    lost = tuple(
        name
        for name, was, is_ in zip(order[:in_task], before, after, strict=False)
        if was and not is_
    )
    gained = tuple(
        name for name, was, is_ in zip(order, before, after, strict=True) if is_ and not was
    )
    drifting, mainly = _drifting(present, rows, _NOTABLE), _drifting(present, rows, _MAIN)
    major = rank(present.major * _major_scale(rows))
    tolerable = present.stable and major == len(task.major)
    missing = _missing(rows, after, order)
    drift = ', '.join(mainly) if mainly == drifting else f'mostly {", ".join(mainly)}'
    if drift:
        drift += f' unactuated ({_motions_in_words(int(present.unactuated.shape[1]))})'
    reason = _reason(failures, task, drift, lost, gained, missing)
    return Verdict(
        present.stable, tolerable, present.mobility, lost, gained, drifting, reason
    )


@cache
def sound_verdict(mobility: int) -> Verdict:
    """Return the verdict on kinematics that no failure has befallen, and that lack nothing.

    Parameters
    ----------
    mobility : int
        Of these kinematics. (The result is kept: it is asked for every cycle.)
    """
    return Verdict(True, True, mobility, (), (), (), failures_in_words(FailureSet()))


def _is_sound(rows: StrutRows, kinematics: DifferentialKinematics) -> bool:
    """Return whether ``kinematics`` have all that is asked of them, clearly so."""
    if not kinematics.stable:
        return False
    weights = rows.twist_scale[rows.task_rows[kinematics.task.major_rows]]
    sigma = kinematics.decomposed_major(weights)[1]
    if len(sigma) < len(weights):
        return False
    # Then no major row depends on those before it either: all that they leave of it is longer.
    smallest = float(sigma[-1])
    # Rotations count by a length: their scale is the largest, or 1.
    most = max(1.0, float(rows.twist_scale[0]))
    if smallest > RANK_TOLERANCE * most * length(kinematics.twist_jacobian):
        return True
    return smallest > RANK_TOLERANCE * length(
        kinematics.twist_jacobian * rows.twist_scale[:, None]
    )


def failures_in_words(failures: FailureSet) -> str:
    """Return, for example, ``theta_4 stuck, theta_2 free, strut_3 lost``."""
    words = [f'{name} stuck' for name in failures.stuck]
    words += [f'{name} free' for name in failures.free]
    words += [f'{name} lost' for name in failures.lost]
    return ', '.join(words) if words else 'no failure'


def weakest_motion(state: PostFailure, *, held: bool) -> tuple[str, ...]:
    """Return the coordinates that mainly make up the motion which the drives master least.

    Near a singularity there is one that stands out; elsewhere nothing is returned.

    Parameters
    ----------
    state : PostFailure
    held : bool
        Whether the motion that they hold least is asked for, of those the task had before, or
        the one that they move least, of the major task.
    """
    rows, task = state.rows, state.rows.mechanism.task
    if not held:
        motions, sigma, _ = decomposed(state.present.major * _major_scale(rows))
        if len(sigma) > 1 and sigma[-2] > _STANDS_OUT * sigma[-1]:
            return _main_names(task.major, motions[:, -1:], _MAIN)
        return ()
    scale = rows.twist_scale[rows.task_rows, None]
    basis = range_basis(state.nominal.jacobian * scale)
    motions, sigma, _ = decomposed(basis.T @ (state.present.jacobian * scale))
    if len(sigma) > 1 and sigma[0] > _STANDS_OUT * sigma[1]:
        return _main_names(task.coordinates, basis @ motions[:, :1], _MAIN)
    return ()


def _twist_names(rows: StrutRows) -> tuple[str, ...]:
    if len(rows.twist_scale) == len(COORDINATES):
        return COORDINATES
    return rows.mechanism.task.coordinates


def _major_scale(rows: StrutRows) -> FloatArray:
    task = rows.mechanism.task
    return rows.twist_scale[rows.task_rows[task.major_rows], None]


def _missing(rows: StrutRows, after: tuple[bool, ...], order: list[str]) -> tuple[str, ...]:
    """Return the major coordinates that cannot be given independently."""
    major = rows.mechanism.task.major
    return tuple(name for name, new in zip(order, after, strict=True) if name in major and not new)


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


def _motions_in_words(count: int) -> str:
    return '1 motion' if count == 1 else f'{count} motions'


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
