"""Contention by a learned index: robots keep a table of what their neighbours know."""
