"""Places and colours on a picture, by hand; `test_picture` looks at whole ones."""

from swarm_mj.api.picture_text import HEIGHT_IN, WIDTH_IN, rgb, share


def test_places_are_shares_of_the_picture():
    assert share(0.0, 0.0, WIDTH_IN, HEIGHT_IN) == (0.0, 0.0, 1.0, 1.0)
    left, bottom, width, height = share(WIDTH_IN / 2.0, HEIGHT_IN / 4.0, 1.28, 0.72)
    assert (left, bottom) == (0.5, 0.25)
    assert (round(width, 9), round(height, 9)) == (0.1, 0.1)


def test_colours_are_written_in_hexadecimal():
    assert rgb((255, 128, 0)) == "#ff8000"
