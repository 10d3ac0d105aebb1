"""Meshes of other programs: what their files mean, and what is assumed or lost in reading them."""
