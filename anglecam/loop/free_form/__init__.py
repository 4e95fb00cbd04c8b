"""The missing torque in free form: a smooth function of one or two quantities, where no effect of the ledger explains
the residual."""
