"""From clips of a moving mechanism to its angle, its model, and what the model lacks."""
