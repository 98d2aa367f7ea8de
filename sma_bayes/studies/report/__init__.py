"""The report of a finished run, built again from its folder."""
