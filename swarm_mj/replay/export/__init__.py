"""Replays as files of other tools: tables, traces for network simulators, Foxglove's recordings."""
