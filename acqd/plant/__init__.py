"""The plant on a page: every device with its alarm, cause, energy and cost; a month to print; an inventory."""
