"""Command sources of a robot: network, central pattern generator, playback."""
