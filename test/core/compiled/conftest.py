# Copyright 2026 The fault_tolerance developers
# SPDX-License-Identifier: Apache-2.0
"""The compiled functions, switched off until a test asks for them."""

import pytest

from fault_tolerance.compiled.activation import Active, activate, deactivate


@pytest.fixture(scope='package')
def kernels():
    """Return the compiled functions."""
    assert activate() == ''
    found = Active.kernels
    deactivate()
    return found
