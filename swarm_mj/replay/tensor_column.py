"""A column of matrices for rerun, whose own `Tensor.columns` takes no batches in 0.41."""

import numpy as np
import pyarrow as pa
import rerun as rr
from jaxtyping import Float16


class _ArrowBatch:
    """A ready Arrow array as rerun's ComponentBatchLike."""

    def __init__(self, array: pa.Array) -> None:
        self._array = array

    def as_arrow_array(self) -> pa.Array:
        """The array."""
        return self._array


def tensor_column(
    matrices: Float16[np.ndarray, "T R C"], names: tuple[str, str]
) -> list[rr.ComponentColumn]:
    """One matrix per time step.

    Args:
        matrices: The matrices.
        names: What rows and columns are.

    Returns:
        The column, for `send_columns`.
    """
    steps = [rr.Tensor(each, dim_names=names).as_component_batches()[0] for each in matrices]
    column = _ArrowBatch(pa.concat_arrays([step.as_arrow_array() for step in steps]))
    return [rr.ComponentColumn(steps[0].component_descriptor(), column)]
