"""From an angle series and its command to a model's parameters with their uncertainty."""
