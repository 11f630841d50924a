"""Replays (rerun): a recorded mission as one file, drawn to be understood at a glance."""
