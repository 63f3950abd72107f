"""The lights that a person can choose from."""

from materialist.edits.light import presets
from materialist.edits.light.relight import checked_envmap


def test_lights_are_environment_maps():
    made = {name: presets.light(name, 64) for name in presets.names()}
    assert all(checked_envmap(light).shape == (64, 128, 3) and 0 < light.mean() < 20 for light in made.values())
    assert made["Window"][:, 64:].sum() > made["Window"][:, :64].sum()  # on the right
    assert made["Noon"][:32].sum() > made["Noon"][32:].sum()  # from above
