"""Files written whole and read with care, locks, processes and signals, and the code's version."""
