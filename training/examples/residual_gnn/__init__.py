"""A network that corrects a rule's choice of who transmits."""
