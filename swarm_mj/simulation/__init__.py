"""Missions side by side, window by window, and whole rollouts."""
