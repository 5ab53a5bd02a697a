# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0

"""The engines that can simulate a mechanism, by name."""

from __future__ import annotations

import numpy as np

from fault_tolerance.errors import EngineError
from fault_tolerance.mechanism.description import Mechanism
from fault_tolerance.simulation.mujoco import MujocoPlant, library
from fault_tolerance.simulation.plant import ElasticPlant
from fault_tolerance.simulation.plant_settings import PlantSettings
from fault_tolerance.simulation.state import Plant

_ENGINES: dict[str, type[ElasticPlant] | type[MujocoPlant]] = {
    'elastic': ElasticPlant,
    'mujoco': MujocoPlant,
}

ENGINES = tuple(_ENGINES)
"""The words `plant_named` understands; the first one needs no other package."""


def require_engine(engine: str) -> None:
    """Raise `EngineError` if there is no such ``engine``, or the package it needs is missing."""
    if engine not in _ENGINES:
        raise EngineError(f'engine {engine!r} is not one of {", ".join(ENGINES)}')
    if engine == 'mujoco':
        library()


def plant_named(
    engine: str,
    mechanism: Mechanism,
    settings: PlantSettings | None = None,
    rng: np.random.Generator | int = 0,
) -> Plant:
    """Return ``mechanism``, simulated by the ``engine`` of that name in `ENGINES`.

    ``rng`` is the source, or the seed, of the sensor noise; ``settings`` are `PlantSettings`.
    Raises `EngineError` as `require_engine` does, and `MechanismError` for a mechanism that is
    given by its Jacobian only.
    """
    require_engine(engine)
    return _ENGINES[engine](mechanism, settings, rng)
