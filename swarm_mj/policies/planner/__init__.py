"""The common-knowledge planner: every robot computes the whole team's schedule."""
