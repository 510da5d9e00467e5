"""The public interface, one module per topic. `acqd` re-exports its names; nothing else in acqd is public."""
