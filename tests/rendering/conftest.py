"""Whether pictures can be drawn on this machine."""

import pytest

from swarm_mj.rendering.opengl import make_context


@pytest.fixture(scope="session")
def opengl():
    """Skips the test where there is no OpenGL."""
    try:
        make_context(8, 8).free()
    except OSError as error:
        pytest.skip(str(error))
