"""Fast forward models: the angle that a model predicts at given instants, with effects of the ledger switched in."""
