"""Types and shapes are checked in every test, no matter what was called in those before it."""

import numpy as np
import pytest
from jaxtyping import TypeCheckError
from sampled_types import CHECKED_CALLS

from swarm_mj.evaluation.samples import standard_error

SQUARE = np.ones((2, 2))  # where a row is due


@pytest.mark.slow  # where these are left out, types are checked in the first calls of each module
@pytest.mark.parametrize("test", range(2))
def test_a_wrong_shape_is_refused_in_the_first_calls_of_each_test(test):  # noqa: ARG001
    with pytest.raises(TypeCheckError):
        standard_error(SQUARE)
    for _ in range(CHECKED_CALLS):
        standard_error(np.ones(2))
    standard_error(SQUARE)
