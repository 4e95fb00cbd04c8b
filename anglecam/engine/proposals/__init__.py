"""Finders of what may turn, and by how much in each frame of a sample; many and wrong is fine."""
