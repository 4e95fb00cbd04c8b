"""The uncertainty budget: every term of the angle's uncertainty, by the rules of the GUM."""
