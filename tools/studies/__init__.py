"""Studies: long campaigns that judge acqd on data it has not seen."""
