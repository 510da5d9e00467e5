"""Robot descriptions from URDF files."""
