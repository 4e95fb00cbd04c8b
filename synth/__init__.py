"""A virtual laboratory: moves a mechanism by physics of its own, films it, and keeps the truth apart."""
