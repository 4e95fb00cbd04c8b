"""Renderers behind one interface, and how far each is from exact areas."""
