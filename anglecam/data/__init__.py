"""Data that the packages exchange: plain frozen dataclasses, without file formats."""
