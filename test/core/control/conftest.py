# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""Everything here holds by numpy, and by the compiled path where numba is installed."""

import pytest

from fault_tolerance.compiled.activation import activate, deactivate


@pytest.fixture(
    scope='module',
    autouse=True,
    params=['by numpy', pytest.param('compiled', marks=pytest.mark.needs_numba)],
)
def way(request):
    """Choose how commands are computed."""
    if request.param == 'compiled':
        assert activate() == ''
    yield request.param
    deactivate()
