"""The controllers (IV-A): what the robots do, on no more than each has heard."""
