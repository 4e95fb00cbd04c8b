"""The rotation of a rigid body without a mark, from features and keyframes."""
