"""The paper's design calculations on top of its equations: procedure, systems, tables, figures."""
