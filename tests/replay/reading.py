"""Reads components of a replay back as plain arrays."""

import numpy as np
from rerun.chunk import RrdReader


def entities(path):
    """The names of everything a replay has."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def column(path, entity, component):
    """The one timed chunk of an entity: a component's rows as nested lists."""
    chunks = RrdReader(path).stream().filter(content=entity)
    batches = [chunk.to_record_batch() for chunk in chunks if not chunk.is_static]
    (batch,) = (batch for batch in batches if component in batch.schema.names)
    return batch.column(component)


def rows(path, entity, component, *shape):
    """A component with the same number of values in each window."""
    return column(path, entity, component).flatten().flatten().to_numpy().reshape(-1, *shape)


def counts(path, entity, component):
    """How many values a component has in each window."""
    return np.diff(column(path, entity, component).offsets.to_numpy())


def static(path, entity, component):
    """A component that never changes."""
    chunks = RrdReader(path).stream().filter(content=entity)
    batches = (chunk.to_record_batch() for chunk in chunks if chunk.is_static)
    (value,) = (batch.column(component) for batch in batches if component in batch.schema.names)
    return np.array(value.to_pylist()).ravel()


def rows_of_strips(path, entity):
    """Straight lines as [start, end] pairs, all windows in a row."""
    lines = column(path, entity, "LineStrips2D:strips").flatten()
    return lines.flatten().flatten().to_numpy().reshape(-1, 2, 2)


def colours(path, entity, component, num):
    """RGB of `num` things in each window."""
    rgba = column(path, entity, component).flatten().to_numpy()
    return np.stack([(rgba >> shift) & 255 for shift in (24, 16, 8)], axis=-1).reshape(-1, num, 3)
