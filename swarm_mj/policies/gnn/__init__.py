"""The Aggregation GNN (III-A): from a buffer to features, and from features to a decision."""
