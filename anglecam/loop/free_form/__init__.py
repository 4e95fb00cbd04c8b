"""The missing torque in free form, where no effect explains the residual: a smooth function of a quantity or two."""
