"""How fast the simulation, the policies and the training are."""
