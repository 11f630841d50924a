"""The scales of features that several sets have."""

ADDRESS_RANGES = 1.2  # a teammate believed farther away cannot be addressed [ranges]
FAR_RANGES = 4.0  # distances count up to here [ranges]
CROWD = 10.0  # neighbours that count as 1
TEAM = 40.0  # robots that count as 1
