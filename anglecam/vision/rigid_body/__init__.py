"""Follow a rigid body that carries no mark."""
