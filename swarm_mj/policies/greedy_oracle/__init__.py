"""The greedy oracle: a schedule by a centre that knows everything."""
