"""The paper's figures (V), drawn from results beside the published curves."""

import logging


def quiet_matplotlib() -> None:
    """Have matplotlib open no window, and not warn of its cache if it was not imported yet."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib as mpl  # slow to import

    mpl.use("Agg")
