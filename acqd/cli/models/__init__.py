"""`acqd train`, `acqd compare`, `acqd predict`."""
