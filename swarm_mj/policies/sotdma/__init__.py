"""Self-organised TDMA: robots choose their own slots, announced implicitly by transmitting."""
