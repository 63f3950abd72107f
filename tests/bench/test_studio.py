"""`bench studio`: what it refuses; a whole run takes minutes and a browser."""

from materialist.bench import studio


def test_every_move_changes_the_picture():
    last = {"hue": 40.0, "saturation": 0.0, "value": 0.0, "roughness": 0.5, "metallic": 0.0}
    for name, value in studio.slider_moves(600, 4, last.copy()):
        low, high = studio._RANGES[name]
        assert low <= value <= high
        assert abs(value - last[name]) >= 0.05 * (high - low)
        last[name] = value
