"""Python in five lines: `fly` and `evaluate`, and what they give back."""
