"""Renderers behind one interface, and a measurement of their edge errors."""
