"""Self-organised TDMA: robots choose their own slots, and tell each other by speaking in them."""
