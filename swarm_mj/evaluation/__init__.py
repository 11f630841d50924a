"""Evaluation (IV-B): policies over the same missions, in batches, on several processes."""
