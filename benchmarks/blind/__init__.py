"""Tests of the loop on held-out truths: sessions drawn from seeds, as angle series and as films."""
