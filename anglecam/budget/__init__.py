"""The uncertainty budget: every term of the angle's uncertainty, combined by the rules of the GUM."""
