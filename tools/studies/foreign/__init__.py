"""A foreign plant: an independent generator of robot data, and the study that judges `acqd close-loop` on them."""
