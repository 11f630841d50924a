"""Shares in per cent, as tables and lines show them."""

ALL = "100%"
NONE = "0%"


def percent(share: float) -> str:
    """Return a share in whole per cent, of which only all is 100% and only nothing is 0%.

    Args:
        share: From 0 to 1.

    Example:
        >>> percent(0.25), percent(0.996), percent(0.001)
        ('25%', '>99%', '<1%')
    """
    rounded = f"{share:.0%}"
    if rounded == ALL and share < 1.0:
        return ">99%"
    if rounded == NONE and share > 0.0:
        return "<1%"
    return rounded
