"""Robot swarms on MuJoCo that share their state over a radio they compete for."""
