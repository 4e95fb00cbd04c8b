"""Test films with known truth: simulates a mechanism, renders a film of it, and writes the true motion elsewhere.

The simulation shares no approximation with `anglecam`: it imports only the paper's equations (`anglecam.neck`).
"""
