"""Films of simple mechanisms, drawn by OpenCV from a kind and a seed, with the angle of every moving part."""
