"""Pixel operations that the other rooms share: transforms, noise, median, clusters, lamp."""
