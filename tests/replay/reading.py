"""Reads components of a replay back as plain arrays."""

import numpy as np
from rerun.chunk import RrdReader


def column(path, entity, component):
    """The one timed chunk of an entity: a component's rows as nested lists."""
    chunks = [
        chunk.to_record_batch()
        for chunk in RrdReader(path).stream().filter(content=entity)
        if not chunk.is_static
    ]
    (chunk,) = (batch for batch in chunks if component in batch.schema.names)
    return chunk.column(component)


def rows(path, entity, component, *shape):
    """A component with the same number of values in each window."""
    return column(path, entity, component).flatten().flatten().to_numpy().reshape(-1, *shape)


def counts(path, entity, component):
    """How many values a component has in each window."""
    return np.diff(column(path, entity, component).offsets.to_numpy())


def static(path, entity, component):
    """A component that never changes."""
    (value,) = (
        chunk.to_record_batch().column(component)
        for chunk in RrdReader(path).stream().filter(content=entity)
        if chunk.is_static and component in chunk.to_record_batch().schema.names
    )
    return np.array(value.to_pylist()).ravel()


def rows_of_strips(path, entity):
    """Straight lines as [start, end] pairs, all windows in a row."""
    lines = column(path, entity, "LineStrips2D:strips").flatten()
    return lines.flatten().flatten().to_numpy().reshape(-1, 2, 2)
