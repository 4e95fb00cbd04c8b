"""Identification: from angle series and commands to a model's parameters with their uncertainty."""
